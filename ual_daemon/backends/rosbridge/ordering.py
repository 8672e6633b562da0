"""The stamps of messages: which is the newest, and how late one came."""

from __future__ import annotations

from ual_daemon.backends.engine.clock_offset import ClockOffset

CLOCK_STEP_S = 10.0
"""A stamp that is older by more than this is of a clock that was set, and not of a late message."""
NEW_CLOCK_COUNT = 4
"""Consecutive messages of a topic that are too old, with stamps that rise, after which the clock counts as set."""
_LATENESS_WINDOW_S = 5.0


class Ordering:
    """Judges the stamps of all topics. They are of the clock of the computer that runs MAVROS, whatever that says."""

    def __init__(self) -> None:
        self._newest: dict[str, float] = {}
        self._older: dict[str, list[float]] = {}
        """The stamps of the messages in a row that were too old."""
        self._fastest = ClockOffset(_LATENESS_WINDOW_S)
        self._fastest_state = ClockOffset()

    def accepts(self, topic: str, stamp_s: float) -> bool:
        """Returns whether a message is not older than the one before of its topic. One without a stamp always is."""
        newest_s = self._newest.get(topic, stamp_s)
        if stamp_s and stamp_s < newest_s:
            if stamp_s > newest_s - CLOCK_STEP_S and not self._is_of_new_clock(topic, stamp_s):
                return False
            self._fastest = ClockOffset(_LATENESS_WINDOW_S)  # how late a message comes is measured again
            self._fastest_state = ClockOffset()
        self._older.pop(topic, None)
        self._newest[topic] = stamp_s
        return True

    def _is_of_new_clock(self, topic: str, stamp_s: float) -> bool:
        older = self._older.setdefault(topic, [])
        if older and stamp_s <= older[-1]:
            older.clear()
        older.append(stamp_s)
        return len(older) >= NEW_CLOCK_COUNT

    def sent_s(self, stamp_s: float, now_s: float) -> float:
        """Returns when a message would have come, had it been as fast as the fastest one of late."""
        return self._fastest.to_utc(stamp_s, now_s, now_s) if stamp_s else now_s

    def state_time_s(self, stamp_s: float, now_s: float) -> float:
        """Returns the same of a message of the state. Its stamps are of another clock than those of poses, and of a
        simulation that may be slow: only the last second counts.
        """
        return self._fastest_state.to_utc(stamp_s, now_s, now_s) if stamp_s else now_s
