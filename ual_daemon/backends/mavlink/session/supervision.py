"""How well the link to the autopilot is: its state, and numbers. Pure logic: times are handed in, nothing is sent."""

from __future__ import annotations

import logging
import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

from ual_daemon import logs

_log = logging.getLogger(__name__)

STALE_S = 0.5
"""Silent for so long, the link is not what it was: two heartbeats of other streams have failed at least."""
WINDOW_S = 10.0
"""Rate and loss are those of the last so many seconds."""
REBOOT_S = 1.0
"""A time since boot that falls back by more than this is a new boot; one that falls back by less came late."""
TIMESYNC_S = 1.0
_ANSWER_LIMIT_S = 5.0
"""A later answer to a TIMESYNC is no measurement."""
_PAUSE_S = 0.1
"""Within less than this nobody sends so much that his numbers come round."""
_SEQUENCES = 256
_LATE_COUNT = 128
"""A number that is at most this much behind the newest is a late or doubled frame; more is a gap the long way round. A
jitter of 0.2 s reorders some 100 of PX4's messages."""


class LinkState(Enum):
    """CONNECTING: no autopilot was heard yet. STALE: silent for a moment. LOST: for so long that nothing is known."""

    CONNECTING = "connecting"
    CONNECTED = "connected"
    STALE = "stale"
    LOST = "lost"


@dataclass(frozen=True, slots=True)
class LinkStatistics:
    """Numbers of the link, of the last `WINDOW_S` where they are not counts.

    `rate_hz` is messages of the autopilot per second, `loss` the part of its messages that did not come (0 to 1), and
    `round_trip_s` the newest measured by TIMESYNC (None: not measured). Counts are since the beginning: pieces that
    were no frames (`corrupt_count`), frames dropped for their signature (`unsigned_count`), reboots of the autopilot,
    and how often the link was lost.
    """

    state: LinkState = LinkState.CONNECTING
    rate_hz: float = 0.0
    loss: float = 0.0
    round_trip_s: float | None = None
    corrupt_count: int = 0
    unsigned_count: int = 0
    reboots_count: int = 0
    lost_count: int = 0


class SequenceGaps:
    """Counts what one sender's running numbers say was lost; frames that come late or twice are no loss."""

    def __init__(self) -> None:
        self._newest: int | None = None
        self._missing: set[int] = set()

    def lost(self, sequence: int) -> int:
        """How many more frames are known to be lost, by the number of one that came; -1 when a missing one came."""
        if self._newest is None:
            self._newest = sequence
            return 0
        step = (sequence - self._newest) % _SEQUENCES
        if step == 1 and not self._missing:  # nearly always: nothing was lost
            self._newest = sequence
            return 0
        if step == 0 or step >= _SEQUENCES - _LATE_COUNT:
            if sequence not in self._missing:
                return 0  # twice
            self._missing.remove(sequence)
            return -1
        self._newest = sequence
        # A number that comes round again is missing anew or here; those too old to still come are forgotten with it.
        self._missing = {each for each in self._missing if 0 < (sequence - each) % _SEQUENCES <= _LATE_COUNT}
        gap = [(sequence - back) % _SEQUENCES for back in range(1, step)]
        self._missing.update(gap[:_LATE_COUNT])
        return len(gap)


class RoundTrip:
    """Measures by TIMESYNC how long a message and its answer take. Times in a request are ours, in nanoseconds."""

    def __init__(self) -> None:
        self.newest_s: float | None = None
        self._next_s = float("-inf")
        self._asked_ns: dict[int, None] = {}

    def request_ns(self, now_s: float) -> int | None:
        """The time to ask with, when it is time to ask."""
        if now_s < self._next_s:
            return None
        self._next_s = now_s + TIMESYNC_S
        asked_ns = max(1, round(now_s * 1e9))
        oldest_ns = asked_ns - round(_ANSWER_LIMIT_S * 1e9)
        self._asked_ns = {**{each: None for each in self._asked_ns if each >= oldest_ns}, asked_ns: None}
        return asked_ns

    def answered(self, asked_ns: int, now_s: float) -> None:
        """Takes an answer; one to another's request, or to one answered already, is none."""
        if asked_ns in self._asked_ns:
            del self._asked_ns[asked_ns]
            self.newest_s = max(0.0, now_s - asked_ns / 1e9)


