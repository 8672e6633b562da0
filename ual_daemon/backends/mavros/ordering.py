"""The stamps of messages: which is the newest, and how late one came."""

from __future__ import annotations

from collections import defaultdict

from ual_daemon.backends.autopilots.clock_offset import ClockOffset

CLOCK_STEP_S = 10.0
"""A stamp that is older by more than this is of a clock that was set, and not of a late message."""
NEW_CLOCK_COUNT = 4
"""So many messages of a topic in a row that are too old, with stamps that rise, are of a clock that was set, too."""
_LATENESS_WINDOW_S = 5.0


class Ordering:
    """Judges the stamps of all topics. They are of the clock of the computer that runs MAVROS, whatever that says."""

    def __init__(self) -> None:
        self._newest: dict[str, float] = {}
        self._older: dict[str, list[float]] = {}
        """The stamps of the messages in a row that were too old."""
        self._fastest: defaultdict[str, ClockOffset] = defaultdict(_new_offset)
        """By topic: some stamps are of the autopilot's clock, as far as MAVROS knows it."""

    def accepts(self, topic: str, stamp_s: float) -> bool:
        """Returns whether a message is not older than the one before of its topic. One without a stamp always is."""
        newest_s = self._newest.get(topic, stamp_s)
        if stamp_s and stamp_s < newest_s:
            if stamp_s > newest_s - CLOCK_STEP_S and not self._is_of_new_clock(topic, stamp_s):
                return False
            self._fastest.clear()  # how late a message comes is measured anew
        self._older.pop(topic, None)
        self._newest[topic] = stamp_s
        return True

    def _is_of_new_clock(self, topic: str, stamp_s: float) -> bool:
        older = self._older.setdefault(topic, [])
        if older and stamp_s <= older[-1]:
            older.clear()
        older.append(stamp_s)
        return len(older) >= NEW_CLOCK_COUNT

    def sent_s(self, stamp_s: float, now_s: float, topic: str = "") -> float:
        """Returns when a message would have come, had it been as fast as the fastest one of its topic of late."""
        return self._fastest[topic].to_utc(stamp_s, now_s, now_s) if stamp_s else now_s


def _new_offset() -> ClockOffset:
    return ClockOffset(_LATENESS_WINDOW_S)
