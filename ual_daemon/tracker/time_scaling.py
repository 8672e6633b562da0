"""How fast the time of a trajectory passes: slower while the UAV lags behind, and never so that it shows in a step.

With the pace p as the rate of the trajectory's time, the reference that is sent has the velocity p v and the
acceleration p^2 a + p' v (v and a are the trajectory's). A change of the pace is a cubic from one pace to another, with
p' 0 at both ends, that is looked at along the trajectory before it begins: it is made only where all that would be sent
keeps the limits, else a slower or a smaller one, or none yet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ual.geometry import Vector3
from ual_daemon.trajectory import Motion, Trajectory
from ual_daemon.trajectory.envelope import (
    RAMP_S,
    acceleration_share,
    speed_share,
    turn_acceleration_limit,
    turn_jerk_limit,
)

LOOK_S = 0.02
"""How closely a change is looked at: as often as setpoints are sent (50 Hz). Over a longer time one would see only the
mean of a jerk that the change adds to and of what follows it."""
_MARGIN = 1e-3
_SHORTEST_S = 0.4
_LONGEST_S = 8.0
_RETRY_S = 0.1
_SMALL = 0.1
_TRIES = ((1.0, 1.0), (1.0, 2.0), (0.5, 1.0), (0.5, 2.0), (0.25, 2.0), (0.1, 2.0))
"""A share of the wanted change, and how much longer than the shortest it takes."""


@dataclass(frozen=True, slots=True)
class _Change:
    """A change of the pace, by `by` within `duration_s`, that begins at a time of the trajectory."""

    begin_s: float
    pace: float
    by: float
    duration_s: float

    def at(self, t: float) -> tuple[float, float, float]:
        """The trajectory's time, the pace, and its rate, at a time from 0 to `duration_s`."""
        x = t / self.duration_s
        return (
            self.begin_s + self.pace * t + self.by * self.duration_s * x**3 * (1 - x / 2),
            self.pace + self.by * x * x * (3 - 2 * x),
            self.by * 6 * x * (1 - x) / self.duration_s,
        )


class TimeScaling:
    """The time of a trajectory, and what is sent of it."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self.time_s = 0.0
        self.motion = trajectory.at(0.0)
        """What is sent."""
        self._pace, self._rate = 1.0, 0.0
        self._change: _Change | None = None
        self._changing_s = 0.0
        self._rest_s = 0.0
        self._tries_count = 0

    def go_on(self, passed_s: float, limit_s: float, wanted: float) -> None:
        """Lets time pass, but not beyond a limit on the trajectory; the pace shall become what is wanted (0 to 1)."""
        self._rest_s -= passed_s
        if self._stands():  # whichever pace, it stands
            self._change, self._pace, self._rate = None, wanted, 0.0
        elif self._change is None and self._rest_s <= 0.0 and self._is_worth(wanted):
            self._change, self._changing_s = self._try(wanted), 0.0
        self._pass(passed_s)
        self.time_s = min(self.time_s, limit_s, self._trajectory.duration_s)
        self.motion = scaled(self._trajectory.at(self.time_s), self._pace, self._rate)

    def _stands(self) -> bool:
        return (
            self.motion.velocity == self.motion.acceleration == Vector3()
            and not self.motion.yaw_rate_rad_s
            and (self.time_s == 0.0 or self._pace > 0.0)
        )

    def _is_worth(self, wanted: float) -> bool:
        return abs(wanted - self._pace) > (_SMALL if 0.0 < wanted < 1.0 else 1e-9)

    def _pass(self, passed_s: float) -> None:
        while self._change is not None:
            left_s = self._change.duration_s - self._changing_s
            self._changing_s += min(passed_s, left_s)
            self.time_s, self._pace, self._rate = self._change.at(self._changing_s)
            if passed_s < left_s:
                return
            passed_s -= left_s
            self._change, self._rate = None, 0.0
        self.time_s += self._pace * passed_s

    def _try(self, wanted: float) -> _Change | None:
        """A change of the pace, if it keeps the limits. Another one at each update, as this runs on the thread that
        flies, and looking at one takes milliseconds.
        """
        share, longer = _TRIES[self._tries_count]
        self._tries_count = (self._tries_count + 1) % len(_TRIES)
        limits = self._trajectory.limits
        now = self._trajectory.at(self.time_s)
        stopping_s = acceleration_share(now.velocity, limits)
        turn_stopping_s = abs(now.yaw_rate_rad_s) / turn_acceleration_limit(limits)
        by = (wanted - self._pace) * share
        # From the largest rate of the cubic, 1.5 by / T, and its second derivative, 6 by / T^2.
        duration_s = max(
            _SHORTEST_S,
            1.5 * abs(by) * max(stopping_s, turn_stopping_s),
            (6 * abs(by) * stopping_s * RAMP_S) ** 0.5,
        )
        change = _Change(self.time_s, self._pace, by, min(_LONGEST_S, duration_s * longer))
        if self._is_kept(change):
            self._tries_count, self._rest_s = 0, _RETRY_S
            return change
        if self._tries_count == 0:
            self._rest_s = _RETRY_S
        return None

    def _is_kept(self, change: _Change) -> bool:
        limits = self._trajectory.limits
        last: Motion | None = None
        last_s = 0.0
        for look in range(math.ceil(change.duration_s / LOOK_S) + 1):
            look_s = min(look * LOOK_S, change.duration_s)
            time_s, pace, rate = change.at(look_s)
            own, step_s, last_s = self._trajectory.at(time_s), max(1e-6, look_s - last_s), look_s
            sent = scaled(own, pace, rate)
            if (
                speed_share(sent.velocity, limits) > max(1.0, speed_share(own.velocity, limits)) + _MARGIN
                or acceleration_share(sent.acceleration, limits)
                > max(1.0, acceleration_share(own.acceleration, limits)) + _MARGIN
                or abs(sent.yaw_acceleration_rad_s2)
                > max(turn_acceleration_limit(limits), abs(own.yaw_acceleration_rad_s2)) * (1 + _MARGIN)
            ):
                return False
            if last is not None:
                jerk = (sent.acceleration - last.acceleration) / step_s
                turn_jerk = (sent.yaw_acceleration_rad_s2 - last.yaw_acceleration_rad_s2) / step_s
                if acceleration_share(jerk, limits) * RAMP_S > 1.0 + _MARGIN or abs(turn_jerk) > turn_jerk_limit(
                    limits
                ) * (1 + _MARGIN):
                    return False
            last = sent
        return True


def scaled(motion: Motion, pace: float, rate: float) -> Motion:
    """A motion whose time passes at a pace, and the pace changes at a rate."""
    if pace == 1.0 and rate == 0.0:
        return motion
    return replace(
        motion,
        velocity=motion.velocity * pace,
        acceleration=motion.acceleration * (pace * pace) + motion.velocity * rate,
        yaw_rate_rad_s=motion.yaw_rate_rad_s * pace,
        yaw_acceleration_rad_s2=motion.yaw_acceleration_rad_s2 * (pace * pace) + motion.yaw_rate_rad_s * rate,
    )
