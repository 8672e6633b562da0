"""Straight lines to a goal, and braking."""

from __future__ import annotations

import math
from collections.abc import Iterable

from typing_extensions import override

from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.trajectory.along import Along
from ual_daemon.trajectory.bend import aim, brake
from ual_daemon.trajectory.envelope import acceleration_limit, speed_limit
from ual_daemon.trajectory.leg import Leg
from ual_daemon.trajectory.motion import Motion, Trajectory
from ual_daemon.trajectory.pieces import Pieces
from ual_daemon.trajectory.pulse import change_m, change_s, largest, peak_m_s
from ual_daemon.trajectory.turn import Turn

_SAME_POINT_M = 1e-9


class StraightTrajectory(Trajectory):
    """A straight line to a goal with a synchronized heading, time-optimal and jerk-limited.

    From rest the line is exactly straight. A motion along the line is continued. A motion in another direction bends to
    a straight line to the goal, or stops first if the goal is too near for that. The heading turns by the smaller
    angle, in the same time as the line takes; if it needs longer, a line from rest is flown slower.
    """

    def __init__(
        self, start: Motion, goal: Vector3, goal_yaw_rad: float, limits: Limits, max_speed_m_s: float = math.inf
    ) -> None:
        self.limits = limits
        self.length_m = (goal - start.position).norm()
        self._turn = Turn(start, goal_yaw_rad, limits)
        self._path: Along | _BentTrajectory
        if start.velocity == start.acceleration == Vector3():
            self._path = _BentTrajectory.from_rest(start.position, goal, limits, max_speed_m_s, self._turn.duration_s)
        else:
            self._path = Along.plan(start, goal, limits, max_speed_m_s) or _BentTrajectory(
                *aim(start, goal, limits, max_speed_m_s), goal, limits, max_speed_m_s
            )
        if self._path.duration_s > self._turn.duration_s > 0.0:
            self._turn = Turn(start, goal_yaw_rad, limits, within_s=self._path.duration_s)
        self.duration_s = max(self._path.duration_s, self._turn.duration_s)
        self._end = Motion(goal, wrap_angle(goal_yaw_rad))

    @override
    def bends_s(self) -> Iterable[tuple[float, float]]:
        return ((0.0, self._path.bend_s),)

    @override
    def end(self) -> Motion:
        return self._end

    @override
    def length_left_m(self, time_s: float) -> float:
        if time_s >= self.duration_s:
            return 0.0
        return (self._end.position - self._path.at(time_s)[0]).norm()

    @override
    def at(self, time_s: float) -> Motion:
        if time_s >= self.duration_s:
            return self._end
        position, velocity, acceleration = self._path.at(time_s)
        yaw, yaw_rate, yaw_acceleration = self._turn.at(time_s)
        return Motion(position, yaw, velocity, acceleration, yaw_rate, yaw_acceleration)


class Brake(Trajectory):
    """A motion from a start to rest, within the limits; straight ahead if the start has no acceleration."""

    def __init__(self, start: Motion, limits: Limits) -> None:
        self.limits = limits
        self._pieces = brake(start, limits)
        self._turn = Turn(start, None, limits)
        self.duration_s = max(self._pieces.duration_s, self._turn.duration_s)
        self.length_m = (self._pieces.position - start.position).norm()

    @override
    def at(self, time_s: float) -> Motion:
        position, velocity, acceleration = self._pieces.at(time_s)
        yaw, yaw_rate, yaw_acceleration = self._turn.at(time_s)
        return Motion(position, yaw, velocity, acceleration, yaw_rate, yaw_acceleration)


class _BentTrajectory:
    """A bend and the straight line after it. It takes at least `within_s`."""

    def __init__(
        self,
        bend: Pieces,
        direction: Vector3,
        left_m: float,
        goal: Vector3,
        limits: Limits,
        max_speed_m_s: float,
        within_s: float = 0.0,
    ) -> None:
        self._bend, self._goal = bend, goal
        self._leg: Leg | None = None
        self.duration_s = self.bend_s = bend.duration_s
        if left_m > _SAME_POINT_M:
            begin_m_s = bend.velocity.norm()
            fastest_m_s = min(max_speed_m_s, speed_limit(direction, limits))
            acceleration = acceleration_limit(direction, limits)
            peak = _peak_m_s(begin_m_s, left_m, fastest_m_s, acceleration, within_s)
            self._leg = Leg.along(bend.position, direction, left_m, (begin_m_s, peak, 0.0), acceleration)
            self.duration_s += self._leg.duration_s

    @classmethod
    def from_rest(
        cls, begin: Vector3, goal: Vector3, limits: Limits, max_speed_m_s: float, within_s: float
    ) -> _BentTrajectory:
        """Plans a line without a bend."""
        path = goal - begin
        length_m = path.norm()
        direction = path / length_m if length_m > 0.0 else Vector3(1.0, 0.0, 0.0)
        rest = Pieces(begin, Vector3(), Vector3())
        return cls(rest, direction, length_m, goal, limits, max_speed_m_s, within_s)

    def at(self, time_s: float) -> tuple[Vector3, Vector3, Vector3]:
        """Returns position, velocity and acceleration at a time."""
        if time_s >= self.duration_s:
            return self._goal, Vector3(), Vector3()
        if self._leg is None or time_s < self._bend.duration_s:
            return self._bend.at(time_s)
        return self._leg.at(time_s - self._bend.duration_s)


def _peak_m_s(begin_m_s: float, path_m: float, fastest_m_s: float, acceleration: float, within_s: float) -> float:
    """Returns the largest peak speed with which the motion to rest takes at least `within_s`."""
    peak = peak_m_s(begin_m_s, 0.0, path_m, fastest_m_s, acceleration)

    def longer_s(peak: float) -> float:
        ramps_m = change_m(begin_m_s, peak, acceleration) + change_m(peak, 0.0, acceleration)
        ramps_s = change_s(peak - begin_m_s, acceleration) + change_s(peak, acceleration)
        return ramps_s + (path_m - ramps_m) / peak - within_s

    if longer_s(peak) >= 0.0:
        return peak
    return largest(longer_s, path_m / within_s, peak)  # a peak below the mean speed would take longer than `within_s`
