"""Setpoints as SET_POSITION_TARGET_LOCAL_NED: PX4 and ArduPilot take the same two kinds."""

from __future__ import annotations

from ual_daemon.backends.firmwares.numbers import (
    ACCELERATED_VELOCITY_MASK,
    POSITION_MASK,
    UNACCELERATED_MASK,
    VELOCITY_MASK,
)
from ual_daemon.backends.mavlink.dialects.axes import enu_to_ned, enu_to_ned_yaw, enu_to_ned_yaw_rate
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, TargetMessage, mavlink
from ual_daemon.backends.values import PositionSetpoint, Setpoint

_ZERO = (0.0, 0.0, 0.0)
_FRAME = mavlink.MAV_FRAME_LOCAL_NED


def encode_position_target(
    setpoint: Setpoint, target: MessageSource, time_ms: int, *, with_acceleration: bool = True
) -> Message:
    """Returns the message of a setpoint.

    A position setpoint has position, velocity, acceleration (unless left out), heading and yaw rate; a velocity
    setpoint has velocity and yaw rate, and an acceleration if there is one. The yaw rate is in both: without it, and
    without a heading, ArduPilot turns its nose to where it flies.
    """
    velocity, position, acceleration, yaw_rad = enu_to_ned(setpoint.velocity), _ZERO, _ZERO, 0.0
    if isinstance(setpoint, PositionSetpoint):
        mask = POSITION_MASK if with_acceleration else UNACCELERATED_MASK
        position, acceleration = enu_to_ned(setpoint.position), enu_to_ned(setpoint.acceleration)
        yaw_rad = enu_to_ned_yaw(setpoint.yaw_rad)
    elif setpoint.acceleration is not None:
        mask, acceleration = ACCELERATED_VELOCITY_MASK, enu_to_ned(setpoint.acceleration)
    else:
        mask = VELOCITY_MASK
    turn_rad_s = enu_to_ned_yaw_rate(setpoint.yaw_rate_rad_s)
    # As `TargetMessage(...)` does, one call less.
    values = (time_ms, *target, _FRAME, mask, *position, *velocity, *acceleration, yaw_rad, turn_rad_s)
    return tuple.__new__(TargetMessage, values)
