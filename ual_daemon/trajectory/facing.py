"""Points the nose at a point all the time, as far as the limits of the heading allow.

Near the point, and directly above it, this would need faster turns than allowed. There, and at the start, where the
nose points elsewhere, it makes a smooth turn instead. This turn begins earlier and ends later, so that it keeps the
limits.
"""

from __future__ import annotations

import bisect
import cmath
import functools
import math
from collections.abc import Callable

from typing_extensions import override

from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.trajectory.envelope import RAMP_S, turn_acceleration_limit, turn_jerk_limit
from ual_daemon.trajectory.heading import HeadingPlan, Polynomial
from ual_daemon.trajectory.motion import Motion
from ual_daemon.trajectory.turn import Turn

Body = Callable[[float], tuple[Vector3, Vector3, Vector3]]

_SAMPLE_S = 0.02
_FREE_SHARE = 0.95
"""Less than 1, because the rate may be a little larger between the samples."""
_TURN_SHARE = 0.98
_FIRST_TURN_MARGIN_S = 0.25
_WIDER_TURN_FACTOR = 1.4
_SAMPLES_COUNT = 32
_LEAST_GOAL_DISTANCE_M = 1e-3


@functools.lru_cache(maxsize=8)
def free_m(speed_m_s: float, limits: Limits) -> float:
    """Returns the distance from a point beyond which facing it stays within the limits, whatever the (allowed) motion
    is. With r the vector to the point as a complex number, the heading is arg r, and its derivatives are the imaginary
    parts of the derivatives of log r.
    """

    def is_free(distance_m: float) -> bool:
        v, a = speed_m_s / distance_m, limits.horizontal_acceleration_m_s2 / distance_m
        turn_jerk = a / RAMP_S + 3 * v * a + 2 * v**3
        return (
            v + (a + v * v) ** 2 / turn_jerk_limit(limits) / 2 <= _FREE_SHARE * limits.yaw_rate_rad_s
            and a + v * v <= _FREE_SHARE * turn_acceleration_limit(limits)
            and turn_jerk <= _FREE_SHARE * turn_jerk_limit(limits)
        )

    distance_m = _LEAST_GOAL_DISTANCE_M
    while not is_free(distance_m):
        distance_m *= 1.1
    return distance_m


