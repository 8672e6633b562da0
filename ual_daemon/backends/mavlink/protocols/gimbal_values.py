"""The messages of a gimbal, as values and back. What they cannot mean is left out, and noted.

What their angles, flags and parameters mean is in `ual_daemon.backends.firmwares.gimbal_protocol`.
"""

from __future__ import annotations

import math

from ual.geometry import Quaternion
from ual.gimbals import AngleRange, GimbalAbility, GimbalAngles, GimbalReference
from ual_daemon.backends.firmwares import gimbal_protocol
from ual_daemon.backends.firmwares.gimbal_protocol import GimbalIdentity
from ual_daemon.backends.mavlink.wire.frames import MessageSource
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
LARGEST_ANGLE_RAD = 2.0 * math.pi + 0.01
"""A limit beyond it is none: PX4 1.17 says degrees here."""


def identity_of(message: Message) -> GimbalIdentity:
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
    return GimbalIdentity(frozenset(abilities), read.get("roll"), read.get("pitch"), read.get("yaw"), note)


def _range(least_rad: float, most_rad: float) -> AngleRange | None:
    is_possible = -LARGEST_ANGLE_RAD <= least_rad < most_rad <= LARGEST_ANGLE_RAD
    return AngleRange(least_rad, most_rad) if is_possible else None


def aiming(target: MessageSource, angles: GimbalAngles, reference: GimbalReference, device_id: int) -> Message:
    """Returns a GIMBAL_MANAGER_SET_ATTITUDE."""
    turned = Quaternion.from_euler(angles.roll_rad, -angles.pitch_rad, gimbal_protocol.yaw_of(angles, reference))
    q = (turned.w, turned.x, turned.y, turned.z)
    nan, flags = math.nan, gimbal_protocol.FLAGS[reference]
    return mavlink.MAVLink_gimbal_manager_set_attitude_message(*target, flags, device_id, q, nan, nan, nan)
