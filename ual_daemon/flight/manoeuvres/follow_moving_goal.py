"""A go-to whose goal moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

from typing_extensions import override

from ual.errors import UalError, UalTimeoutError
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.arrival import Dwell
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step, failed, no_progress, why_not_ours
from ual_daemon.flight.manoeuvres.progress_watch import PROGRESS_M, Headway
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.tracker.references import Reference, measured_motion
from ual_daemon.trajectory import Motion

_GOAL_TIMEOUT_S = 60.0
_TIMEOUT_FACTOR = 10.0


class FollowMovingGoal(Manoeuvre):
    """A go-to whose goal moves. It ends when the UAV moves along with the goal, and the UAV goes on doing so."""

    is_goal_moving = True
    why_not_pausable = "its goal moves, so that there is no way to hold on; abort it, and command it again"

    def __init__(
        self,
        name: str,
        task: VehicleTask,
        moving_goal: MovingGoal,
        limits: Callable[[], Limits],
        tolerance: ToleranceSettings,
    ) -> None:
        """`limits` returns those that `moving_goal` keeps now: the time limit follows from them."""
        super().__init__(name, task)
        self._task = task
        self._moving_goal = moving_goal
        self._tolerance = tolerance
        self._started_s: float | None = None
        self._longest_s = _GOAL_TIMEOUT_S
        self._initial_distance_m = 0.0
        self._dwell = Dwell(tolerance.dwell_s)
        self._limits = limits
        self._headway = Headway()
        self._moved_from = Vector3(math.inf)
        self._said_before = ""

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_not_ours(snapshot, estimate, self.name)
        if lost is not None:
            return failed(lost)
        try:
            goal = self._moving_goal.goal(snapshot.time_s)
        except UalError as error:
            return failed(error)
        measured = measured_motion(snapshot)
        left_m = (goal.position - measured.position).norm()
        if self._started_s is None:
            self._start(snapshot.time_s, left_m)
            self._said_before = snapshot.condition.status_text
        setpoint = self._moving_goal.setpoint(snapshot)
        if self._moving_goal.stop_reason is not None:
            return failed(self._moving_goal.stop_reason)
        self._task.report(partial(_progress, left_m, self._initial_distance_m))
        if self._is_there(goal, measured, snapshot.time_s):
            return Step(setpoint, has_ended=True, next_reference=self._moving_goal)
        if self._is_too_late(snapshot.time_s):
            return failed(self._timeout(goal, left_m, estimate))
        stuck_s = self._stuck_s(goal, measured, left_m, snapshot.time_s)
        left = f"{left_m:.2f} m off its goal, which moves at {goal.velocity.norm():.2f} m/s"
        return no_progress(self.name, stuck_s, left, snapshot, self._said_before) if stuck_s else Step(setpoint)

    @property
    def _slowest_m_s(self) -> float:
        limits = self._limits()
        return min(limits.horizontal_speed_m_s, limits.climb_speed_m_s, limits.descent_speed_m_s)

    def _stuck_s(self, goal: Motion, measured: Motion, left_m: float, now_s: float) -> float:
        """Returns for how long it has made no way: it has moved nowhere, and its goal has come no nearer."""
        if not self._headway.is_due(now_s):
            return 0.0
        if (measured.position - self._moved_from).norm() > PROGRESS_M:
            self._moved_from = measured.position
            self._headway.restart()
        error_rad = abs(wrap_angle(measured.yaw_rad - goal.yaw_rad)) if self._moving_goal.has_met else 0.0
        turn_rad = max(0.0, error_rad - self._tolerance.heading_rad)
        slowest_m_s = self._slowest_m_s
        return self._headway.stuck_s(
            now_s, left_m, turn_rad, lambda passed_s: max(0.0, left_m - slowest_m_s * passed_s)
        )

    def _start(self, now_s: float, left_m: float) -> None:
        self._started_s, self._initial_distance_m = now_s, left_m
        self._longest_s += _TIMEOUT_FACTOR * left_m / self._slowest_m_s

    def _is_too_late(self, now_s: float) -> bool:
        return self._started_s is not None and now_s - self._started_s > self._longest_s

    def _timeout(self, goal: Motion, left_m: float, estimate: Estimate) -> UalTimeoutError:
        return UalTimeoutError(
            f"{self.name}: has not caught up with its goal after {self._longest_s:.0f} s: {left_m:.2f} m off, "
            f"and the goal moves at {goal.velocity.norm():.2f} m/s",
            {"state": estimate.state.name},
        )

    def _is_there(self, goal: Motion, measured: Motion, now_s: float) -> bool:
        """Returns whether the UAV has been at the goal, and slow relative to it, for the dwell time."""
        limit = self._tolerance
        is_there = (
            self._moving_goal.has_met
            and (measured.position - goal.position).norm() <= limit.position_m
            and abs(wrap_angle(measured.yaw_rad - goal.yaw_rad)) <= limit.heading_rad
            and (measured.velocity - goal.velocity).norm() <= limit.speed_m_s
        )
        return self._dwell.has_held(now_s, holds=is_there)

    @override
    def current_reference(self) -> Reference | None:
        return self._moving_goal

    @override
    def path_points(self, now_s: float) -> Sequence[Vector3]:
        return self._moving_goal.path_points(now_s)


def _progress(left_m: float, initial_distance_m: float) -> Progress:
    share = max(0.0, 1.0 - left_m / initial_distance_m) if initial_distance_m > 0.0 else None
    return Progress(share, left_m)
