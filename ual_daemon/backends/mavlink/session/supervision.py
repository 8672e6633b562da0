"""The statistics of the link to the autopilot, besides its state. Pure logic: callers pass the time."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from ual_daemon.backends.engine.link_watch import LinkWatch, LinkWatchState
from ual_daemon.backends.mavlink.session.sequence import LATE_FRAMES_COUNT, SequenceGaps
from ual_daemon.backends.mavlink.session.timesync import Timesync

_CONNECTED = LinkWatchState.CONNECTED
QUALITY_WINDOW_S = 10.0
"""Seconds over which rate and loss are measured."""
_SHORT_LINK_SILENCE_S = 0.1
"""Sequence numbers cannot wrap within this time: the link carries fewer than 256 messages in it."""


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Statistics of the link: of the last `QUALITY_WINDOW_S`, or counts since the start.

    `rate_hz` is the autopilot's messages per second, and `loss` the part of its messages that did not arrive (0 to 1).
    `round_trip_s` is the newest one measured by TIMESYNC (None: not measured). Counted are pieces that belong to no
    frame (`corrupt_count`), and frames dropped for their signature (`unsigned_count`) or because another host sent them
    (`stranger_count`). So are values that cannot be true (`impossible_count`), reboots of the autopilot, and how often
    the link was lost.
    """

    state: LinkWatchState = LinkWatchState.CONNECTING
    rate_hz: float = 0.0
    loss: float = 0.0
    round_trip_s: float | None = None
    corrupt_count: int = 0
    unsigned_count: int = 0
    stranger_count: int = 0
    impossible_count: int = 0
    reboots_count: int = 0
    lost_count: int = 0


@dataclass(slots=True)
class _Second:
    """The counts of about a second."""

    since_s: float
    received_count: int = 0
    lost_count: int = 0


class LinkCounts:
    """Counts what comes from one autopilot, besides the `watch` of its link.

    Not thread-safe: belongs to the thread that receives; others may read `statistics`.
    """

    def __init__(self, watch: LinkWatch) -> None:
        self.watch = watch
        self.timesync = Timesync()
        self._gaps = SequenceGaps()
        self._seconds: deque[_Second] = deque()
        self._second = _Second(-math.inf)
        """The newest one, in which frames are counted until then."""
        self._counted_until_s = -math.inf

    def on_frame(self, sequence: int, now_s: float) -> None:
        """Takes note of a frame of the autopilot."""
        watch, gaps = self.watch, self._gaps
        heard_s = watch.heard_s
        if heard_s is not None and now_s - heard_s <= _SHORT_LINK_SILENCE_S and watch.state is _CONNECTED:
            watch.heard_s, silence_s = now_s, 0.0  # as `on_message` does, without a call
            if sequence == gaps.next and now_s < self._counted_until_s:  # nearly always
                gaps.next = sequence + 1 & 0xFF
                self._second.received_count += 1
                return
        else:
            silence_s = watch.on_message(now_s)
        if silence_s > _SHORT_LINK_SILENCE_S and silence_s * self._rate_hz(now_s - silence_s) > LATE_FRAMES_COUNT:
            self._gaps = SequenceGaps()  # the numbers may have wrapped: they do not show what was lost
        if now_s >= self._counted_until_s:
            self._second, self._counted_until_s = _Second(now_s), now_s + 1.0
            self._seconds.append(self._second)
            while now_s - self._seconds[0].since_s > QUALITY_WINDOW_S:
                self._seconds.popleft()
        newest = self._second
        newest.received_count += 1
        newest.lost_count += self._gaps.count_lost(sequence)

    def on_boot_time(self, boot_s: float, now_s: float) -> bool:
        """Takes the autopilot's time since boot from a message. Returns whether the autopilot has rebooted."""
        has_rebooted = self.watch.on_boot_time(boot_s, now_s)
        if has_rebooted:
            self._gaps = SequenceGaps()
        return has_rebooted

    def statistics(self, now_s: float, corrupt_count: int = 0, unsigned_count: int = 0) -> LinkStatistics:
        """Returns the statistics as of now, with the counts of the receiver."""
        seconds = self._in_window(now_s)
        received = sum(each.received_count for each in seconds)
        lost = max(0, sum(each.lost_count for each in seconds))
        return LinkStatistics(
            state=self.watch.state,
            rate_hz=self._rate_hz(now_s),
            loss=lost / (received + lost) if received else 0.0,
            round_trip_s=self.timesync.round_trip_s,
            corrupt_count=corrupt_count,
            unsigned_count=unsigned_count,
            reboots_count=self.watch.reboots_count,
            lost_count=self.watch.lost_count,
        )

    def loss(self, now_s: float) -> float:
        """Returns the part of the autopilot's messages that did not arrive lately (0 to 1)."""
        return self.statistics(now_s).loss

    def _in_window(self, now_s: float) -> list[_Second]:
        return [each for each in list(self._seconds) if now_s - each.since_s <= QUALITY_WINDOW_S]

    def _rate_hz(self, now_s: float) -> float:
        seconds = self._in_window(now_s)
        span_s = max(1.0, now_s - seconds[0].since_s) if seconds else 1.0
        return sum(each.received_count for each in seconds) / span_s