class Facing(HeadingPlan):
    """The heading of a body that moves and faces a point."""

    def __init__(
        self,
        start: Motion,
        point: Vector3,
        body: Body,
        duration_s: float,
        limits: Limits,
        *,
        is_far: bool = False,
    ) -> None:
        """`is_far` says that the body, from rest, never comes within `free_m` of the point."""
        self._point, self._body, self._duration_s, self._limits = point, body, duration_s, limits
        self._times: list[float] = []
        self._turns: list[Turn | Polynomial] = []
        self.end_s = duration_s
        fastest_m_s = max(limits.horizontal_speed_m_s, start.velocity.horizontal_norm())
        self._patch(start, [] if is_far else self._too_fast(fastest_m_s))

    @override
    def at(self, time_s: float, position: Vector3, velocity: Vector3, acceleration: Vector3) -> tuple[float, ...]:
        index = bisect.bisect_right(self._times, time_s) - 1
        if index >= 0:
            turn = self._turns[index]
            t = time_s - self._times[index]
            if t < turn.duration_s:
                yaw, rate, acceleration_rad_s2 = turn.at(t)
                return wrap_angle(yaw), rate, acceleration_rad_s2
            if self._is_last(index):
                return wrap_angle(turn.at(turn.duration_s)[0]), 0.0, 0.0
        return self._facing(position, velocity, acceleration)

    def _is_last(self, index: int) -> bool:
        """Returns whether a turn lasts until the end of the motion, where the point may be directly below."""
        return index + 1 == len(self._turns) and self._patched_s >= self._duration_s

    def _facing(self, position: Vector3, velocity: Vector3, acceleration: Vector3) -> tuple[float, float, float]:
        direction = complex(self._point.x - position.x, self._point.y - position.y)
        if abs(direction) < _LEAST_GOAL_DISTANCE_M:
            return 0.0, math.inf, math.inf
        turning = -complex(velocity.x, velocity.y) / direction
        return (
            cmath.phase(direction),
            turning.imag,
            (-complex(acceleration.x, acceleration.y) / direction - turning * turning).imag,
        )

    def _at(self, time_s: float) -> tuple[float, float, float]:
        return self._facing(*self._body(time_s))

    def _too_fast(self, fastest_m_s: float) -> list[tuple[float, float]]:
        """Returns the spans of time in which facing the point would exceed the limits."""
        spans: list[tuple[float, float]] = []
        far_m = free_m(fastest_m_s, self._limits)
        time_s, last_s = 0.0, -math.inf
        last = (0.0, 0.0, 0.0)
        while last_s < self._duration_s:
            time_s = min(time_s, self._duration_s)
            body = self._body(time_s)
            now = self._facing(*body)
            if self._is_too_fast(last, now, time_s - last_s):
                if spans and time_s - spans[-1][1] < 1.5 * _SAMPLE_S:
                    spans[-1] = (spans[-1][0], time_s)
                else:
                    spans.append((time_s, time_s))
            distance_m = math.hypot(self._point.x - body[0].x, self._point.y - body[0].y)
            last, last_s = now, time_s
            time_s += max(_SAMPLE_S, (distance_m - far_m) / fastest_m_s)  # before that, the body is too far away
        return spans

    def _is_too_fast(self, last: tuple[float, float, float], now: tuple[float, float, float], passed_s: float) -> bool:
        _, rate, acceleration = now
        # The largest rate if the turn were stopped from here.
        rate = abs(rate) + acceleration**2 / turn_jerk_limit(self._limits) / 2
        jerk = 0.0
        if passed_s < 1.5 * _SAMPLE_S:
            jerk = (acceleration - last[2]) / passed_s
            rate = max(
                rate, abs(wrap_angle(now[0] - last[0])) / (1.1 * passed_s)
            )  # directly above, `rate` is not valid
        return not (
            abs(rate) <= _FREE_SHARE * self._limits.yaw_rate_rad_s
            and abs(acceleration) <= _FREE_SHARE * turn_acceleration_limit(self._limits)
            and abs(jerk) <= _FREE_SHARE * turn_jerk_limit(self._limits)
        )

    def _patch(self, start: Motion, blind: list[tuple[float, float]]) -> None:
        """Replaces the heading at the start, and in the spans in which it cannot face the point, by smooth turns."""
        yaw = (start.yaw_rad, start.yaw_rate_rad_s, start.yaw_acceleration_rad_s2)
        facing = self._at(0.0)
        if any(abs(d) > 1e-9 for d in (wrap_angle(yaw[0] - facing[0]), yaw[1] - facing[1], yaw[2] - facing[2])):
            blind = [(0.0, 0.0), *(span for span in blind if span[1] > 0.0)]
        free_s = 0.0  # until this time the heading is planned
        while blind:
            (begin_s, end_s), *blind = blind
            margin_s = _FIRST_TURN_MARGIN_S
            turns: list[tuple[float, Turn | Polynomial]] = []
            while not turns:
                from_s, to_s = max(free_s, begin_s - margin_s), end_s + margin_s
                while blind and blind[0][0] <= to_s < self._duration_s:
                    end_s = blind.pop(0)[1]
                    to_s = end_s + margin_s
                turns = self._turns_between(from_s, yaw if from_s == 0.0 else self._at(from_s), to_s)
                margin_s *= _WIDER_TURN_FACTOR
            for at_s, turn in turns:
                self._times.append(at_s)
                self._turns.append(turn)
            free_s = to_s
            if to_s >= self._duration_s:
                blind = []
        self._patched_s = free_s
        self.end_s = max(self._duration_s, free_s)

    def _turns_between(
        self, from_s: float, begin: tuple[float, float, float], to_s: float
    ) -> list[tuple[float, Turn | Polynomial]]:
        """Returns one turn from the heading at one time to facing the point at another, within the limits; or else a
        turn to a halt and one from there. Returns nothing if neither is possible.
        """
        end = self._end_of(begin, from_s, to_s)
        if end is None:
            return []
        turn = Polynomial(to_s - from_s, begin, end)
        if self._is_kept(turn):
            return [(from_s, turn)]
        motion = Motion(Vector3(), begin[0], yaw_rate_rad_s=begin[1], yaw_acceleration_rad_s2=begin[2])
        halt = Turn(motion, None, self._limits)
        halted_s = from_s + halt.duration_s
        if halted_s >= to_s:
            return []
        rest = (halt.at(halt.duration_s)[0], 0.0, 0.0)
        end = self._end_of(rest, halted_s, to_s)
        turn = Polynomial(to_s - halted_s, rest, end or rest)
        return [(from_s, halt), (halted_s, turn)] if self._is_kept(turn) else []

    def _end_of(
        self, begin: tuple[float, float, float], from_s: float, to_s: float
    ) -> tuple[float, float, float] | None:
        """Returns the heading, rate and acceleration with which a turn ends: facing the point, by the smaller angle.
        Directly above the point this is not defined: at the end of the motion any heading will do, before that returns
        None.
        """
        yaw, rate, acceleration = self._at(min(to_s, self._duration_s))
        if math.isinf(rate):
            return (begin[0] + begin[1] * (to_s - from_s) / 2, 0.0, 0.0) if to_s >= self._duration_s else None
        return begin[0] + wrap_angle(yaw - begin[0]), rate, acceleration

    def _is_kept(self, turn: Polynomial) -> bool:
        rates, accelerations = zip(
            *(turn.at(turn.duration_s * i / _SAMPLES_COUNT)[1:] for i in range(_SAMPLES_COUNT + 1)), strict=True
        )
        return (
            max(map(abs, rates)) <= _TURN_SHARE * self._limits.yaw_rate_rad_s
            and max(map(abs, accelerations)) <= _TURN_SHARE * turn_acceleration_limit(self._limits)
            and turn.largest_jerk() <= turn_jerk_limit(self._limits)
        )
