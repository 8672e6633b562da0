"""Goals that move: a reference that catches up with a goal and then moves along with it.

While a goal moves at a constant velocity, the way to it is planned as if it stood still, in axes that move with it. The
velocity relative to the goal is limited to what the goal's velocity leaves of the limits; accelerations are the same in
both axes. So a goal at a constant velocity is met and followed without lag, and within the limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from typing_extensions import override

from ual.errors import UalError
from ual.geometry import Pose, Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import Setpoint, Snapshot
from ual_daemon.tracker.limits import clamped
from ual_daemon.tracker.references import Reference, measured_motion, pose_of, setpoint_of
from ual_daemon.trajectory import Brake, Motion, StraightTrajectory, Trajectory
from ual_daemon.trajectory.envelope import speed_share

_PLAN_PERIOD_S = 0.1
_FOLLOWED_SHARE = 0.8
"""A goal that moves faster than this share of the limits is followed at this share; the rest is left to catch up."""
_LEAST_LIMIT_SHARE = 0.02
"""The limits relative to a goal are never smaller than this share of the UAV's."""
_MET_M, _MET_M_S = 0.1, 0.2
_FREE_LAG_M = 1.0
_FREE_LAG_S = 0.5

GoalMotion = Callable[[float], Motion]
"""Returns where a goal is and how it moves, in the local frame, at a time of the backend's clock.

Raises a `UalError` if that is not known any more (its frame was given another parent, or moved beyond all distances).
"""
Admit = Callable[[Sequence[Vector3], Snapshot], None]
"""Raises a `UalError` if a polyline leaves the geofence, or if it is not known any more where that lies."""


class _Plan(NamedTuple):
    """A trajectory from a time on, relative to the goal or in the local frame."""

    trajectory: Trajectory
    begin_s: float
    is_relative: bool


