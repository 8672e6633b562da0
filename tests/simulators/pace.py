"""The pace of a simulated autopilot that is stepped instead of being waited for."""

from __future__ import annotations

import time

_LATE_S = 0.05


class Pace:
    """Keeps steps of `step_s` at most `speed` times as fast as real time. What a busy computer missed is lost."""

    def __init__(self, step_s: float, speed: float) -> None:
        self._period_s = step_s / speed
        self._due_s = time.monotonic()

    def wait(self) -> None:
        """Waits until the next step is due."""
        self._due_s += self._period_s
        wait_s = self._due_s - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
        elif wait_s < -_LATE_S:
            self._due_s -= wait_s
