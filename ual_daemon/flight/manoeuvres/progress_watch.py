"""Notices that what is flown makes no way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from ual_daemon.flight.tasks import VehicleTask

STUCK_TIME_S = 8.0
"""Seconds without progress after which a motion is stuck: a task that is stuck ends within 10 s. An autopilot takes up
to 6 s to notice the ground, or to lift off.
"""
PROGRESS_M = 0.3
"""An estimate of a UAV that stands still wanders by less within this time."""
_TURN_RAD = 0.1
_PLANNED_PROGRESS_M = 1.0
"""A motion that should have made less way than this is not assessed: its estimate may wander by 0.7 m. So a slow one is
watched for longer."""
_CHECK_PERIOD_S = 0.2
"""Between two looks. Each costs some dozen calls, as much as the rest of an update."""
_UPDATE_GAP_S = 1.0
"""Seconds without an update after which the distance made meanwhile is unknown."""

PlannedWay: TypeAlias = Callable[[float], float]
"""Returns the distance that is left, in metres, if all goes as planned for the given seconds."""


@dataclass(slots=True)
class _Mark:
    """Since when no way was made, the way that was left then, and the most that was left since."""

    since_s: float
    began_m: float
    planned_m: PlannedWay
    way_m: float
    turn_rad: float


class Headway:
    """Watches one motion by references. Its holds are part of its plan."""

    def __init__(self) -> None:
        self._mark: _Mark | None = None
        self._looked_s = -math.inf

    def restart(self) -> None:
        """Begins again: it was paused, or planned again, or has made way that does not show in what is left."""
        self._mark = None

    def is_due(self, now_s: float) -> bool:
        """Returns whether `stuck_s` is to be called at this update."""
        return now_s - self._looked_s >= _CHECK_PERIOD_S

    def stuck_s(self, now_s: float, way_m: float, turn_rad: float, planned_m: PlannedWay) -> float:
        """Returns for how long it has been stuck; 0 while it is not. To be called when that `is_due`.

        Args:
            now_s: The backend's clock.
            way_m: The way that is left.
            turn_rad: How far the heading is off, beyond the tolerance; 0 while it need not be there yet.
            planned_m: What will be left of the way from now on.

        """
        has_paused, self._looked_s = now_s - self._looked_s > _UPDATE_GAP_S, now_s
        mark = self._mark
        if mark is None or has_paused or mark.way_m - way_m > PROGRESS_M or mark.turn_rad - turn_rad > _TURN_RAD:
            self._mark = _Mark(now_s, way_m, planned_m, way_m, turn_rad)
            return 0.0
        mark.way_m, mark.turn_rad = max(mark.way_m, way_m), max(mark.turn_rad, turn_rad)
        passed_s = now_s - mark.since_s
        if passed_s <= STUCK_TIME_S:
            return 0.0
        is_due = mark.began_m - mark.planned_m(passed_s) > _PLANNED_PROGRESS_M or turn_rad > _TURN_RAD
        return passed_s if is_due else 0.0


class ProgressWatch:
    """Watches one climb or descent that an autopilot may fly by itself. A descent that is stuck is reported by its
    task.
    """

    def __init__(self, task: VehicleTask, advice: str, *, is_up: bool, slowest_m_s: float = math.inf) -> None:
        """`slowest_m_s` is the least speed that it is to have."""
        self._task = task
        self._advice = advice
        self._sign, self._verb = (1.0, "climbed") if is_up else (-1.0, "descended")
        self.expect(slowest_m_s)
        self._furthest_m: float | None = None
        self._since_s = 0.0
        self.text = ""
        """Human-readable report that it is stuck, and the remedy; empty while it is not."""

    def observe(self, z_m: float, now_s: float, *, is_there: bool = False) -> None:
        """Takes a height. `is_there`: there is no way left, so it is not stuck."""
        if self._furthest_m is None or (z_m - self._furthest_m) * self._sign > PROGRESS_M:
            self._furthest_m, self._since_s = z_m, now_s
        stuck_s = now_s - self._since_s
        is_stuck = stuck_s > self._patience_s and not is_there
        self.text = f"it has not {self._verb} for {stuck_s:.0f} s: {self._advice}" if is_stuck else ""
        self._task.note = self.text

    def expect(self, slowest_m_s: float) -> None:
        """Takes the least speed that it is to have now."""
        self._patience_s = max(STUCK_TIME_S, _PLANNED_PROGRESS_M / slowest_m_s)

    def moved(self, z_m: float) -> None:
        """Takes note that the autopilot's estimate has jumped by so much."""
        if self._furthest_m is not None:
            self._furthest_m += z_m
