"""Passage of a trajectory's time: slower while the UAV lags behind, and without a step in what is sent.

The time scale s is the derivative of the trajectory's time by real time: 1 in real time, 0 at a standstill. The
reference that is sent has the velocity s v and the acceleration s^2 a + s' v (v and a are the trajectory's). The scale
changes by a cubic from one value to another, with s' = 0 at both ends. Before a change begins, the motions that it
would send are checked along the trajectory. It is made only if all of them keep the limits; else a slower or a smaller
change is tried, or none is made yet.

A stop is first tried as fast as one straight ahead. A cubic from 1 to 0 takes long: meanwhile a trajectory that still
accelerates leads far on. Or it begins to brake by itself, which leaves nothing to the cubic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ual_daemon.trajectory import Brake, Motion, Moved, Trajectory
from ual_daemon.trajectory.envelope import (
    RAMP_S,
    acceleration_share,
    speed_share,
    turn_acceleration_limit,
    turn_jerk_limit,
)

CHECK_PERIOD_S = 0.02
"""The time between the motions of a change that are checked: as short as the period of the setpoints of most autopilots
(50 Hz). Over a longer time, only the mean of a jerk that the change adds to and of the jerk after it would show."""
_LIMIT_MARGIN_RATIO = 1e-3
_SHORTEST_CHANGE_S = 0.4
_LONGEST_CHANGE_S = 8.0
_RETRY_S = 0.1
_SCALE_TOLERANCE = 0.1
_LEAST_SPEED_M_S = 1e-3
_TRIES = (None, (1.0, 1.0), (1.0, 2.0), (0.5, 1.0), (0.5, 2.0), (0.25, 2.0), (0.1, 2.0))
"""A stop, or the share of the wanted change that is tried, and its duration as a multiple of the shortest possible."""


@dataclass(frozen=True, slots=True)
class _Change:
    """A change of the time scale, by `by` within `duration_s`, that begins at a time of the trajectory."""

    begin_s: float
    scale: float
    by: float
    duration_s: float

    def at(self, t: float) -> tuple[float, float, float]:
        """Returns the trajectory's time, the scale, and its derivative, at a time from 0 to `duration_s`."""
        x = t / self.duration_s
        return (
            self.begin_s + self.scale * t + self.by * self.duration_s * x**3 * (1 - x / 2),
            self.scale + self.by * x * x * (3 - 2 * x),
            self.by * 6 * x * (1 - x) / self.duration_s,
        )


class _Stop:
    """A stop on the trajectory with the speeds of the fastest one straight ahead, from a time of the trajectory on."""

    def __init__(self, trajectory: Trajectory, begin_s: float, now: Motion) -> None:
        """`now` is the motion that is sent, faster than `_LEAST_SPEED_M_S`."""
        self._ahead = now.velocity / now.velocity.norm()
        along = self._ahead * now.acceleration.dot(self._ahead)
        self._brake = Brake(Motion(now.position, now.yaw_rad, now.velocity, along), trajectory.limits)
        self._trajectory = trajectory
        self.duration_s = self._brake.duration_s
        self._known = [self._found(0.0, begin_s)]
        """Values of `at`, `CHECK_PERIOD_S` apart, as far as they were needed."""

    def at(self, t: float) -> tuple[float, float, float]:
        """As `_Change.at`."""
        index = int(t / CHECK_PERIOD_S)
        while len(self._known) <= index:
            self._known.append(self._after(len(self._known) - 1, CHECK_PERIOD_S))
        return self._after(index, t - index * CHECK_PERIOD_S)

    def _after(self, index: int, step_s: float) -> tuple[float, float, float]:
        """Returns what it is some time after what is known."""
        known = self._known[index]
        time_s, scale, rate = known
        if step_s <= 0.0:
            return known
        moves_s = step_s if rate >= 0.0 else min(step_s, -scale / rate)  # it never goes back
        return self._found(index * CHECK_PERIOD_S + step_s, time_s + (scale + rate * moves_s / 2) * moves_s)

    def _found(self, t: float, time_s: float) -> tuple[float, float, float]:
        """Returns the same as `at`, for a time of the trajectory."""
        sent, own = self._brake.at(t), self._trajectory.at(time_s)
        own_m_s = max(_LEAST_SPEED_M_S, own.velocity.norm())
        scale = max(0.0, sent.velocity.dot(self._ahead)) / own_m_s
        own_m_s2 = own.acceleration.dot(own.velocity) / own_m_s
        return time_s, scale, (sent.acceleration.dot(self._ahead) - scale * scale * own_m_s2) / own_m_s


