"""Goals that move: a reference that catches up with one and then goes with it.

While a goal moves on at one velocity, the way to it is planned as if it stood still, in axes that move with it: the
velocity relative to it then has what the goal's leaves of the limits, and accelerations are the same. So a goal at a
steady velocity is met and followed without lag, and the limits are kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from ual.errors import UalError
from ual.geometry import Pose, Quaternion, Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import Setpoint, Snapshot
from ual_daemon.tracker.references import Reference, measured_motion, setpoint_of
from ual_daemon.trajectory import Brake, Line, Motion, Trajectory

_PLAN_PERIOD_S = 0.1
_MOST_OF_LIMITS = 0.8
"""A goal that moves faster than this share of the limits is followed at this share, plus what is left to catch up."""
_SHARED = 0.02
"""Limits relative to a goal are never smaller than this share of the UAV's."""
_MET_M, _MET_M_S = 0.1, 0.2
_FREE_LAG_M = 1.0
_FREE_LAG_S = 0.5

Goal = Callable[[float], Motion]
"""Where a goal is and how it moves at a time of the backend's clock, in the local frame. Raises a `UalError` where that
cannot be said any more (its frame was hung elsewhere, or moved beyond all distances).
"""
Admit = Callable[[Sequence[Vector3], Snapshot], None]
"""Raises a `UalError` where a way leaves the fence, or where it is not known any more where that lies."""


class MovingGoal(Reference):
    """Catches up with a goal that moves, and goes with it. It waits for a UAV that lags, at the geofence's edge, and
    while it is not known where the goal is.
    """

    def __init__(
        self,
        goal: Goal,
        start: Motion,
        now_s: float,
        limits: Limits,
        admit: Admit | None = None,
        max_speed_m_s: float = math.inf,
    ) -> None:
        """`max_speed_m_s` is never exceeded in any direction: a diagonal may be faster than its parts' limits."""
        self._goal = goal
        self._limits = limits
        self._max_speed_m_s = max_speed_m_s
        self._admit = admit
        self._motion = start
        self._looked_s = -math.inf
        self._planned_s = now_s
        self._anchor = goal(now_s)
        self._plan: Trajectory | None = None
        self._is_relative = True
        self.stopped: UalError | None = None
        """Why it does not go on: the geofence, or that the goal is lost; None while it does."""
        self.has_met = False
        """Whether it goes with the goal."""

    def goal(self, now_s: float) -> Motion:
        """Where the goal is, and how it moves. Raises as `Goal`."""
        return self._goal(now_s)

    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        now_s = snapshot.time_s
        if now_s - self._looked_s >= _PLAN_PERIOD_S:
            if self._plan is not None:
                self._motion = self._at(now_s)
            self._looked_s = now_s
            self._replan(snapshot)
        self._motion = self._at(now_s)
        return setpoint_of(self._motion)

    def _replan(self, snapshot: Snapshot) -> None:
        """A new way to where the goal is now, from the motion that is sent now."""
        start, was = self._motion, (self._plan, self._planned_s, self._is_relative)
        try:
            self._anchor = goal = _bounded(self._goal(snapshot.time_s), self._limits, self._max_speed_m_s)
            self._plan, self._planned_s, self._is_relative = self._way_to(start, goal), snapshot.time_s, True
            self._require_admitted(start, goal, snapshot)
        except UalError as error:
            self.stopped = error
        else:
            self.stopped = None
            if not _lags(start, snapshot):
                return
        if was[0] is not None and not was[2]:  # it brakes already
            self._plan, self._planned_s, self._is_relative = was
        else:
            self._plan, self._planned_s, self._is_relative = Brake(start, self._limits), snapshot.time_s, False

    def _way_to(self, start: Motion, goal: Motion) -> Trajectory:
        """From a motion to a goal that moves on as it does, relative to it."""
        relative = replace(
            start,
            position=start.position - goal.position,
            velocity=start.velocity - goal.velocity,
            yaw_rad=wrap_angle(start.yaw_rad - goal.yaw_rad),
            yaw_rate_rad_s=start.yaw_rate_rad_s - goal.yaw_rate_rad_s,
        )
        left_m_s = _left(self._max_speed_m_s, goal.velocity.norm())
        return Line(relative, Vector3(), 0.0, _relative_limits(goal, self._limits), left_m_s)

    def _require_admitted(self, start: Motion, goal: Motion, snapshot: Snapshot) -> None:
        """Raises why the plan must not be flown until the next one, if so: then it could no more stop inside.

        Or the goal, or the straight way there, lies outside.
        """
        if self._admit is None:
            return
        next_one = self._at(snapshot.time_s + 2 * _PLAN_PERIOD_S)
        self._admit([start.position, next_one.position, Brake(next_one, self._limits).end().position], snapshot)
        self._admit([start.position, goal.position], snapshot)

    def _at(self, now_s: float) -> Motion:
        assert self._plan is not None
        passed_s = now_s - self._planned_s
        planned = self._plan.at(passed_s)
        is_near = planned.position.norm() <= _MET_M and planned.velocity.norm() <= _MET_M_S
        self.has_met = self._is_relative and is_near
        if not self._is_relative:
            return planned
        goal = self._anchor
        return replace(
            planned,
            position=planned.position + goal.position + goal.velocity * passed_s,
            velocity=planned.velocity + goal.velocity,
            yaw_rad=wrap_angle(planned.yaw_rad + goal.yaw_rad + goal.yaw_rate_rad_s * passed_s),
            yaw_rate_rad_s=planned.yaw_rate_rad_s + goal.yaw_rate_rad_s,
        )

    def motion(self, snapshot: Snapshot) -> Motion:
        return self._motion

    def pose(self) -> Pose | None:
        return Pose(self._motion.position, Quaternion.from_yaw(self._motion.yaw_rad))


def _lags(reference: Motion, snapshot: Snapshot) -> bool:
    """Whether the UAV is too far behind what it is told."""
    lag_m = (measured_motion(snapshot).position - reference.position).norm()
    return lag_m > _FREE_LAG_M + _FREE_LAG_S * reference.velocity.norm()


def _bounded(goal: Motion, limits: Limits, max_speed_m_s: float) -> Motion:
    """A goal, no faster than can be followed."""
    v = goal.velocity
    vertical = limits.climb_speed_m_s if v.z > 0 else limits.descent_speed_m_s
    share = max(v.horizontal_norm() / limits.horizontal_speed_m_s, abs(v.z) / vertical, v.norm() / max_speed_m_s)
    excess = share / _MOST_OF_LIMITS
    most_rad_s = _MOST_OF_LIMITS * limits.yaw_rate_rad_s
    turn = max(-most_rad_s, min(most_rad_s, goal.yaw_rate_rad_s))
    return replace(goal, velocity=v / max(1.0, excess), acceleration=Vector3(), yaw_rate_rad_s=turn)


def _relative_limits(goal: Motion, limits: Limits) -> Limits:
    """What a goal's velocity leaves of the limits."""
    return replace(
        limits,
        horizontal_speed_m_s=_left(limits.horizontal_speed_m_s, goal.velocity.horizontal_norm()),
        climb_speed_m_s=_left(limits.climb_speed_m_s, goal.velocity.z),
        descent_speed_m_s=_left(limits.descent_speed_m_s, -goal.velocity.z),
        yaw_rate_rad_s=_left(limits.yaw_rate_rad_s, abs(goal.yaw_rate_rad_s)),
    )


def _left(limit: float, used: float) -> float:
    return max(_SHARED * limit, limit - used)
