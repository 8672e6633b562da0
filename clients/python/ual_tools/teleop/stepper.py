"""Makes steps of the pose mode out of a device that gives deflections (a joystick)."""

from __future__ import annotations

import math
from dataclasses import astuple

from ual_tools.teleop.sticks import CENTRED, Sticks

BEGIN_DEFLECTION = 0.5
"""The deflection that makes a step."""
END_DEFLECTION = 0.25
"""Below this the axis is released. Lower than `BEGIN_DEFLECTION`, so that a trembling hand makes one step."""
REPEAT_S = 0.5
"""A deflection that is held makes another step each time this passes."""


class Stepper:
    """Steps of one device. The time is given, in seconds from anywhere."""

    def __init__(self) -> None:
        self._held: list[tuple[float, float]] = [(0.0, -math.inf)] * 4

    def steps(self, sticks: Sticks, now_s: float) -> Sticks:
        """Returns -1, 0 or 1 for each axis: where a step is due."""
        if sticks.is_centred():
            self._held = [(0.0, -math.inf)] * 4
            return CENTRED
        return Sticks(*[self._step(axis, value, now_s) for axis, value in enumerate(astuple(sticks))])

    def _step(self, axis: int, value: float, now_s: float) -> float:
        held, due_s = self._held[axis]
        if abs(value) < (END_DEFLECTION if held * value > 0.0 else BEGIN_DEFLECTION):
            self._held[axis] = (0.0, -math.inf)
            return 0.0
        sign = math.copysign(1.0, value)
        if sign == held and now_s < due_s:
            return 0.0
        self._held[axis] = (sign, now_s + REPEAT_S)
        return sign
