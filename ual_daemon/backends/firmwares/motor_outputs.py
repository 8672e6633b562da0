"""Whether an autopilot's motors turn, by what it puts out to them.

An autopilot may keep the motors stopped in the air and say so once only, by a text (ArduPilot's emergency stop). A
daemon that starts later knows it by the outputs alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

REST_PULSE_US = 10
"""So little above the least pulse a motor stands: it idles 50 us above that at least, and 100 us by default."""
MOTORS_REST_S = 0.2
"""Seconds for which all motors must stand: two reports in turn, as one may be of the moment of a disarming."""
_REPORT_AGE_LIMIT_S = 2.0
"""A report that is older says nothing any more."""


class MotorChannels(NamedTuple):
    """The outputs of the motors, counted from 0, and the pulse in microseconds at which they stand."""

    channels: frozenset[int]
    least_us: float


class MotorOutputs:
    """Outputs of one autopilot to its motors. Belongs to the thread that receives."""

    def __init__(self) -> None:
        self._rests_since_s = math.inf
        """Since when all motors stand; infinity while one turns."""
        self._reported_s = -math.inf

    def on_pulses(self, pulses_us: Sequence[int], motors: MotorChannels | None, now_s: float) -> None:
        """Takes the pulses of the outputs, the first one first. 0: nothing is put out. None: no motor is known."""
        count = len(pulses_us)
        found_us = [] if motors is None else [pulses_us[each] for each in motors.channels if each < count]
        if motors is None or not found_us or not min(found_us):
            return
        if now_s - self._reported_s > _REPORT_AGE_LIMIT_S:
            self._rests_since_s = math.inf
        self._reported_s = now_s
        do_rest = max(found_us) <= motors.least_us + REST_PULSE_US
        self._rests_since_s = min(self._rests_since_s, now_s) if do_rest else math.inf

    def forget(self) -> None:
        """Forgets what was reported: from now on it says nothing."""
        self._rests_since_s, self._reported_s = math.inf, -math.inf

    def stand(self, now_s: float) -> bool | None:
        """Returns whether all motors stand; None where that is not known now."""
        if now_s - self._reported_s > _REPORT_AGE_LIMIT_S:
            return None
        if self._rests_since_s == math.inf:
            return False
        return True if self._reported_s - self._rests_since_s >= MOTORS_REST_S else None

    def turn_since(self, time_s: float) -> bool:
        """Returns whether a motor was commanded to turn at the newest report, which came after a time."""
        return self._reported_s > time_s and self._rests_since_s == math.inf
