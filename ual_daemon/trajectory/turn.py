"""Turns of the heading within the limits of its rate, acceleration and jerk.

Time-optimal, jerk-limited motion from any state comes from Ruckig (Berscheid & Kroeger, "Jerk-limited Real-time
Trajectory Generation with Arbitrary Target States", RSS 2021).
"""

from __future__ import annotations

from contextlib import suppress

import ruckig

from ual.errors import UalError
from ual.geometry import wrap_angle
from ual.types import Limits
from ual_daemon.trajectory.envelope import turn_acceleration_limit, turn_jerk_limit
from ual_daemon.trajectory.motion import Motion

_LONGEST_S = 600.0
"""Ruckig's numbers fail for what lasts hours: a longer turn, to keep step with a longer way, ends before that."""
_LONGER = 1.01
"""Ruckig may find no turn that takes hardly longer than the shortest one."""


class Turn:
    """From the heading of a motion, turning or not, to another one, by the shorter way, within `duration_s`.

    `within_s` draws it out, to keep step with something that takes so long.
    """

    def __init__(self, start: Motion, yaw_rad: float | None, limits: Limits, within_s: float = 0.0) -> None:
        self._begin_rad = start.yaw_rad
        self._trajectory: ruckig.Trajectory | None = None
        self.duration_s = 0.0
        is_turning = start.yaw_rate_rad_s != 0.0 or start.yaw_acceleration_rad_s2 != 0.0
        if not is_turning and (yaw_rad is None or yaw_rad == start.yaw_rad):
            return
        given = ruckig.InputParameter(1)
        given.current_position = [0.0]
        given.current_velocity = [start.yaw_rate_rad_s]
        given.current_acceleration = [start.yaw_acceleration_rad_s2]
        given.max_velocity = [limits.yaw_rate_rad_s]
        given.max_acceleration = [turn_acceleration_limit(limits)]
        given.max_jerk = [turn_jerk_limit(limits)]
        if yaw_rad is None:  # it only comes to rest
            given.control_interface = ruckig.ControlInterface.Velocity
        else:
            given.target_position = [wrap_angle(yaw_rad - start.yaw_rad)]
        self._trajectory = _calculate(given)
        if within_s > self._trajectory.duration * _LONGER:
            given.minimum_duration = min(within_s, _LONGEST_S)
            with suppress(UalError):  # Ruckig finds none for some motions: then it turns as fast as it can
                self._trajectory = _calculate(given)
        self.duration_s = self._trajectory.duration

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Heading, its rate and acceleration at a time; before the start and after the end, those there."""
        if self._trajectory is None:
            return wrap_angle(self._begin_rad), 0.0, 0.0
        if time_s >= self.duration_s:
            p, _, _ = self._trajectory.at_time(self.duration_s)
            return wrap_angle(self._begin_rad + p[0]), 0.0, 0.0
        p, v, a = self._trajectory.at_time(max(0.0, time_s))
        return wrap_angle(self._begin_rad + p[0]), v[0], a[0]


def _calculate(problem: ruckig.InputParameter) -> ruckig.Trajectory:
    trajectory = ruckig.Trajectory(1)
    try:
        result = ruckig.Ruckig(1).calculate(problem, trajectory)
    except (ruckig.RuckigError, ValueError) as error:  # ValueError: a result that its binding does not name
        raise UalError(f"no turn could be planned ({str(error).splitlines()})") from None
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise UalError(f"no turn could be planned (ruckig: {result})")
    return trajectory
