"""Continues a motion that is already (almost) along the line to its goal. Time-optimal from any state.

The motions along and across the line are planned independently, by Ruckig (Berscheid & Kroeger, "Jerk-limited Real-time
Trajectory Generation with Arbitrary Target States", RSS 2021). The motion across gets a small share of the limits, so
that both together keep the limits. So if a goal is given again, or moved a little, the flight hardly changes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import ruckig

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.trajectory.envelope import (
    RAMP_S,
    acceleration_limit,
    acceleration_share,
    planned_limit,
    speed_limit,
    speed_share,
)
from ual_daemon.trajectory.motion import Motion
from ual_daemon.trajectory.pulse import change_m, change_s

_LONGEST_MOTION_S = 600.0
"""Ruckig is numerically unstable for motions that take hours."""
_ALONG_SHARE = 0.95
_HALVINGS_COUNT = 6
_ZERO_TOLERANCE = 1e-9
_SAMPLES_COUNT = 40
_LIMIT_SLACK_RATIO = 1e-6


class Along:
    """A motion straight on to a goal; see `plan`."""

    def __init__(self, origin: Vector3, goal: Vector3, axes: Sequence[Vector3], trajectory: ruckig.Trajectory) -> None:
        self._origin, self._goal, self._axes, self._trajectory = origin, goal, axes, trajectory
        self.duration_s: float = trajectory.duration
        self.bend_s = self.duration_s
        """Time until which it may move across the line, or backwards; then it goes straight on."""

    @classmethod
    def plan(cls, start: Motion, goal: Vector3, limits: Limits, fastest_m_s: float) -> Along | None:
        """Plans the motion to rest at a goal. Returns None if the start is not along the line to the goal, or the line
        is too long.
        """
        path = goal - start.position
        length_m = path.norm()
        if length_m <= _ZERO_TOLERANCE:
            return None
        axes = _axes(path / length_m)
        top_m_s = min(fastest_m_s, speed_limit(axes[0], limits))
        if length_m / top_m_s > _LONGEST_MOTION_S:
            return None
        velocity = [start.velocity.dot(axis) for axis in axes]
        acceleration = [start.acceleration.dot(axis) for axis in axes]
        if all(abs(number) <= _ZERO_TOLERANCE for number in (*velocity[1:], *acceleration[1:])):
            shares: tuple[float, ...] = (1.0, 0.0, 0.0)
            axes, velocity, acceleration = axes[:1], velocity[:1], acceleration[:1]
        else:
            shares = _shares(axes, limits)
        speeds = [top_m_s * shares[0]]
        for axis, share in zip(axes[1:], shares[1:], strict=False):
            speeds.append(min(speed_limit(axis, limits), speed_limit(-axis, limits)) * share)
        accelerations = [acceleration_limit(e, limits) * c for e, c in zip(axes, shares, strict=False)]
        if not (_fits(velocity, speeds) and _fits(acceleration, accelerations)):
            return None
        request = ruckig.InputParameter(len(axes))
        request.current_position = [0.0] * len(axes)
        request.current_velocity, request.current_acceleration = velocity, acceleration
        request.target_position = [length_m, 0.0, 0.0][: len(axes)]
        request.max_acceleration = accelerations
        request.max_jerk = [limit / RAMP_S for limit in accelerations]
        request.max_velocity = list(map(planned_limit, speeds, velocity, acceleration, request.max_jerk))
        request.synchronization = ruckig.Synchronization.No
        trajectory = ruckig.Trajectory(len(axes))
        if ruckig.Ruckig(len(axes)).calculate(request, trajectory) != ruckig.Result.Working:
            return None
        found = cls(start.position, goal, axes, trajectory)
        forward_s = _forward_after_s(velocity[0], acceleration[0], length_m, accelerations[0])
        # The motion across ends at its own time, because the axes are not synchronized.
        found.bend_s = min(found.duration_s, max(forward_s, *trajectory.independent_min_durations[1:], 0.0))
        return found if found.is_within(limits) else None

    def at(self, time_s: float) -> tuple[Vector3, Vector3, Vector3]:
        """Returns position, velocity and acceleration at a time."""
        if time_s >= self.duration_s:
            return self._goal, Vector3(), Vector3()
        p, v, a = self._trajectory.at_time(max(0.0, time_s))
        return self._origin + self._sum(p), self._sum(v), self._sum(a)

    def _sum(self, components: Sequence[float]) -> Vector3:
        x = y = z = 0.0
        for axis, component in zip(self._axes, components, strict=True):
            x += axis.x * component
            y += axis.y * component
            z += axis.z * component
        return Vector3(x, y, z)

    def is_within(self, limits: Limits) -> bool:
        """Returns whether the velocities and accelerations of all axes together are allowed. From a start at a limit
        they may exceed it.
        """
        for sample in range(_SAMPLES_COUNT + 1):
            _, v, a = self.at(self.duration_s * sample / _SAMPLES_COUNT)
            share = acceleration_share(a, limits)
            died_out = v + a * (share * RAMP_S / 2)
            if max(share, speed_share(v, limits), speed_share(died_out, limits)) > 1.0 + _LIMIT_SLACK_RATIO:
                return False
        return True


def _forward_after_s(speed_m_s: float, acceleration_m_s2: float, length_m: float, limit_m_s2: float) -> float:
    """Returns how long it may take until a motion along a line goes only forward; infinity if it may pass the goal."""
    left_m_s = speed_m_s + acceleration_m_s2 * RAMP_S / 2  # a lower bound when it slows down, else an upper bound
    stop_m = max(speed_m_s, left_m_s) * RAMP_S + change_m(max(speed_m_s, left_m_s), 0.0, limit_m_s2)
    if stop_m > length_m:
        return math.inf
    if speed_m_s >= 0.0 and left_m_s >= 0.0:
        return 0.0
    return RAMP_S + change_s(max(abs(speed_m_s), abs(left_m_s)), limit_m_s2)


def _axes(direction: Vector3) -> list[Vector3]:
    h = direction.horizontal_norm()
    across = Vector3(-direction.y / h, direction.x / h, 0.0) if h > _ZERO_TOLERANCE else Vector3(0.0, 1.0, 0.0)
    return [direction, across, direction.cross(across)]


def _fits(numbers: Sequence[float], limits: Sequence[float]) -> bool:
    return all(abs(number) <= limit * (1.0 + _LIMIT_SLACK_RATIO) for number, limit in zip(numbers, limits, strict=True))


def _shares(axes: Sequence[Vector3], limits: Limits) -> tuple[float, float, float]:
    """Returns the shares of the limits for the motions along and across, with which all together keep the limits."""
    sides = list(itertools.product((-1.0, 1.0), repeat=3))

    def is_within(across: float, limit: Callable[[Vector3], float], share: Callable[[Vector3], float]) -> bool:
        sizes = [limit(axis) * c for axis, c in zip(axes, (_ALONG_SHARE, across, across), strict=True)]
        corners = (axes[0] * (sizes[0] * i) + axes[1] * (sizes[1] * j) + axes[2] * (sizes[2] * k) for i, j, k in sides)
        return all(share(corner) <= 1.0 for corner in corners)

    low, high = 0.0, 1.0
    for _ in range(_HALVINGS_COUNT):
        middle = (low + high) / 2
        fits = is_within(
            middle,
            lambda e: min(speed_limit(e, limits), speed_limit(-e, limits)),
            lambda v: speed_share(v, limits),
        ) and is_within(middle, lambda e: acceleration_limit(e, limits), lambda a: acceleration_share(a, limits))
        low, high = (middle, high) if fits else (low, middle)
    return _ALONG_SHARE, low, low
