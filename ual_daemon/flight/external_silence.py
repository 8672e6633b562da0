"""How long no pose has come from outside, or why those that come are dropped: the reason of a lost position."""

from __future__ import annotations

import math

_NOTICED_S = 0.5
"""Sources send 20 poses a second, or more."""
_RELIED_ON_S = 20.0
"""An estimate that is good for so long without poses from outside does not rest on them."""


class ExternalSilence:
    """The time of the last pose from outside. Any thread may call."""

    def __init__(self) -> None:
        self._last_s: float | None = None
        self._dropped = (-math.inf, "")
        """When the newest pose was dropped or refused, and why."""
        self._is_cause = False
        """Whether the position was lost soon after the last one: where it was later, they are not the cause."""

    def heard(self, now_s: float) -> None:
        """Notes that a pose was given to the autopilot."""
        self._last_s, self._is_cause = now_s, False

    def is_good(self, now_s: float) -> None:
        """Notes that the autopilot has a good position."""
        if self._last_s is not None and now_s - self._last_s > _RELIED_ON_S:
            self._last_s = None

    def dropped(self, now_s: float, why: str) -> None:
        """Notes that a pose came, but was dropped or refused."""
        self._dropped = (now_s, why)

    def passed_s(self, now_s: float) -> float:
        """Returns how long ago that was; infinity if it never was."""
        last_s = self._last_s
        return math.inf if last_s is None else now_s - last_s

    def text(self, now_s: float) -> str:
        """Returns what the reason of UNINITIALIZED adds; empty while poses come, and where they are not the cause."""
        passed_s, (dropped_s, why) = self.passed_s(now_s), self._dropped
        if passed_s <= _NOTICED_S:
            return ""
        if now_s - dropped_s <= _NOTICED_S:
            return f"; the poses from outside are dropped: {why}"
        self._is_cause = passed_s <= _RELIED_ON_S or (self._is_cause and passed_s < math.inf)
        return f"; no poses from outside for {passed_s:.1f} s" if self._is_cause else ""
