"""Holding a place for some time, as a part of a path."""

from __future__ import annotations

from collections.abc import Iterable

from typing_extensions import override

from ual.types import Limits
from ual_daemon.trajectory.motion import Motion, Trajectory


class Stay(Trajectory):
    """Rests at a place for some time."""

    def __init__(self, motion: Motion, duration_s: float, limits: Limits) -> None:
        """`motion` is at rest."""
        self.limits = limits
        self.duration_s = duration_s
        self.length_m = 0.0
        self.holds_s = {0.0: duration_s}
        self._motion = motion

    @override
    def at(self, time_s: float) -> Motion:
        return self._motion

    @override
    def bends_s(self) -> Iterable[tuple[float, float]]:
        return ()
