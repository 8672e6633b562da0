"""Notices that a climb or a descent that the autopilot flies by itself makes no way."""

from __future__ import annotations

STUCK_S = 10.0
"""So long an autopilot makes no way before people are told: it takes up to 6 s to notice the ground, or to lift off."""
_WAY_M = 0.3
"""An estimate of height wanders by less within this time."""


class WayWatch:
    """Watches one climb or descent. `is_up` says which."""

    def __init__(self, z_m: float, now_s: float, *, is_up: bool) -> None:
        self._sign = 1.0 if is_up else -1.0
        self._furthest_m, self._since_s = z_m, now_s

    def stuck_s(self, z_m: float, now_s: float) -> float:
        """Returns for how long it has made no way."""
        if (z_m - self._furthest_m) * self._sign > _WAY_M:
            self._furthest_m, self._since_s = z_m, now_s
        return now_s - self._since_s

    def moved(self, z_m: float) -> None:
        """Takes note that the autopilot's estimate has jumped by so much."""
        self._furthest_m += z_m
