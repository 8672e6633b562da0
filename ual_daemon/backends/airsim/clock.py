"""The simulator's time as the clock of the backend."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from typing_extensions import override

from ual_daemon.backends.base import Clock
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S

_LONGEST_CLOCK_STEP_S = 10.0


class SimulatorClock(Clock):
    """Advances by what the simulator's time advances: not at all while it is paused, faster in a fast simulation.

    Once the simulator has not answered for `BLIND_SILENCE_S` by the wall's clock, that clock counts from the last
    answer on: otherwise nothing would ever be too old. It never goes back.
    """

    def __init__(self, wall_s: Callable[[], float] = time.monotonic) -> None:
        self._wall_s = wall_s
        self._lock = threading.Lock()
        self._now_s = 0.0
        self._answered_wall_s = wall_s()
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
            if 0.0 <= step_s <= _LONGEST_CLOCK_STEP_S:  # else the simulator was started again
                now_s = max(now_s, self._now_s + step_s)
            self._simulated_s, self._now_s, self._answered_wall_s = simulated_s, now_s, self._wall_s()
            return now_s

    def _silence_s(self) -> float:
        silence_s = self._wall_s() - self._answered_wall_s
        return silence_s if silence_s > BLIND_SILENCE_S else 0.0
