"""How long no pose has come from outside, or why those that come are dropped: the reason of a lost position."""

from __future__ import annotations

import math

_NOTICED_S = 0.5
"""Sources send 20 poses a second, or more."""


class ExternalSilence:
    """The time of the last pose from outside. Any thread may call."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._dropped = (-math.inf, "")
        """When the newest pose was dropped or refused, and why."""

    def heard(self, now_s: float) -> None:
        """Notes that a pose was given to the autopilot."""
        self._last_s = now_s

    def dropped(self, now_s: float, why: str) -> None:
        """Notes that a pose came, but was dropped or refused."""
        self._dropped = (now_s, why)

    def passed_s(self, now_s: float) -> float:
        """Returns how long ago that was; infinity if it never was."""
        return math.inf if self._last_s is None else now_s - self._last_s

    def text(self, now_s: float) -> str:
        """Returns what the reason of UNINITIALIZED adds; empty while poses come, and if none ever came."""
        passed_s, (dropped_s, why) = self.passed_s(now_s), self._dropped
        if passed_s <= _NOTICED_S:
            return ""
        if now_s - dropped_s <= _NOTICED_S:
            return f"; the poses from outside are dropped: {why}"
        return f"; no poses from outside for {passed_s:.1f} s" if passed_s < math.inf else ""
