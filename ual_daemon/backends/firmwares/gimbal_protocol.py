"""Messages to and from gimbals by MAVLink's protocol, whatever passes them on.

https://mavlink.io/en/services/gimbal_v2.html. MAVLink's pitch is positive upwards, and its yaw to the right; ours are
the other way round (REP 103).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ual.geometry import Quaternion, wrap_angle
from ual.gimbals import AngleRange, GimbalAbility, GimbalAngles, GimbalReference

PITCH_YAW = 1000
"""MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW."""
RETRACT, NEUTRAL = 1, 2
"""Of GIMBAL_MANAGER_FLAGS."""
_ROLL_LOCK, _PITCH_LOCK, _YAW_LOCK, _YAW_IN_VEHICLE, _YAW_IN_EARTH = 4, 8, 16, 32, 64
FLAGS = {
    GimbalReference.BODY: _YAW_IN_VEHICLE,
    GimbalReference.HORIZON: _ROLL_LOCK | _PITCH_LOCK | _YAW_IN_VEHICLE,
    GimbalReference.EARTH: _ROLL_LOCK | _PITCH_LOCK | _YAW_LOCK | _YAW_IN_EARTH,
}
"""Of GIMBAL_MANAGER_FLAGS, for each reference of angles."""
_FAILURES = (
    "its roll is at a limit",
    "its pitch is at a limit",
    "its yaw is at a limit",
    "its encoder fails",
    "its power fails",
    "its motor fails",
    "its software fails",
    "its communication fails",
    "it is being calibrated",
)
"""The bits of GIMBAL_DEVICE_ERROR_FLAGS, the lowest first."""
_NORM_TOLERANCE = 0.1
_NORTH = Quaternion.from_yaw(math.pi / 2.0)
"""Turns what counts from north to what counts from east."""


class GimbalIdentity(NamedTuple):
    """Identity of a gimbal. A range is None where there is none, or one that cannot be."""

    abilities: frozenset[GimbalAbility]
    roll: AngleRange | None
    pitch: AngleRange | None
    yaw: AngleRange | None
    note: str = ""


def attitude_of(
    flags: int, q: Sequence[float], meant: GimbalReference | None = None
) -> tuple[Quaternion, GimbalReference] | None:
    """Reads where a gimbal looks by a quaternion (w, x, y, z) and GIMBAL_DEVICE_FLAGS; None where that is none.

    With `meant` it is in these axes, whatever its flags say.
    """
    w, x, y, z = q
    if not abs(math.sqrt(w * w + x * x + y * y + z * z) - 1.0) <= _NORM_TOLERANCE:  # also NaN
        return None
    turned = Quaternion(x, -y, -z, w).normalized()
    if meant is None and _is_from_north(flags):
        return _NORTH * turned, GimbalReference.EARTH
    return turned, meant or GimbalReference.HORIZON


def _is_from_north(flags: int) -> bool:
    """Returns whether yaw counts from north. Gimbals that do not say so mean the nose, unless their yaw is locked."""
    return not flags & _YAW_IN_VEHICLE and bool(flags & (_YAW_IN_EARTH | _YAW_LOCK))


def failures_of(flags: int) -> tuple[str, ...]:
    """Reads GIMBAL_DEVICE_ERROR_FLAGS."""
    return tuple(words for bit, words in enumerate(_FAILURES) if flags >> bit & 1)


def turning_params(angles: GimbalAngles, reference: GimbalReference, device_id: int) -> tuple[float, ...]:
    """Returns the parameters of a DO_GIMBAL_MANAGER_PITCHYAW, which has no roll."""
    pitch_deg, yaw_deg = -math.degrees(angles.pitch_rad), math.degrees(yaw_of(angles, reference))
    return (pitch_deg, yaw_deg, math.nan, math.nan, float(FLAGS[reference]), 0.0, float(device_id))


def rates_params(pitch_rad_s: float, yaw_rad_s: float, device_id: int) -> tuple[float, ...]:
    """Returns the parameters of a DO_GIMBAL_MANAGER_PITCHYAW for rates, level and from the nose."""
    flags = float(FLAGS[GimbalReference.HORIZON])
    return (math.nan, math.nan, -math.degrees(pitch_rad_s), -math.degrees(yaw_rad_s), flags, 0.0, float(device_id))


def resting_params(flag: int, device_id: int) -> tuple[float, ...]:
    """Returns the parameters of a DO_GIMBAL_MANAGER_PITCHYAW that moves it to neutral, or retracts it."""
    return (math.nan, math.nan, math.nan, math.nan, float(flag), 0.0, float(device_id))


def yaw_of(angles: GimbalAngles, reference: GimbalReference) -> float:
    """Returns the yaw of angles as MAVLink counts it: from north where ours counts from east."""
    is_from_east = reference is GimbalReference.EARTH
    return wrap_angle(math.pi / 2.0 - angles.yaw_rad) if is_from_east else -angles.yaw_rad