@dataclass(slots=True)
class _Second:
    """What was counted in about a second."""

    since_s: float
    received_count: int = 0
    lost_count: int = 0


class Supervision:
    """Watches the link to one autopilot and logs when its state changes.

    Not thread-safe: belongs to the thread that receives; `state` and `statistics` may be read by others. Lost is a
    link after a silence of `lost_s`.
    """

    def __init__(self, url: str, lost_s: float) -> None:
        self.lost_s = lost_s
        self.state = LinkState.CONNECTING
        self.heard_s: float | None = None
        self.round_trip = RoundTrip()
        self.unsigned_count = 0
        self.reboots_count = 0
        self.lost_count = 0
        self._url = url
        self._gaps = SequenceGaps()
        self._seconds: deque[_Second] = deque()
        self.boot_s = -math.inf
        """The time since boot that was told last."""
        self._boot_told_s = math.inf

    def heard(self, sequence: int, now_s: float) -> None:
        """A frame of the autopilot came."""
        before_s = now_s if self.heard_s is None else self.heard_s
        silence_s = now_s - before_s
        if silence_s > _PAUSE_S and silence_s * self._rate_hz(before_s) > _LATE_COUNT:
            self._gaps = SequenceGaps()  # the numbers may have come round: they do not tell what was lost
        self.heard_s = now_s
        if not self._seconds or now_s - self._seconds[-1].since_s >= 1.0:
            self._seconds.append(_Second(now_s))
            while now_s - self._seconds[0].since_s > WINDOW_S:
                self._seconds.popleft()
        newest = self._seconds[-1]
        newest.received_count += 1
        newest.lost_count += self._gaps.lost(sequence)
        if self.state is not LinkState.CONNECTED:
            self._change(LinkState.CONNECTED, silence_s)

    def booted(self, boot_s: float, now_s: float) -> bool:
        """Takes the autopilot's time since boot, as some message has it; true when it has booted anew."""
        # After a silence it may run for longer than it had run before that, and yet not for as long as the silence was.
        is_new = boot_s < self.boot_s - REBOOT_S or boot_s < now_s - self._boot_told_s - REBOOT_S
        self.boot_s, self._boot_told_s = boot_s, now_s
        if is_new:
            self.reboots_count += 1
            self._gaps = SequenceGaps()
            logs.event(_log, logging.WARNING, "autopilot_rebooted", url=self._url, reboots_count=self.reboots_count)
        return is_new

    def tick(self, now_s: float) -> None:
        """Notices silence; to be called often."""
        if self.heard_s is None:
            return
        silence_s = now_s - self.heard_s
        if silence_s > self.lost_s:
            if self.state is not LinkState.LOST:
                self.lost_count += 1
                self._change(LinkState.LOST, silence_s)
        elif silence_s > STALE_S and self.state is LinkState.CONNECTED:
            self._change(LinkState.STALE, silence_s)

    def statistics(self, now_s: float, corrupt_count: int = 0) -> LinkStatistics:
        """The numbers as of now."""
        seconds = self._in_window(now_s)
        received = sum(each.received_count for each in seconds)
        lost = max(0, sum(each.lost_count for each in seconds))
        return LinkStatistics(
            state=self.state,
            rate_hz=self._rate_hz(now_s),
            loss=lost / (received + lost) if received else 0.0,
            round_trip_s=self.round_trip.newest_s,
            corrupt_count=corrupt_count,
            unsigned_count=self.unsigned_count,
            reboots_count=self.reboots_count,
            lost_count=self.lost_count,
        )

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
            level = logging.DEBUG  # a hiccup
        fields = {"silence_s": round(silence_s, 2)} if silence_s else {}
        logs.event(_log, level, "link_changed", old=old.value, new=state.value, url=self._url, **fields)
