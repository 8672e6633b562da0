"""CRTP packets: a port, a channel, and up to 30 bytes. Little-endian throughout."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from ual.geometry import Quaternion, Vector3

CONSOLE, PARAMETER, LOG, LOCALIZATION, SETPOINT, HIGH_LEVEL, SUPERVISOR, PLATFORM = 0, 2, 5, 6, 7, 8, 9, 13
"""Ports."""
TOC_CHANNEL = 0
"""Of the ports PARAMETER and LOG."""
READ_CHANNEL, WRITE_CHANNEL = 1, 2
"""Of the port PARAMETER."""
LOG_CONTROL_CHANNEL, LOG_DATA_CHANNEL = 1, 2
"""Of the port LOG."""
VERSION_CHANNEL = 1
"""Of the port PLATFORM."""

TOC_ITEM, TOC_INFO = 2, 3
CREATE_BLOCK, DELETE_BLOCK, START_BLOCK, RESET_LOG = 6, 2, 3, 5
TAKE_OFF, LAND, GO_TO_LEGACY, GO_TO, STOP = 7, 8, 4, 12, 3
SET_ARMED, RESPONSE = 1, 0x80
FIRST_SUPERVISOR_PROTOCOL = 12
"""First version of the protocol in which arming has a port of its own."""
FIRST_GO_TO_PROTOCOL = 8
FIRST_STRAIGHT_YAW_PROTOCOL = 9
"""First version of the protocol in which yaw rates of velocity setpoints are positive to the left."""

_LINK_BITS_MASK = 0x0C
_EMPTY_PACKET_MASK = 0xF3
_VELOCITY_LEGACY, _FULL_STATE, _POSITION, _VELOCITY = 1, 6, 7, 8
_EXTERNAL_POSE_TYPE = 8
_MILLI_PER_UNIT = 1000.0
_LARGEST_INT16_VALUE = 32767
_QUATERNION_BITS = 9
_QUATERNION_MASK = (1 << _QUATERNION_BITS) - 1
ALL_GROUPS_MASK = 0


class CrtpPacket(NamedTuple):
    """One CRTP packet."""

    port: int
    channel: int
    data: bytes = b""

    def encode(self) -> bytes:
        """Returns the bytes on the link."""
        return bytes((self.port << 4 | _LINK_BITS_MASK | self.channel,)) + self.data

    @classmethod
    def decode(cls, raw: bytes) -> CrtpPacket | None:
        """Returns the packet; None if it is empty (the link's own)."""
        if not raw or raw[0] & _EMPTY_PACKET_MASK == _EMPTY_PACKET_MASK:
            return None
        return cls(raw[0] >> 4, raw[0] & 3, raw[1:])


def full_state(
    position: Vector3, velocity: Vector3, acceleration: Vector3, yaw_rad: float, yaw_rate_rad_s: float
) -> CrtpPacket:
    """Returns a setpoint with the whole motion. The position must be within `fits_full_state`."""
    numbers = (*position, *velocity, *acceleration)
    quaternion = compress(Quaternion(0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0)))
    turn = (0, 0, _int16(yaw_rate_rad_s))
    return CrtpPacket(SETPOINT, 0, struct.pack("<B9hI3h", _FULL_STATE, *map(_int16, numbers), quaternion, *turn))


def fits_full_state(position: Vector3) -> bool:
    """Returns whether a position can be sent with the whole motion, as millimetres in 16 bits."""
    return all(abs(each) * _MILLI_PER_UNIT <= _LARGEST_INT16_VALUE for each in position)


def position_setpoint(position: Vector3, yaw_rad: float) -> CrtpPacket:
    """Returns a setpoint of a position and heading."""
    return CrtpPacket(SETPOINT, 0, struct.pack("<B4f", _POSITION, *position, math.degrees(yaw_rad)))


def velocity_setpoint(velocity: Vector3, yaw_rate_rad_s: float, protocol: int) -> CrtpPacket:
    """Returns a setpoint of a velocity along the local axes and a yaw rate (positive: to the left)."""
    is_straight = protocol >= FIRST_STRAIGHT_YAW_PROTOCOL
    kind, sign = (_VELOCITY, 1.0) if is_straight else (_VELOCITY_LEGACY, -1.0)
    return CrtpPacket(SETPOINT, 0, struct.pack("<B4f", kind, *velocity, sign * math.degrees(yaw_rate_rad_s)))


