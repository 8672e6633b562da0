"""The quality of the link to the autopilot: its state and statistics. Pure logic: callers pass the time."""

from __future__ import annotations

import logging
from collections import deque
from dataclasses import dataclass
from enum import Enum

from ual_daemon import logs
from ual_daemon.backends.engine.boot_time import BootTime
from ual_daemon.backends.mavlink.session.sequence import LATE_COUNT, SequenceGaps
from ual_daemon.backends.mavlink.session.timesync import Timesync

_log = logging.getLogger(__name__)

STALE_S = 0.5
"""A link that is silent for this long is degraded: of every stream of 4 Hz or more two messages did not come."""
WINDOW_S = 10.0
"""Rate and loss are those of the last so many seconds."""
_SHORT_SILENCE_S = 0.1
"""Sequence numbers cannot wrap within this time: the link carries fewer than 256 messages in it."""


class LinkState(Enum):
    """CONNECTING: no autopilot found yet. STALE: silent for `STALE_S`. LOST: silent so long that nothing is known."""

    CONNECTING = "connecting"
    CONNECTED = "connected"
    STALE = "stale"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Statistics of the link: of the last `WINDOW_S`, or counts since the start.

    `rate_hz` is the autopilot's messages per second, `loss` the part of its messages that did not arrive (0 to 1), and
    `round_trip_s` the newest one measured by TIMESYNC (None: not measured). Counted are pieces that belong to no frame
    (`corrupt_count`), frames dropped for their signature (`unsigned_count`) or because another host sent them
    (`stranger_count`), values that cannot be true (`impossible_count`), reboots of the autopilot, and how often the
    link was lost.
    """

    state: LinkState = LinkState.CONNECTING
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


class Supervision:
    """Watches the link to one autopilot and logs each change of its state.

    Not thread-safe: belongs to the thread that receives; others may read `state` and `statistics`. The link counts as
    lost after a silence of `lost_s`.
    """

    def __init__(self, url: str, lost_s: float) -> None:
        self.lost_s = lost_s
        self.state = LinkState.CONNECTING
        self.heard_s: float | None = None
        self.timesync = Timesync()
        self.reboots_count = 0
        self.lost_count = 0
        self._url = url
        self._gaps = SequenceGaps()
        self._seconds: deque[_Second] = deque()
        self._boot_time = BootTime()
        self._boots_count = 0

    @property
    def boot_s(self) -> float:
        """The newest time since boot."""
        return self._boot_time.boot_s

    @property
    def is_boot_doubtful(self) -> bool:
        """See `BootTime.is_doubtful`."""
        return self._boot_time.is_doubtful

    def begin_boot(self) -> int:
        """Returns the number of a boot that begins for us: with each session, and with each reboot."""
        self._boots_count += 1
        return self._boots_count

    def on_frame(self, sequence: int, now_s: float) -> None:
        """Takes note of a frame of the autopilot."""
        before_s = now_s if self.heard_s is None else self.heard_s
        silence_s = now_s - before_s
        if silence_s > _SHORT_SILENCE_S and silence_s * self._rate_hz(before_s) > LATE_COUNT:
            self._gaps = SequenceGaps()  # the numbers may have wrapped: they do not show what was lost
        self.heard_s = now_s
        if not self._seconds or now_s - self._seconds[-1].since_s >= 1.0:
            self._seconds.append(_Second(now_s))
            while now_s - self._seconds[0].since_s > WINDOW_S:
                self._seconds.popleft()
        newest = self._seconds[-1]
        newest.received_count += 1
        newest.lost_count += self._gaps.count_lost(sequence)
        if self.state is not LinkState.CONNECTED:
            self._change(LinkState.CONNECTED, silence_s)

    def update_boot_time(self, boot_s: float, now_s: float) -> bool:
        """Takes the autopilot's time since boot from a message. Returns whether the autopilot has rebooted."""
        is_new = self._boot_time.update(boot_s, now_s)
        if is_new:
            self.reboots_count += 1
            self._gaps = SequenceGaps()
            logs.event(_log, logging.WARNING, "autopilot_rebooted", url=self._url, reboots_count=self.reboots_count)
        return is_new

    def tick(self, now_s: float) -> None:
        """Detects silence; to be called often."""
        if self.heard_s is None:
            return
        silence_s = now_s - self.heard_s
        if silence_s > self.lost_s:
            if self.state is not LinkState.LOST:
                self.lost_count += 1
                self._change(LinkState.LOST, silence_s)
        elif silence_s > STALE_S and self.state is LinkState.CONNECTED:
            self._change(LinkState.STALE, silence_s)

    def statistics(self, now_s: float, corrupt_count: int = 0, unsigned_count: int = 0) -> LinkStatistics:
        """Returns the statistics as of now, with the counts of the receiver."""
        seconds = self._in_window(now_s)
        received = sum(each.received_count for each in seconds)
        lost = max(0, sum(each.lost_count for each in seconds))
        return LinkStatistics(
            state=self.state,
            rate_hz=self._rate_hz(now_s),
            loss=lost / (received + lost) if received else 0.0,
            round_trip_s=self.timesync.round_trip_s,
            corrupt_count=corrupt_count,
            unsigned_count=unsigned_count,
            reboots_count=self.reboots_count,
            lost_count=self.lost_count,
        )

    def loss(self, now_s: float) -> float:
        """Returns the part of the autopilot's messages that did not arrive lately (0 to 1)."""
        return self.statistics(now_s).loss

    def _in_window(self, now_s: float) -> list[_Second]:
        return [each for each in list(self._seconds) if now_s - each.since_s <= WINDOW_S]

    def _rate_hz(self, now_s: float) -> float:
        seconds = self._in_window(now_s)
        span_s = max(1.0, now_s - seconds[0].since_s) if seconds else 1.0
        return sum(each.received_count for each in seconds) / span_s

    def _change(self, state: LinkState, silence_s: float) -> None:
        old, self.state = self.state, state
        level = {LinkState.LOST: logging.WARNING, LinkState.CONNECTED: logging.INFO}.get(state, logging.DEBUG)
        if old is LinkState.STALE and state is LinkState.CONNECTED:
            level = logging.DEBUG  # a short interruption
        fields = {"silence_s": round(silence_s, 2)} if silence_s else {}
        logs.event(_log, level, "link_changed", old=old.value, new=state.value, url=self._url, **fields)
