"""Setpoint adaptation: setpoints in the form that an autopilot takes; see `ual_daemon.backends.values.Takes`."""

from __future__ import annotations

from collections.abc import Callable

from ual.geometry import Twist, Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import (
    PositionSetpoint,
    Setpoint,
    Snapshot,
    Takes,
    VehicleInfo,
    VelocityGains,
    VelocitySetpoint,
)
from ual_daemon.tracker.limits import scaled_down

_ZERO = Vector3()
WHOLE_MOTION = Takes.POSITION | Takes.FEED_FORWARD
"""Positions with the motion in them: nothing is to be adapted for an autopilot that takes them."""


def adapted(setpoint: Setpoint, vehicle: VehicleInfo, snapshot: Snapshot, limits: Callable[[], Limits]) -> Setpoint:
    """Returns the setpoint, or the nearest to it that the autopilot takes. The snapshot must have a pose.

    `limits` returns those of a velocity that is flown instead of a position.
    """
    takes = vehicle.takes
    if isinstance(setpoint, VelocitySetpoint) or WHOLE_MOTION in takes:
        return setpoint
    if Takes.VELOCITY not in takes or (Takes.POSITION in takes and _stands_still(setpoint)):
        return PositionSetpoint(setpoint.position, setpoint.yaw_rad)
    return _velocity_towards(setpoint, vehicle.velocity_gains, snapshot, limits())


def _stands_still(setpoint: PositionSetpoint) -> bool:
    return setpoint.velocity == setpoint.acceleration == _ZERO and setpoint.yaw_rate_rad_s == 0.0


def _velocity_towards(
    setpoint: PositionSetpoint, gains: VelocityGains, snapshot: Snapshot, limits: Limits
) -> VelocitySetpoint:
    """Returns the velocity that leads to a position: a proportional controller around the feed-forward.

    The acceleration makes up for the vehicle's response, which is taken as of the first order: `response_s` times it is
    how far the velocity must lead.
    """
    assert snapshot.motion.pose is not None
    here = snapshot.motion.pose.value
    error = setpoint.position - here.position
    velocity = setpoint.velocity + setpoint.acceleration * gains.response_s + error * gains.position_per_s
    yaw_rate_rad_s = setpoint.yaw_rate_rad_s + wrap_angle(setpoint.yaw_rad - here.yaw_rad) * gains.yaw_per_s
    wanted = scaled_down(Twist(velocity, Vector3(0.0, 0.0, yaw_rate_rad_s)), limits)
    return VelocitySetpoint(wanted.linear, wanted.angular.z)