class TimeScaling:
    """The scaled time of a trajectory, and the motion that is sent at that time."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self.time_s = 0.0
        self.motion = trajectory.at(0.0)
        """The motion that is sent."""
        self._scale, self._scale_rate = 1.0, 0.0
        self._change: _Change | _Stop | None = None
        self._changing_s = 0.0
        self._wait_s = 0.0
        self._try_count = 0

    def move_to(self, moved: Moved) -> None:
        """Goes on, at the same time, on the trajectory that has moved."""
        self._trajectory, self.motion = moved, moved.moved(self.motion)

    def advance(self, passed_s: float, limit_s: float, wanted_scale: float) -> None:
        """Lets real time pass, but the trajectory's time not beyond a limit. The scale becomes `wanted_scale` (0 to 1)
        as far as the limits allow.
        """
        self._wait_s -= passed_s
        if self._change is None and self._scale == wanted_scale == 1.0 and self._scale_rate == 0.0:
            end_s = min(limit_s, self._trajectory.duration_s)
            if self.time_s < end_s:  # the usual case, as below: unscaled, on the way
                self.time_s = min(self.time_s + passed_s, end_s)
                self.motion = self._trajectory.at(self.time_s)
                return
        if self._is_at_rest():  # at any scale it stays at rest
            self._change, self._scale, self._scale_rate = None, wanted_scale, 0.0
            if self.time_s == min(limit_s, self._trajectory.duration_s):
                return  # it holds: the motion stays the same
        elif self._change is None and self._wait_s <= 0.0 and self._needs_change(wanted_scale):
            self._change, self._changing_s = self._next_try(wanted_scale), 0.0
        self._pass(passed_s)
        self.time_s = min(self.time_s, limit_s, self._trajectory.duration_s)
        self.motion = scaled(self._trajectory.at(self.time_s), self._scale, self._scale_rate)

    def _is_at_rest(self) -> bool:
        v, a = self.motion.velocity, self.motion.acceleration  # in plain numbers, as each update calls it
        return v.x == v.y == v.z == a.x == a.y == a.z == self.motion.yaw_rate_rad_s == 0.0 and (
            self.time_s == 0.0 or self._scale > 0.0
        )

    def _needs_change(self, wanted_scale: float) -> bool:
        return abs(wanted_scale - self._scale) > (_SCALE_TOLERANCE if 0.0 < wanted_scale < 1.0 else 1e-9)

    def _pass(self, passed_s: float) -> None:
        while self._change is not None:
            left_s = self._change.duration_s - self._changing_s
            self._changing_s += min(passed_s, left_s)
            self.time_s, self._scale, self._scale_rate = self._change.at(self._changing_s)
            if passed_s < left_s:
                return
            passed_s -= left_s
            self._change, self._scale_rate = None, 0.0
        self.time_s += self._scale * passed_s

    def _next_try(self, wanted_scale: float) -> _Change | _Stop | None:
        """Returns the next change to try if it keeps the limits, else None.

        Only one is tried at each update: this runs on the thread that flies the UAV, and a check takes milliseconds.
        """
        change = self._change_of(_TRIES[self._try_count], wanted_scale)
        self._try_count = (self._try_count + 1) % len(_TRIES)
        if change is not None and self._keeps_limits(change):
            self._try_count, self._wait_s = 0, _RETRY_S
            return change
        if self._try_count == 0:
            self._wait_s = _RETRY_S
        return None

    def _change_of(self, to_try: tuple[float, float] | None, wanted_scale: float) -> _Change | _Stop | None:
        """Returns one of `_TRIES`; None where it is a stop, and none is wanted or possible."""
        if to_try is None:
            is_moving = self.motion.velocity.norm() > _LEAST_SPEED_M_S
            return _Stop(self._trajectory, self.time_s, self.motion) if wanted_scale == 0.0 and is_moving else None
        share, longer = to_try
        by = (wanted_scale - self._scale) * share
        return _Change(self.time_s, self._scale, by, min(_LONGEST_CHANGE_S, self._shortest_s(by) * longer))

    def _shortest_s(self, by: float) -> float:
        """Returns the shortest duration of a change by `by` that may keep the limits, as far as they depend on it."""
        limits = self._trajectory.limits
        now = self._trajectory.at(self.time_s)
        stopping_s = acceleration_share(now.velocity, limits)
        yaw_stopping_s = abs(now.yaw_rate_rad_s) / turn_acceleration_limit(limits)
        # From the largest derivative of the cubic, 1.5 by / T, and its second derivative, 6 by / T^2.
        shortest_s: float = max(
            _SHORTEST_CHANGE_S,
            1.5 * abs(by) * max(stopping_s, yaw_stopping_s),
            (6 * abs(by) * stopping_s * RAMP_S) ** 0.5,
        )
        return shortest_s

    def _keeps_limits(self, change: _Change | _Stop) -> bool:
        last: Motion | None = None
        last_s = 0.0
        for index in range(math.ceil(change.duration_s / CHECK_PERIOD_S) + 1):
            check_s = min(index * CHECK_PERIOD_S, change.duration_s)
            time_s, scale, scale_rate = change.at(check_s)
            if not 0.0 <= scale <= 1.0 + _LIMIT_MARGIN_RATIO:
                return False
            own, step_s, last_s = self._trajectory.at(time_s), max(1e-6, check_s - last_s), check_s
            sent = scaled(own, scale, scale_rate)
            if not self._is_within(sent, own) or (last is not None and not self._is_smooth(last, sent, step_s)):
                return False
            last = sent
        return True

    def _is_within(self, sent: Motion, own: Motion) -> bool:
        """Returns whether a motion keeps the limits of speed and acceleration, or exceeds them no more than the
        trajectory.
        """
        limits = self._trajectory.limits
        return (
            speed_share(sent.velocity, limits) <= max(1.0, speed_share(own.velocity, limits)) + _LIMIT_MARGIN_RATIO
            and acceleration_share(sent.acceleration, limits)
            <= max(1.0, acceleration_share(own.acceleration, limits)) + _LIMIT_MARGIN_RATIO
            and abs(sent.yaw_acceleration_rad_s2)
            <= max(turn_acceleration_limit(limits), abs(own.yaw_acceleration_rad_s2)) * (1 + _LIMIT_MARGIN_RATIO)
        )

    def _is_smooth(self, last: Motion, sent: Motion, step_s: float) -> bool:
        """Returns whether the step from one motion to the next keeps the limits of jerk."""
        limits = self._trajectory.limits
        jerk = (sent.acceleration - last.acceleration) / step_s
        yaw_jerk = (sent.yaw_acceleration_rad_s2 - last.yaw_acceleration_rad_s2) / step_s
        return acceleration_share(jerk, limits) * RAMP_S <= 1.0 + _LIMIT_MARGIN_RATIO and abs(
            yaw_jerk
        ) <= turn_jerk_limit(limits) * (1 + _LIMIT_MARGIN_RATIO)


def scaled(motion: Motion, scale: float, scale_rate: float) -> Motion:
    """Returns the motion that is sent for a motion of the trajectory, at a time scale and its derivative."""
    if scale == 1.0 and scale_rate == 0.0:
        return motion
    return replace(
        motion,
        velocity=motion.velocity * scale,
        acceleration=motion.acceleration * (scale * scale) + motion.velocity * scale_rate,
        yaw_rate_rad_s=motion.yaw_rate_rad_s * scale,
        yaw_acceleration_rad_s2=motion.yaw_acceleration_rad_s2 * (scale * scale) + motion.yaw_rate_rad_s * scale_rate,
    )
