"""Setpoint adaptation: setpoints in the form that an autopilot takes; see `ual_daemon.backends.values.Takes`."""

from __future__ import annotations

from ual.geometry import Twist, Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.backends.values import PositionSetpoint, Setpoint, Snapshot, Takes, VelocitySetpoint
from ual_daemon.tracker.limits import scaled_down

_POSITION_GAIN = 0.8
"""From a position error to a velocity, 1/s; PX4's own is 0.95 (MPC_XY_P), ArduPilot's 1 (PSC_POSXY_P)."""
_YAW_GAIN = 1.5
"""From a heading error to a yaw rate, 1/s."""


def adapted(setpoint: Setpoint, takes: Takes, snapshot: Snapshot, limits: Limits) -> Setpoint:
    """Returns the setpoint, or the nearest to it that the autopilot takes. The snapshot must have a pose."""
    if takes is Takes.ALL or isinstance(setpoint, VelocitySetpoint):
        return setpoint
    if takes is Takes.POSITIONS:
        return PositionSetpoint(setpoint.position, setpoint.yaw_rad)
    return _velocity_towards(setpoint, snapshot, limits)


def _velocity_towards(setpoint: PositionSetpoint, snapshot: Snapshot, limits: Limits) -> VelocitySetpoint:
    """Returns the velocity that leads to a position: a proportional controller around the feed-forward."""
    assert snapshot.pose is not None
    here = snapshot.pose.value
    velocity = setpoint.velocity + (setpoint.position - here.position) * _POSITION_GAIN
    yaw_rate_rad_s = setpoint.yaw_rate_rad_s + wrap_angle(setpoint.yaw_rad - here.yaw_rad) * _YAW_GAIN
    wanted = scaled_down(Twist(velocity, Vector3(0.0, 0.0, yaw_rate_rad_s)), limits)
    return VelocitySetpoint(wanted.linear, wanted.angular.z)
