"""Makes an even deflection out of a key: terminals send no release, only the key repeatedly while it is held.

The first repeat comes 225 to 660 ms after the press (the defaults of macOS, Linux and X11), the others 25 to 92 ms
apart. So a press alone cannot tell a tap from a key that is held. It deflects the axis by `TAP_DEFLECTION` and keeps
that until the first repeat must have come. The repeat then tells that the key is held, and the axis goes on to 1. A
held key thus never dips, and a tap moves little. Released, the axis falls from 1 to 0 within `HELD_KEY_S` + `FALL_S`.
"""

from __future__ import annotations

import math

TAP_DEFLECTION = 0.3
TAP_S = 0.7
"""Longer than the first repeat takes."""
HELD_KEY_S = 0.15
"""Longer than the time between two repeats."""
RISE_S = 0.4
"""From 0 to 1."""
FALL_S = 0.15
"""From 1 to 0."""


class SmoothedAxis:
    """The deflection of one axis, -1 to 1. The time is given, in seconds from anywhere, and never goes back."""

    def __init__(self) -> None:
        self._value = 0.0
        self._target = 0.0
        self._until_s = -math.inf
        """Time at which the key counts as released."""
        self._now_s = -math.inf

    def press(self, direction: float, now_s: float) -> None:
        """Takes a press or a repeat of a key: 1 or -1. The key of the other direction begins at 0, at once."""
        self._advance(now_s)
        if self._value * direction < 0.0:
            self._value = 0.0
        is_repeat = self._target * direction > 0.0
        self._target = direction if is_repeat else direction * TAP_DEFLECTION
        self._until_s = now_s + (HELD_KEY_S if is_repeat else TAP_S)

    def value(self, now_s: float) -> float:
        """Returns the deflection."""
        self._advance(now_s)
        return self._value

    def _advance(self, now_s: float) -> None:
        if now_s > self._until_s:
            self._slew(self._target, self._until_s - self._now_s)
            self._slew(0.0, now_s - max(self._until_s, self._now_s))
            self._target = 0.0
        else:
            self._slew(self._target, now_s - self._now_s)
        self._now_s = now_s

    def _slew(self, target: float, duration_s: float) -> None:
        if self._value == target or duration_s <= 0.0:
            return
        step = duration_s / (RISE_S if abs(target) > abs(self._value) else FALL_S)
        self._value += math.copysign(min(step, abs(target - self._value)), target - self._value)
