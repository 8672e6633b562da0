"""Setpoints as SET_POSITION_TARGET_LOCAL_NED: PX4 and ArduPilot take the same two kinds."""

from __future__ import annotations

from ual_daemon.backends.mavlink.axes import swap_local, swap_yaw
from ual_daemon.backends.mavlink.messages import Message, mavlink
from ual_daemon.backends.values import PositionSetpoint, Setpoint

_IGNORE_POSITION = 0b111
_IGNORE_ACCELERATION = 0b111 << 6
_IGNORE_YAW = 1 << 10
POSITION_MASK = 0
VELOCITY_MASK = _IGNORE_POSITION | _IGNORE_ACCELERATION | _IGNORE_YAW


def local_target(setpoint: Setpoint, system_id: int, time_ms: int, *, with_acceleration: bool = True) -> Message:
    """Position, velocity, acceleration (or not), heading and yaw rate, all of them; or velocity and yaw rate, and only
    they.

    The yaw rate is always there: without it, and without a heading, ArduPilot turns its nose to where it flies.
    """
    velocity = swap_local(*setpoint.velocity)
    if isinstance(setpoint, PositionSetpoint):
        mask = POSITION_MASK if with_acceleration else _IGNORE_ACCELERATION
        position, acceleration = swap_local(*setpoint.position), swap_local(*setpoint.acceleration)
        yaw_rad = swap_yaw(setpoint.yaw_rad)
    else:
        mask = VELOCITY_MASK
        position = acceleration = swap_local(0.0, 0.0, 0.0)
        yaw_rad = 0.0
    return mavlink.MAVLink_set_position_target_local_ned_message(
        time_ms,
        system_id,
        mavlink.MAV_COMP_ID_AUTOPILOT1,
        mavlink.MAV_FRAME_LOCAL_NED,
        mask,
        *position,
        *velocity,
        *acceleration,
        yaw_rad,
        -setpoint.yaw_rate_rad_s,
    )