def setpoints_stop() -> CrtpPacket:
    """Returns the notification that setpoints stop, so that the high-level commander's are taken."""
    return CrtpPacket(SETPOINT, 1, struct.pack("<BI", 0, 0))


def go_to(position: Vector3, yaw_rad: float, duration_s: float, protocol: int) -> CrtpPacket:
    """Returns the high-level command to fly to a place, and to stay there."""
    where = (*position, yaw_rad, duration_s)
    if protocol < FIRST_GO_TO_PROTOCOL:
        return CrtpPacket(HIGH_LEVEL, 0, struct.pack("<BB?5f", GO_TO_LEGACY, ALL_GROUPS_MASK, False, *where))
    return CrtpPacket(HIGH_LEVEL, 0, struct.pack("<BB??5f", GO_TO, ALL_GROUPS_MASK, False, False, *where))


def land(height_m: float, duration_s: float) -> CrtpPacket:
    """Returns the high-level command to land at the present place and heading, at a height in the local frame."""
    return CrtpPacket(HIGH_LEVEL, 0, struct.pack("<BBff?f", LAND, ALL_GROUPS_MASK, height_m, 0.0, True, duration_s))


def stop() -> CrtpPacket:
    """Returns the high-level command that stops the motors."""
    return CrtpPacket(HIGH_LEVEL, 0, bytes((STOP, ALL_GROUPS_MASK)))


def numbered_landing(packet: CrtpPacket, number: int) -> CrtpPacket:
    """Returns a landing whose answer differs from that of another number: its third byte comes back with the answer.

    It is the lowest byte of the height, which changes by less than 0.1 mm (below 3 m).
    """
    return packet._replace(data=packet.data[:2] + bytes((number & 0xFF,)) + packet.data[3:])


def arm(protocol: int, *, is_armed: bool) -> CrtpPacket:
    """Returns the command to arm or disarm."""
    port, channel = (SUPERVISOR, 1) if protocol >= FIRST_SUPERVISOR_PROTOCOL else (PLATFORM, 0)
    return CrtpPacket(port, channel, bytes((SET_ARMED, is_armed)))


def refuses_arming(packet: CrtpPacket) -> bool:
    """Returns whether a packet is the firmware's answer that it does not arm or disarm."""
    is_answer = packet.port == SUPERVISOR or (packet.port == PLATFORM and packet.channel == 0)
    data = packet.data
    return is_answer and len(data) > 1 and data[0] & ~RESPONSE == SET_ARMED and not data[1]


def external_pose(position: Vector3, orientation: Quaternion) -> CrtpPacket:
    """Returns a pose from outside, for the estimator."""
    return CrtpPacket(LOCALIZATION, 1, struct.pack("<B7f", _EXTERNAL_POSE_TYPE, *position, *orientation))


def external_position(position: Vector3) -> CrtpPacket:
    """Returns a position from outside, for the estimator."""
    return CrtpPacket(LOCALIZATION, 0, struct.pack("<3f", *position))


def compress(orientation: Quaternion) -> int:
    """Returns a rotation in 32 bits: which component is the largest, and 10 bits for each of the others."""
    parts = tuple(orientation)
    largest = max(range(4), key=lambda index: abs(parts[index]))
    packed = largest
    for index, part in enumerate(parts):
        if index != largest:
            is_negative = (part < 0.0) != (parts[largest] < 0.0)
            size = int(_QUATERNION_MASK * abs(part) * math.sqrt(2.0) + 0.5)
            packed = packed << (_QUATERNION_BITS + 1) | is_negative << _QUATERNION_BITS | min(size, _QUATERNION_MASK)
    return packed


def decompress(packed: int) -> Quaternion:
    """Returns the rotation that `compress` packed, as a unit quaternion."""
    largest = packed >> 30
    parts = [0.0] * 4
    for index in (3, 2, 1, 0):
        if index != largest:
            size = (packed & _QUATERNION_MASK) / _QUATERNION_MASK / math.sqrt(2.0)
            parts[index] = -size if packed >> _QUATERNION_BITS & 1 else size
            packed >>= _QUATERNION_BITS + 1
    parts[largest] = math.sqrt(max(0.0, 1.0 - sum(part * part for part in parts)))
    return Quaternion(*parts)


def _int16(value: float) -> int:
    """Returns thousandths in 16 bits."""
    return max(-_LARGEST_INT16_VALUE, min(_LARGEST_INT16_VALUE, round(value * _MILLI_PER_UNIT)))
