"""The picture that all pages share: each UAV as it is now, and where it was. Pure; draws nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ual_tools.view import palette
from ual_tools.view.journal import Journal
from ual_tools.view.pose_times import PoseTimes
from ual_tools.view.shown import Shown, shown
from ual_tools.view.track import Track
from ual_tools.watch_board import Board, WatchedUav


@dataclass(frozen=True, slots=True)
class Moment:
    """Known data of one moment. `now_s` is the monotonic time, `utc_s` the same moment since 1970."""

    now_s: float
    utc_s: float
    watched: Mapping[str, WatchedUav]
    uavs: Mapping[str, Shown]
    tracks: Mapping[str, Track]


class PagePicture:
    """Looks at the board repeatedly, and remembers the tracks."""

    def __init__(self, board: Board, journal: Journal) -> None:
        self._board = board
        self._journal = journal
        self._poses = PoseTimes()
        self._tracks: dict[str, Track] = {}
        self._numbers: dict[str, int] = {}

    def update(self, now_s: float, utc_s: float) -> Moment:
        """Returns the moment. A UAV that is not on the board any more is forgotten."""
        watched = self._board.watched_uavs()
        self._poses.keep(watched)
        uavs = {ns: self._shown(ns, each, now_s, utc_s) for ns, each in watched.items()}
        self._tracks = {ns: self._tracks.get(ns) or Track() for ns in uavs}
        for ns, uav in uavs.items():
            self._tracks[ns].add(now_s, uav)
            self._journal.note_changes(uav, watched[ns], utc_s)
        return Moment(now_s, utc_s, watched, uavs, self._tracks)

    def _shown(self, ns: str, watched: WatchedUav, now_s: float, utc_s: float) -> Shown:
        return shown(
            ns,
            watched,
            now_s=now_s,
            utc_s=utc_s,
            lost_after_s=self._board.lost_after_s,
            pose_since_s=self._poses.since_s(ns, watched, now_s),
            mark=palette.colour(self._numbers.setdefault(ns, len(self._numbers))),
        )
