"""Heading of the nose over time: turns from one heading to another, or a point that it faces all the time."""

from __future__ import annotations

import bisect
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from typing_extensions import override

from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.trajectory.envelope import turn_acceleration_limit, turn_jerk_limit
from ual_daemon.trajectory.motion import Motion
from ual_daemon.trajectory.turn import Turn


class HeadingPlan(ABC):
    """The heading at each time of a motion."""

    end_s: float
    """Time at which the heading has come to rest."""

    @abstractmethod
    def at(self, time_s: float, position: Vector3, velocity: Vector3, acceleration: Vector3) -> tuple[float, ...]:
        """Returns the heading, its rate and its acceleration at a time. The UAV then has the given motion."""


@dataclass(frozen=True, slots=True)
class Polynomial:
    """A heading as a polynomial of the fifth degree in time, given by its values and first two derivatives at both
    ends.

    `end` is not wrapped: the difference to `begin` is the angle of the turn.
    """

    duration_s: float
    begin: tuple[float, float, float]
    end: tuple[float, float, float]

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Returns the heading, its rate and its acceleration at a time from 0 to the duration."""
        (p0, v0, a0), h = self.begin, self.duration_s
        c3, c4, c5 = self._coefficients()
        x = time_s / h
        return (
            p0 + (v0 + a0 * time_s / 2) * time_s + x**3 * (c3 + x * (c4 + x * c5)),
            v0 + a0 * time_s + x**2 * (3 * c3 + x * (4 * c4 + x * 5 * c5)) / h,
            a0 + x * (6 * c3 + x * (12 * c4 + x * 20 * c5)) / (h * h),
        )

    def largest_jerk(self) -> float:
        """Returns the largest magnitude of the third derivative, rad/s^3."""
        c3, c4, c5 = self._coefficients()
        knots = [0.0, 1.0]
        if c5 != 0.0 and 0.0 < -c4 / (5 * c5) < 1.0:
            knots.append(-c4 / (5 * c5))
        return max(abs(6 * c3 + x * (24 * c4 + x * 60 * c5)) for x in knots) / self.duration_s**3

    def _coefficients(self) -> tuple[float, float, float]:
        """Returns the coefficients of what is added, over the share of the time, to the parabola of the start."""
        (p0, v0, a0), (p1, v1, a1), h = self.begin, self.end, self.duration_s
        dp, dv, da = p1 - p0 - (v0 + a0 * h / 2) * h, (v1 - v0 - a0 * h) * h, (a1 - a0) * h * h
        return 10 * dp - 4 * dv + da / 2, -15 * dp + 7 * dv - da, 6 * dp - 3 * dv + da / 2


def turn_s(turn_rad: float, limits: Limits) -> float:
    """Returns the shortest duration of a turn from rest to rest by a `Polynomial` (from its derivatives' peaks)."""
    turn = abs(turn_rad)
    return max(
        1.875 * turn / limits.yaw_rate_rad_s,
        math.sqrt(10 / math.sqrt(3) * turn / turn_acceleration_limit(limits)),
        math.pow(60 * turn / turn_jerk_limit(limits), 1 / 3),
    )


class Turns(HeadingPlan):
    """A sequence of turns, each as short as the limits allow or as long as requested. In between the heading is
    constant.

    A turn begins at its time, or at the end of the turn before it if that is later.
    """

    def __init__(self, start: Motion, limits: Limits) -> None:
        self._limits = limits
        self._times: list[float] = []
        self._turns: list[Turn | Polynomial] = []
        self._yaw_rad = start.yaw_rad
        self._start: Motion | None = start if start.yaw_rate_rad_s or start.yaw_acceleration_rad_s2 else None
        self.end_s = 0.0

    def turn_to(self, yaw_rad: float | None, begin_s: float, end_s: float) -> None:
        """Appends a turn by the smaller angle. For None it only ends the turn that the start is in."""
        begin_s = max(begin_s, self.end_s)
        turn: Turn | Polynomial
        if self._start is not None:
            begin_s = 0.0
            turn = Turn(self._start, yaw_rad, self._limits, within_s=end_s)
            self._start, self._yaw_rad = None, turn.at(turn.duration_s)[0]
        else:
            change = 0.0 if yaw_rad is None else wrap_angle(yaw_rad - self._yaw_rad)
            if change == 0.0:
                return
            duration_s = max(end_s - begin_s, turn_s(change, self._limits))
            turn = Polynomial(duration_s, (self._yaw_rad, 0.0, 0.0), (self._yaw_rad + change, 0.0, 0.0))
            self._yaw_rad += change
        self._times.append(begin_s)
        self._turns.append(turn)
        self.end_s = begin_s + turn.duration_s

    @property
    def end_rad(self) -> float:
        """The heading after all turns that were added so far."""
        return self._yaw_rad

    @override
    def at(self, time_s: float, position: Vector3, velocity: Vector3, acceleration: Vector3) -> tuple[float, ...]:
        index = bisect.bisect_right(self._times, time_s) - 1
        if index < 0:
            begin = self._turns[0].at(0.0)[0] if self._turns else self._yaw_rad
            return wrap_angle(begin), 0.0, 0.0
        turn = self._turns[index]
        t = time_s - self._times[index]
        if t >= turn.duration_s:
            return wrap_angle(turn.at(turn.duration_s)[0]), 0.0, 0.0
        yaw, rate, acceleration_rad_s2 = turn.at(t)
        return wrap_angle(yaw), rate, acceleration_rad_s2
