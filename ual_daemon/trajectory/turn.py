"""Turns of the heading within the limits of its rate, acceleration and jerk.

Ruckig plans the time-optimal, jerk-limited motion from any state (Berscheid & Kroeger, "Jerk-limited Real-time
Trajectory Generation with Arbitrary Target States", RSS 2021).
"""

from __future__ import annotations

from contextlib import suppress

import ruckig

from ual.errors import UalError
from ual.geometry import wrap_angle
from ual.types import Limits
from ual_daemon.trajectory.envelope import planned_limit, turn_acceleration_limit, turn_jerk_limit
from ual_daemon.trajectory.motion import Motion

_LONGEST_TURN_S = 600.0
"""Ruckig is numerically unstable for motions that take hours: a turn during a longer leg ends earlier than the leg."""
_LONGER_TURN_FACTOR = 1.01
"""Ruckig may fail to plan a turn that is only a little longer than the shortest one."""


class Turn:
    """A turn from the heading of a motion (with any rate) to another heading, by the smaller angle; takes `duration_s`.

    `within_s` makes it longer, so that it takes as long as a leg.
    """

    def __init__(self, start: Motion, yaw_rad: float | None, limits: Limits, within_s: float = 0.0) -> None:
        self._begin_rad = start.yaw_rad
        self._trajectory: ruckig.Trajectory | None = None
        self._end_rad = wrap_angle(start.yaw_rad)
        self.duration_s = 0.0
        is_turning = start.yaw_rate_rad_s != 0.0 or start.yaw_acceleration_rad_s2 != 0.0
        if not is_turning and (yaw_rad is None or yaw_rad == start.yaw_rad):
            return
        request = ruckig.InputParameter(1)
        request.current_position = [0.0]
        request.current_velocity = [start.yaw_rate_rad_s]
        request.current_acceleration = [start.yaw_acceleration_rad_s2]
        jerk_limit = turn_jerk_limit(limits)
        request.max_velocity = [
            planned_limit(limits.yaw_rate_rad_s, start.yaw_rate_rad_s, start.yaw_acceleration_rad_s2, jerk_limit)
        ]
        request.max_acceleration = [turn_acceleration_limit(limits)]
        request.max_jerk = [jerk_limit]
        if yaw_rad is None:  # only stops turning
            request.control_interface = ruckig.ControlInterface.Velocity
        else:
            request.target_position = [wrap_angle(yaw_rad - start.yaw_rad)]
        self._trajectory = _calculate(request)
        if within_s > self._trajectory.duration * _LONGER_TURN_FACTOR:
            request.minimum_duration = min(within_s, _LONGEST_TURN_S)
            with suppress(UalError):  # Ruckig fails for some motions: then the turn is as fast as possible
                self._trajectory = _calculate(request)
        self.duration_s = self._trajectory.duration
        self._end_rad = wrap_angle(start.yaw_rad + self._trajectory.at_time(self.duration_s)[0][0])

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Returns the heading, its rate and its acceleration at a time; before the start those of the start, after the
        end those of the end.
        """
        if self._trajectory is None:
            return self._end_rad, 0.0, 0.0
        if time_s >= self.duration_s:
            return self._end_rad, 0.0, 0.0
        p, v, a = self._trajectory.at_time(max(0.0, time_s))
        return wrap_angle(self._begin_rad + p[0]), v[0], a[0]


def _calculate(problem: ruckig.InputParameter) -> ruckig.Trajectory:
    trajectory = ruckig.Trajectory(1)
    try:
        result = ruckig.Ruckig(1).calculate(problem, trajectory)
    except (ruckig.RuckigError, ValueError) as error:  # ValueError: a result that Ruckig's binding has no name for
        raise UalError(f"no turn could be planned ({str(error).splitlines()})") from None
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise UalError(f"no turn could be planned (ruckig: {result})")
    return trajectory
