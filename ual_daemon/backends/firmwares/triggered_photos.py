"""The pictures that an autopilot says it has triggered, whatever protocol passes its reports on."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import UalError, UalTimeoutError
from ual.types import GeoPoint
from ual_daemon.backends import futures
from ual_daemon.backends.engine.photo_log import PhotoLog
from ual_daemon.backends.offers.cameras import TakenPhoto, Viewpoint
from ual_daemon.backends.values import Freshness, Snapshot

REPORT_S = 8.0
"""Seconds for which a report of a picture is awaited, with the acknowledgement of its order."""
LARGEST_GAP_PHOTOS = 1000
"""Numbers of pictures that are further apart are no lost pictures: the camera counts again."""


def viewpoint_of(snapshot: Snapshot, freshness: Freshness) -> Viewpoint:
    """Returns from where a picture is taken now."""
    pose = snapshot.motion.pose
    is_fresh = pose is not None and snapshot.time_s - pose.time_s <= freshness.pose_s
    body = pose.value if pose is not None and is_fresh else None
    return Viewpoint(body, snapshot.link.boots_count, None, snapshot.position_geo() if is_fresh else None)


class _AwaitedPhoto:
    """Waits for the report of a picture that is ordered."""

    def __init__(self, future: Future[TakenPhoto]) -> None:
        self.future = future
        self._until_s: float | None = None

    def tick(self, now_s: float) -> None:
        """Ends it after a while."""
        if self._until_s is None:
            self._until_s = now_s + REPORT_S
        elif now_s >= self._until_s:
            text = f"the autopilot has not told a picture for {REPORT_S:g} s: it is not known whether it took one"
            self.fail(UalTimeoutError(text))

    def fail(self, error: BaseException) -> None:
        """Ends it with an error."""
        if not self.future.done():
            futures.fail(self.future, error)

    def finish(self, taken: TakenPhoto) -> None:
        """Ends it with a picture."""
        if not self.future.done():
            futures.finish(self.future, taken)


class TriggeredPhotos:
    """Belongs to the thread that receives; `photos`, `missed_count` and `distance_m` are for any thread.

    `look` returns from where a picture is taken now, `utc_s` the present time.
    """

    def __init__(self) -> None:
        self.look: Callable[[], Viewpoint] = Viewpoint
        self.utc_s: Callable[[], float] = time.time
        self.photos: PhotoLog[TakenPhoto] = PhotoLog()
        self.missed_count = 0
        """Reports that were lost: by their numbers."""
        self.distance_m: float | None = None
        """Distance in metres of the last order."""
        self._last: int | None = None
        self._waiting: list[_AwaitedPhoto] = []

    def await_photo(self, future: Future[TakenPhoto]) -> None:
        """Ends a future with the next picture."""
        self._waiting.append(_AwaitedPhoto(future))

    def tick(self, now_s: float) -> None:
        """Ends what has waited too long; to be called often."""
        for each in self._waiting:
            each.tick(now_s)
        self._waiting = [each for each in self._waiting if not each.future.done()]

    def drop(self, error: UalError) -> None:
        """Ends what waits. The numbers of pictures may begin again."""
        for each in self._waiting:
            each.fail(error)
        self._waiting, self._last, self.distance_m = [], None, None

    def on_report(self, number: int, stamp_s: float | None, position: GeoPoint | None) -> None:
        """Takes that a picture was taken: its number, and where and when, as far as that is reported."""
        if number == self._last:
            return
        if self._last is not None and 0 < number - self._last <= LARGEST_GAP_PHOTOS:
            self.missed_count += number - self._last - 1
        self._last = number
        here = self.look()
        viewpoint = here._replace(position_geo=position or here.position_geo)
        stamp_s = stamp_s or self.utc_s()
        taken = self.photos.add(lambda added: TakenPhoto(added, stamp_s, viewpoint))
        for each in self._waiting:
            each.finish(taken)
