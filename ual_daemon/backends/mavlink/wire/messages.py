"""Encodes messages as frames, and decodes them."""

from __future__ import annotations

import struct
from functools import cache
from typing import NamedTuple, TypeAlias

from ual_daemon.backends.mavlink.wire import checksum
from ual_daemon.backends.mavlink.wire import dialect as mavlink
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame
from ual_daemon.backends.mavlink.wire.kinds import Message, MessageKind
from ual_daemon.backends.mavlink.wire.signing import Signer

__all__ = [
    "Codec", "Message", "TargetMessage", "VelocityTarget", "mavlink", "member_name", "message_name",
]  # fmt: skip

_HEADER = struct.Struct("<BBBBBBHB")
"""The header after the magic byte: length of the content, incompatible and compatible flags, sequence, system,
component, and the id in two parts."""
_SIGNED_FLAG = 0x01
_Target = mavlink.MAVLink_set_position_target_local_ned_message
_TARGET = struct.Struct("<BBBBBBHBI11fHBBB")
"""Header after the magic: payload length, incompatible and compatible flags, sequence, system, component, message id
(24 bits); then the payload in its order on the wire, largest fields first.
"""
_TARGET_BYTES = 53
_TARGET_ID = _Target.id
_TARGET_SEED = bytes((_Target.crc_extra,))
_TARGET_CONTENT = struct.Struct("<I11fHBBB")
_NED = mavlink.MAV_FRAME_LOCAL_NED


class TargetMessage(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED, whose fields are in their order. NED axes, m, m/s, m/s², rad.

    A `MavlinkMessage` of it would delay each setpoint.
    """

    time_boot_ms: int
    target_system: int
    target_component: int
    coordinate_frame: int
    type_mask: int
    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    afx: float
    afy: float
    afz: float
    yaw: float
    yaw_rate: float

    def get_kind(self) -> MessageKind:
        """Returns its kind."""
        return _Target

    def get_payload(self) -> bytes:
        """Returns its content as bytes."""
        time_ms, system, component, frame, mask, *motion = self
        return _TARGET_CONTENT.pack(time_ms, *motion, mask, system, component, frame)


VelocityTarget: TypeAlias = tuple[int, int, int, int, float, float, float, float, float, float, float]
"""A velocity for `TargetMessage` in numbers: time since boot, target's ids, type mask, velocity and acceleration in
NED, yaw rate."""


def message_name(message_id: int) -> str:
    """Returns the name of a message, human-readable."""
    kind = mavlink.mavlink_map.get(message_id)
    return f"message {message_id}" if kind is None else kind.name


def member_name(enum: str, number: int) -> str | None:
    """Returns the name of an enum's member, without that of the enum; None where it has none."""
    return _member_names(f"{enum}_").get(number)


@cache
def _member_names(beginning: str) -> dict[int, str]:
    members = vars(mavlink).items()
    return {number: name.removeprefix(beginning) for name, number in members if name.startswith(beginning)}


class Codec:
    """Encodes messages as those of one component, numbered, and signed with a `signer`; decodes frames.

    Not thread-safe: messages must leave in the order of their sequence numbers, so callers hold a lock while they
    encode and send.
    """

    def __init__(self, component_id: int, signer: Signer | None = None) -> None:
        self.component_id = component_id
        """Our component."""
        self.system_id = 0
        """The system that we are a component of."""
        self._signer = signer
        self._number = 0

    def join(self, system_id: int) -> None:
        """Makes us a component of this system from now on."""
        self.system_id = system_id

    def encode(self, message: Message) -> bytes:
        """Returns the bytes of a message, with the next sequence number."""
        kind, payload = message.get_kind(), message.get_payload()
        content = payload.rstrip(b"\0") or payload[:1]  # MAVLink 2 omits zeros at the end
        flags = 0 if self._signer is None else _SIGNED_FLAG
        ids = self.system_id, self.component_id, kind.id & 0xFFFF, kind.id >> 16
        covered = _HEADER.pack(len(content), flags, 0, self._number, *ids) + content
        self._number = (self._number + 1) % 256
        frame = b"\xfd" + covered + checksum.compute(covered, kind.crc_extra)
        return frame if self._signer is None else self._signer.sign(frame)

    def encode_velocity(self, target: VelocityTarget) -> bytes:
        """Returns the bytes of a velocity, as `encode` does those of the same `TargetMessage`, in fewer steps."""
        time_ms, system, component, mask, vx, vy, vz, ax, ay, az, yaw_rate = target
        if self._signer is not None:
            at, velocity, acceleration = (0.0, 0.0, 0.0), (vx, vy, vz), (ax, ay, az)
            ids = time_ms, system, component, _NED, mask
            return self.encode(TargetMessage(*ids, *at, *velocity, *acceleration, 0.0, yaw_rate))
        number = self._number
        self._number = (number + 1) % 256
        covered = _TARGET.pack(
            _TARGET_BYTES, 0, 0, number, self.system_id, self.component_id, _TARGET_ID, 0,
            time_ms, 0.0, 0.0, 0.0, vx, vy, vz, ax, ay, az, 0.0, yaw_rate, mask, system, component, _NED,
        )  # fmt: skip
        return b"\xfd" + covered + checksum.crc(covered + _TARGET_SEED).to_bytes(2, "little")

    def decode(self, frame: MavlinkFrame) -> Message:
        """Returns the message in a frame of a known kind; its signature is not checked."""
        header = frame.message_id, frame.sequence, frame.system_id, frame.component_id
        return mavlink.mavlink_map[frame.message_id].read(frame.payload, header)
