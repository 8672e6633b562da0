"""The distance from the base station, as the autopilot tells it of its receivers."""

from __future__ import annotations

import math

REPORT_AGE_LIMIT_S = 5.0


class Baseline:
    """The newest distance. One that is older than `REPORT_AGE_LIMIT_S` is not reported."""

    def __init__(self) -> None:
        self._reported: tuple[float, float] | None = None
        """In metres, and when it came."""

    @property
    def has_come(self) -> bool:
        """Whether any has come."""
        return self._reported is not None

    def on_components(self, a_mm: float, b_mm: float, c_mm: float, now_s: float) -> None:
        """Takes its three components, of whatever axes. Zero is none."""
        baseline_m = math.hypot(a_mm, b_mm, c_mm) / 1000.0
        if baseline_m > 0.0:
            self._reported = (baseline_m, now_s)

    def fresh_m(self, now_s: float) -> float | None:
        """Returns the distance in metres; None where none has come of late."""
        if self._reported is None or now_s - self._reported[1] > REPORT_AGE_LIMIT_S:
            return None
        return self._reported[0]
