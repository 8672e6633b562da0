"""Notices that a climb or a descent that the autopilot flies by itself makes no way."""

from __future__ import annotations

from ual_daemon.flight.tasks import VehicleTask

STUCK_S = 10.0
"""So long an autopilot makes no way before people are told: it takes up to 6 s to notice the ground, or to lift off."""
_WAY_M = 0.3
"""An estimate of height wanders by less within this time."""


class WayWatch:
    """Watches one climb (`is_up`) or descent, and says in its task's words that it is stuck, and what can be done."""

    def __init__(self, task: VehicleTask, advice: str, *, is_up: bool) -> None:
        self._task = task
        self._advice = advice
        self._sign, self._verb = (1.0, "climbed") if is_up else (-1.0, "descended")
        self._furthest_m: float | None = None
        self._since_s = 0.0

    def observe(self, z_m: float, now_s: float, *, is_there: bool = False) -> None:
        """Takes a height. `is_there`: there is no way left, so it is not stuck."""
        if self._furthest_m is None or (z_m - self._furthest_m) * self._sign > _WAY_M:
            self._furthest_m, self._since_s = z_m, now_s
        stuck_s = now_s - self._since_s
        is_stuck = stuck_s > STUCK_S and not is_there
        self._task.note = f"it has not {self._verb} for {stuck_s:.0f} s: {self._advice}" if is_stuck else ""

    def moved(self, z_m: float) -> None:
        """Takes note that the autopilot's estimate has jumped by so much."""
        if self._furthest_m is not None:
            self._furthest_m += z_m
