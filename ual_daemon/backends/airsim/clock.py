"""The simulator's time as the clock of the backend."""

from __future__ import annotations

import threading
import time

from typing_extensions import override

from ual_daemon.backends.base import Clock

SILENCE_S = 0.25
"""After so long without an answer the wall's clock goes on: otherwise nothing would ever be too old."""
_LONGEST_STEP_S = 10.0


class SimulatorClock(Clock):
    """Advances by what the simulator's time advances: not at all while it is paused, faster in a fast simulation.

    While the simulator does not answer, it advances with the wall's clock. It never goes back.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._now_s = 0.0
        self._heard_wall_s = time.monotonic()
        self._simulated_s: float | None = None

    @override
    def now_s(self) -> float:
        with self._lock:
            return self._now_s + self._silence_s()

    def advance(self, simulated_s: float) -> float:
        """Takes the time of an answer. Returns the present time."""
        with self._lock:
            now_s = self._now_s + self._silence_s()
            step_s = 0.0 if self._simulated_s is None else simulated_s - self._simulated_s
            if 0.0 <= step_s <= _LONGEST_STEP_S:  # else the simulator was started anew
                now_s = max(now_s, self._now_s + step_s)
            self._simulated_s, self._now_s, self._heard_wall_s = simulated_s, now_s, time.monotonic()
            return now_s

    def _silence_s(self) -> float:
        return max(0.0, time.monotonic() - self._heard_wall_s - SILENCE_S)
