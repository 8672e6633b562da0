"""What the messages of a gimbal say, as values, and what is said to it. What it cannot mean is left out, and noted.

https://mavlink.io/en/services/gimbal_v2.html. MAVLink's pitch is positive upwards, and its yaw to the right; ours are
the other way round (REP 103).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from ual.geometry import Quaternion
from ual.gimbals import AngleRange, GimbalAbility, GimbalAngles, GimbalReference
from ual_daemon.backends.mavlink.dialects.axes import enu_to_ned_yaw, orientation_to_enu
from ual_daemon.backends.mavlink.wire.frames import Source
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

_ABILITIES = {
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_ROLL_AXIS: {GimbalAbility.ROLL},
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS: {GimbalAbility.PITCH, GimbalAbility.RATES},
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS: {GimbalAbility.YAW, GimbalAbility.RATES},
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_FOLLOW: {GimbalAbility.BODY},
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_LOCK: {GimbalAbility.EARTH},
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_NEUTRAL: {GimbalAbility.NEUTRAL},
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_RETRACT: {GimbalAbility.RETRACT},
}
_ALWAYS = frozenset({GimbalAbility.HORIZON, GimbalAbility.CONTROL})
_FLAGS = {
    GimbalReference.BODY: mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME,
    GimbalReference.HORIZON: mavlink.GIMBAL_MANAGER_FLAGS_ROLL_LOCK
    | mavlink.GIMBAL_MANAGER_FLAGS_PITCH_LOCK
    | mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME,
    GimbalReference.EARTH: mavlink.GIMBAL_MANAGER_FLAGS_ROLL_LOCK
    | mavlink.GIMBAL_MANAGER_FLAGS_PITCH_LOCK
    | mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK
    | mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME,
}
_FAILURES = {
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_AT_ROLL_LIMIT: "its roll is at a limit",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_AT_PITCH_LIMIT: "its pitch is at a limit",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_AT_YAW_LIMIT: "its yaw is at a limit",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_ENCODER_ERROR: "its encoder fails",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_POWER_ERROR: "its power fails",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_MOTOR_ERROR: "its motor fails",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_SOFTWARE_ERROR: "its software fails",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_COMMS_ERROR: "its communication fails",
    mavlink.GIMBAL_DEVICE_ERROR_FLAGS_CALIBRATION_RUNNING: "it is being calibrated",
}
LARGEST_LIMIT_RAD = 2.0 * math.pi + 0.01
"""A limit beyond it is none: PX4 1.17 says degrees here."""
_NORM_TOLERANCE = 0.1


class Identity(NamedTuple):
    """What a GIMBAL_MANAGER_INFORMATION says. A range is None where there is none, or one that cannot be."""

    abilities: frozenset[GimbalAbility]
    roll: AngleRange | None
    pitch: AngleRange | None
    yaw: AngleRange | None
    note: str


def identity_of(message: Message) -> Identity:
    """Reads a GIMBAL_MANAGER_INFORMATION."""
    abilities = set(_ALWAYS)
    for flag, able in _ABILITIES.items():
        if message.cap_flags & flag:
            abilities |= able
    ranges = {
        "roll": (GimbalAbility.ROLL, message.roll_min, message.roll_max),
        "pitch": (GimbalAbility.PITCH, -message.pitch_max, -message.pitch_min),
        "yaw": (GimbalAbility.YAW, -message.yaw_max, -message.yaw_min),
    }
    read = {name: _range(least, most) for name, (axis, least, most) in ranges.items() if axis in abilities}
    odd = [f"{name} {ranges[name][1]:g} to {ranges[name][2]:g} rad" for name, found in read.items() if found is None]
    note = f"its limits cannot be, and are not used: {', '.join(odd)}" if odd else ""
    if GimbalAbility.YAW not in abilities:
        abilities.discard(GimbalAbility.EARTH)
    return Identity(frozenset(abilities), read.get("roll"), read.get("pitch"), read.get("yaw"), note)


def _range(least_rad: float, most_rad: float) -> AngleRange | None:
    is_possible = -LARGEST_LIMIT_RAD <= least_rad < most_rad <= LARGEST_LIMIT_RAD
    return AngleRange(least_rad, most_rad) if is_possible else None


def attitude_of(message: Message, meant: GimbalReference | None = None) -> tuple[Quaternion, GimbalReference] | None:
    """Reads where a gimbal looks from a GIMBAL_DEVICE_ATTITUDE_STATUS; None where that is no orientation.

    With `meant` it is in these axes, whatever its flags say.
    """
    w, x, y, z = message.q
    if not abs(math.sqrt(w * w + x * x + y * y + z * z) - 1.0) <= _NORM_TOLERANCE:  # also NaN
        return None
    if meant is None and _is_from_north(message.flags):
        return orientation_to_enu(w, x, y, z), GimbalReference.EARTH
    return Quaternion(x, -y, -z, w).normalized(), meant or GimbalReference.HORIZON


def _is_from_north(flags: int) -> bool:
    """Whether yaw counts from north. Gimbals that do not say so mean the nose, unless their yaw is locked."""
    if flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME:
        return False
    return bool(flags & (mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME | mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK))


def failures_of(message: Message) -> tuple[str, ...]:
    """Reads what a GIMBAL_DEVICE_ATTITUDE_STATUS says that fails."""
    return tuple(words for flag, words in _FAILURES.items() if message.failure_flags & flag)


def turning_params(angles: GimbalAngles, reference: GimbalReference, device_id: int) -> Sequence[float]:
    """Returns the parameters of a DO_GIMBAL_MANAGER_PITCHYAW, which has no roll."""
    pitch_deg, yaw_deg = -math.degrees(angles.pitch_rad), math.degrees(_yaw(angles, reference))
    return (pitch_deg, yaw_deg, math.nan, math.nan, float(_FLAGS[reference]), 0.0, float(device_id))


def rates_params(pitch_rad_s: float, yaw_rad_s: float, device_id: int) -> Sequence[float]:
    """Returns the parameters of a DO_GIMBAL_MANAGER_PITCHYAW for rates, level and from the nose."""
    flags = float(_FLAGS[GimbalReference.HORIZON])
    return (math.nan, math.nan, -math.degrees(pitch_rad_s), -math.degrees(yaw_rad_s), flags, 0.0, float(device_id))


def resting_params(flag: int, device_id: int) -> Sequence[float]:
    """Returns the parameters of a DO_GIMBAL_MANAGER_PITCHYAW that moves it to neutral, or retracts it."""
    return (math.nan, math.nan, math.nan, math.nan, float(flag), 0.0, float(device_id))


def aiming(target: Source, angles: GimbalAngles, reference: GimbalReference, device_id: int) -> Message:
    """Returns a GIMBAL_MANAGER_SET_ATTITUDE."""
    turned = Quaternion.from_euler(angles.roll_rad, -angles.pitch_rad, _yaw(angles, reference))
    q = (turned.w, turned.x, turned.y, turned.z)
    nan = math.nan
    return mavlink.MAVLink_gimbal_manager_set_attitude_message(*target, _FLAGS[reference], device_id, q, nan, nan, nan)


def _yaw(angles: GimbalAngles, reference: GimbalReference) -> float:
    return enu_to_ned_yaw(angles.yaw_rad) if reference is GimbalReference.EARTH else -angles.yaw_rad
