"""A go-to whose goal moves."""

from __future__ import annotations

from ual.errors import UalError, UalTimeoutError
from ual.geometry import wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvre import Manoeuvre, Step, failed, why_not_ours
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.tracker.references import Reference, measured_motion
from ual_daemon.trajectory import Motion

_TIMEOUT_S = 60.0
_TIMEOUT_FACTOR = 10.0


class CatchUp(Manoeuvre):
    """A go-to whose goal moves: it ends when the UAV goes with the goal, and goes on doing so."""

    def __init__(
        self, name: str, task: VehicleTask, chase: MovingGoal, limits: Limits, tolerance: ToleranceSettings
    ) -> None:
        """`limits` are those that the chase keeps: they tell how long it may take."""
        super().__init__(name, task)
        self._task = task
        self._chase = chase
        self._limits = limits
        self._tolerance = tolerance
        self._started_s: float | None = None
        self._longest_s = _TIMEOUT_S
        self._begin_m = 0.0
        self._there_since_s: float | None = None

    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_not_ours(snapshot, estimate, self.name)
        if lost is not None:
            return failed(lost)
        try:
            goal = self._chase.goal(snapshot.time_s)
        except UalError as error:
            return failed(error)
        measured = measured_motion(snapshot)
        left_m = (goal.position - measured.position).norm()
        if self._started_s is None:
            self._started_s, self._begin_m = snapshot.time_s, left_m
            limits = self._limits
            slowest_m_s = min(limits.horizontal_speed_m_s, limits.climb_speed_m_s, limits.descent_speed_m_s)
            self._longest_s += _TIMEOUT_FACTOR * left_m / slowest_m_s
        setpoint = self._chase.setpoint(snapshot)
        if self._chase.stopped is not None:
            return failed(self._chase.stopped)
        begin_m = self._begin_m
        self._task.report(lambda: Progress(max(0.0, 1.0 - left_m / begin_m) if begin_m > 0.0 else None, left_m))
        if self._is_there(goal, measured, snapshot.time_s):
            return Step(setpoint, has_ended=True, then=self._chase)
        if snapshot.time_s - self._started_s > self._longest_s:
            return failed(
                UalTimeoutError(
                    f"{self.name}: has not caught up with its goal after {self._longest_s:.0f} s: {left_m:.2f} m off, "
                    f"which moves at {goal.velocity.norm():.2f} m/s",
                    {"state": estimate.state.name},
                )
            )
        return Step(setpoint)

    def _is_there(self, goal: Motion, measured: Motion, now_s: float) -> bool:
        """Within tolerance, and slow against the goal, for a while."""
        limit = self._tolerance
        there = (
            self._chase.has_met
            and (measured.position - goal.position).norm() <= limit.position_m
            and abs(wrap_angle(measured.yaw_rad - goal.yaw_rad)) <= limit.heading_rad
            and (measured.velocity - goal.velocity).norm() <= limit.speed_m_s
        )
        if not there:
            self._there_since_s = None
        elif self._there_since_s is None:
            self._there_since_s = now_s
        return self._there_since_s is not None and now_s - self._there_since_s >= limit.dwell_s

    def pose_reference(self) -> Reference | None:
        return self._chase