class MovingGoal(Reference):
    """Catches up with a goal that moves, and moves along with it.

    It brakes and waits while the UAV lags, at the edge of the geofence, and while it is not known where the goal is.
    """

    def __init__(
        self,
        goal: GoalMotion,
        start: Motion,
        start_s: float,
        limits: Callable[[], Limits],
        admit: Admit | None = None,
        max_speed_m_s: float = math.inf,
    ) -> None:
        """It begins with the motion `start` at `start_s`. `max_speed_m_s` holds in any direction; what `limits` returns
        now, for the horizontal and vertical parts.
        """
        self._goal = goal
        self._get_limits, self._limits = limits, limits()
        self._max_speed_m_s = max_speed_m_s
        self._admit = admit
        self._motion = start
        self._replanned_s, self._updated_s = -math.inf, start_s
        self._planned_goal = goal(start_s)
        self._plan: _Plan | None = None
        self.has_met = False
        """Whether it moves along with the goal."""

    def goal(self, now_s: float) -> Motion:
        """Returns where the goal is, and how it moves. Raises as `GoalMotion`."""
        return self._goal(now_s)

    @override
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        now_s = snapshot.time_s
        late_s = max(0.0, now_s - self._updated_s - _PLAN_PERIOD_S)
        begin_s, self._updated_s = self._updated_s + late_s, now_s
        if self._plan is not None and late_s > 0.0:  # after a pause it goes on where it was admitted, without a step
            self._plan = self._plan._replace(begin_s=self._plan.begin_s + late_s)
        if now_s - self._replanned_s >= _PLAN_PERIOD_S:
            if self._plan is not None:
                begin_s, self._motion = now_s, self._motion_at(self._plan, now_s)
            self._replanned_s, self._limits = now_s, self._get_limits()
            self._plan = self._new_plan(self._plan, begin_s, snapshot)
        assert self._plan is not None
        self._motion = self._motion_at(self._plan, now_s)
        return setpoint_of(self._motion)

    def _new_plan(self, old: _Plan | None, begin_s: float, snapshot: Snapshot) -> _Plan:
        """Plans from the motion that is sent at a time: to the goal, or to rest if that is not possible."""
        start = self._motion
        try:
            self._planned_goal = goal = _bounded(self._goal(begin_s), self._limits, self._max_speed_m_s)
            plan = _Plan(self._trajectory_to(start, goal), begin_s, is_relative=True)
            self._require_admitted(plan, start, goal, snapshot)
        except UalError as error:
            self.stop_reason = error
        else:
            self.stop_reason = None
            if not _lags(start, snapshot):
                return plan
        if old is not None and not old.is_relative:  # it brakes already
            return old
        return _Plan(Brake(start, self._limits), begin_s, is_relative=False)

    def _trajectory_to(self, start: Motion, goal: Motion) -> Trajectory:
        """Plans from a motion to a goal, relative to the goal."""
        relative = replace(
            start,
            position=start.position - goal.position,
            velocity=start.velocity - goal.velocity,
            yaw_rad=wrap_angle(start.yaw_rad - goal.yaw_rad),
            yaw_rate_rad_s=start.yaw_rate_rad_s - goal.yaw_rate_rad_s,
        )
        left_m_s = _left(self._max_speed_m_s, goal.velocity.norm())
        return StraightTrajectory(relative, Vector3(), 0.0, _relative_limits(goal, self._limits), left_m_s)

    def _require_admitted(self, plan: _Plan, start: Motion, goal: Motion, snapshot: Snapshot) -> None:
        """Raises a `UalError` if the geofence does not admit the plan.

        The UAV must stay inside, and still be able to stop inside, two planning periods from now: the next plan comes
        before that. The goal and the straight way to it must be inside, too.
        """
        if self._admit is None:
            return
        later = self._motion_at(plan, snapshot.time_s + 2 * _PLAN_PERIOD_S)
        self._admit([start.position, later.position, Brake(later, self._limits).end().position], snapshot)
        self._admit([start.position, goal.position], snapshot)

    def _motion_at(self, plan: _Plan, now_s: float) -> Motion:
        passed_s = now_s - plan.begin_s
        planned = plan.trajectory.at(passed_s)
        is_near = planned.position.norm() <= _MET_M and planned.velocity.norm() <= _MET_M_S
        self.has_met = plan.is_relative and is_near
        if not plan.is_relative:
            return planned
        goal = self._planned_goal
        return replace(
            planned,
            position=planned.position + goal.position + goal.velocity * passed_s,
            velocity=planned.velocity + goal.velocity,
            yaw_rad=wrap_angle(planned.yaw_rad + goal.yaw_rad + goal.yaw_rate_rad_s * passed_s),
            yaw_rate_rad_s=planned.yaw_rate_rad_s + goal.yaw_rate_rad_s,
        )

    @override
    def motion(self, snapshot: Snapshot) -> Motion:
        return self._motion

    @override
    def motion_time_s(self, snapshot: Snapshot) -> float:
        return self._updated_s

    @override
    def pose(self) -> Pose | None:
        return pose_of(self._motion)

    @override
    def path_points(self, now_s: float) -> Sequence[Vector3]:
        try:
            return self._motion.position, self._goal(now_s).position
        except UalError:  # it is not known where the goal is
            return ()


def _lags(reference: Motion, snapshot: Snapshot) -> bool:
    """Returns whether the UAV is too far behind the reference."""
    lag_m = (measured_motion(snapshot).position - reference.position).norm()
    return lag_m > _FREE_LAG_M + _FREE_LAG_S * reference.velocity.norm()


def _bounded(goal: Motion, limits: Limits, max_speed_m_s: float) -> Motion:
    """Returns a goal that is no faster than can be followed."""
    v = goal.velocity
    excess = max(speed_share(v, limits), v.norm() / max_speed_m_s) / _FOLLOWED_SHARE
    yaw_rate_rad_s = clamped(goal.yaw_rate_rad_s, _FOLLOWED_SHARE * limits.yaw_rate_rad_s)
    return replace(goal, velocity=v / max(1.0, excess), acceleration=Vector3(), yaw_rate_rad_s=yaw_rate_rad_s)


def _relative_limits(goal: Motion, limits: Limits) -> Limits:
    """Returns what a goal's velocity leaves of the limits."""
    return replace(
        limits,
        horizontal_speed_m_s=_left(limits.horizontal_speed_m_s, goal.velocity.horizontal_norm()),
        climb_speed_m_s=_left(limits.climb_speed_m_s, goal.velocity.z),
        descent_speed_m_s=_left(limits.descent_speed_m_s, -goal.velocity.z),
        yaw_rate_rad_s=_left(limits.yaw_rate_rad_s, abs(goal.yaw_rate_rad_s)),
    )


def _left(limit: float, used: float) -> float:
    return max(_LEAST_LIMIT_SHARE * limit, limit - used)
