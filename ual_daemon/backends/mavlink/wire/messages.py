"""Encodes and decodes pymavlink's generated messages. Only this module and `checksum` use pymavlink's internals."""

from __future__ import annotations

import struct
from functools import cache
from typing import Any, NamedTuple, TypeAlias

# "all" has the messages of every dialect; "common" lacks CURRENT_MODE, which PX4 sends.
from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.wire import checksum
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame
from ual_daemon.backends.mavlink.wire.signing import Signer

__all__ = [
    "EVENT_ID", "Codec", "CorruptFrameError", "Message", "TargetMessage", "VelocityTarget", "mavlink", "message_name",
]  # fmt: skip

Message = Any
"""A message of pymavlink; its classes are generated without types."""

EVENT_ID = 410
"""The message of PX4's event interface, which no dialect of pymavlink has."""


_Target = mavlink.MAVLink_set_position_target_local_ned_message
_TARGET = struct.Struct("<BBBBBBHBI11fHBBB")
"""Header after the magic: payload length, incompatible and compatible flags, sequence, system, component, message id
(24 bits); then the payload in its order on the wire, largest fields first.
"""
_TARGET_BYTES = 53
_TARGET_ID, _TARGET_EXTRA = _Target.id, _Target.crc_extra
_TARGET_SEED = bytes((_TARGET_EXTRA,))
_NED = mavlink.MAV_FRAME_LOCAL_NED


class TargetMessage(NamedTuple):
    """SET_POSITION_TARGET_LOCAL_NED, framed without pymavlink's objects, which would delay every setpoint.

    The fields are pymavlink's, in their order. NED axes, m, m/s, m/s², rad.
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

    def pack(self, mav: Any) -> bytes:  # noqa: ANN401
        """Returns the bytes, as pymavlink's sender `mav` would send them."""
        time_ms, system, component, frame, mask, *motion = self
        if mav.signing.sign_outgoing or not frame:  # zeros at the end would have to be omitted
            theirs: bytes = _Target(*self).pack(mav)
            return theirs
        covered = _TARGET.pack(
            _TARGET_BYTES, 0, 0, mav.seq, mav.srcSystem, mav.srcComponent, _TARGET_ID, 0,
            time_ms, *motion, mask, system, component, frame,
        )  # fmt: skip
        return b"\xfd" + covered + checksum.compute(covered, _TARGET_EXTRA)


VelocityTarget: TypeAlias = tuple[int, int, int, int, float, float, float, float, float, float, float]
"""A velocity for `TargetMessage` in numbers: time since boot, target's ids, type mask, velocity and acceleration in
NED, yaw rate."""


def message_name(message_id: int) -> str:
    """Returns the name of a message, human-readable."""
    kind = mavlink.mavlink_map.get(message_id)
    return f"message {message_id}" if kind is None else str(kind.msgname)


class CorruptFrameError(Exception):
    """The content of the frame does not fit its message."""


class Codec:
    """Encodes messages as those of one component, numbered, and signed with a `signer`; decodes frames.

    Not thread-safe: messages must leave in the order of their sequence numbers, so callers hold a lock while they
    encode and send.
    """

    def __init__(self, component_id: int, signer: Signer | None = None) -> None:
        self._signer = signer
        self._sender = mavlink.MAVLink(None, srcSystem=0, srcComponent=component_id)
        self._receiver = mavlink.MAVLink(None)
        if signer is not None:
            self._sender.signing.secret_key = signer.key
            self._sender.signing.sign_outgoing = True

    @property
    def system_id(self) -> int:
        """The system that we are a component of."""
        return int(self._sender.srcSystem)

    @property
    def component_id(self) -> int:
        """Our component."""
        return int(self._sender.srcComponent)

    def join(self, system_id: int) -> None:
        """Makes us a component of this system from now on."""
        self._sender.srcSystem = system_id

    def encode(self, message: Message) -> bytes:
        """Returns the bytes of a message, with the next sequence number."""
        if self._signer is not None:
            self._sender.signing.timestamp = self._signer.next_timestamp()
        data: bytes = message.pack(self._sender)
        self._sender.seq = (self._sender.seq + 1) % 256
        return data

    def encode_velocity(self, target: VelocityTarget) -> bytes:
        """Returns the bytes of a velocity, as `encode` does those of the same `TargetMessage`, in fewer steps."""
        time_ms, system, component, mask, vx, vy, vz, ax, ay, az, yaw_rate = target
        if self._signer is not None:
            at, velocity, acceleration = (0.0, 0.0, 0.0), (vx, vy, vz), (ax, ay, az)
            ids = time_ms, system, component, _NED, mask
            return self.encode(TargetMessage(*ids, *at, *velocity, *acceleration, 0.0, yaw_rate))
        mav = self._sender
        number = mav.seq
        mav.seq = (number + 1) % 256
        covered = _TARGET.pack(
            _TARGET_BYTES, 0, 0, number, mav.srcSystem, mav.srcComponent, _TARGET_ID, 0,
            time_ms, 0.0, 0.0, 0.0, vx, vy, vz, ax, ay, az, 0.0, yaw_rate, mask, system, component, _NED,
        )  # fmt: skip
        return b"\xfd" + covered + checksum.crc(covered + _TARGET_SEED).to_bytes(2, "little")

    def decode(self, frame: MavlinkFrame) -> Message:
        """Returns the message in a frame; its signature is not checked. One with texts has its `content` as it came.

        Raises:
            CorruptFrameError: The content does not fit the message.

        """
        layout = _layout(frame.message_id)
        if layout is not None:
            return layout.read(frame)
        try:
            message = self._receiver.decode(bytearray(frame.data))
        except mavlink.MAVError as error:
            raise CorruptFrameError(str(error)) from None
        message.content = frame.payload
        return message


class _Header(NamedTuple):
    """The part of pymavlink's message header that its messages read."""

    msgId: int  # noqa: N815  pymavlink's names
    seq: int
    srcSystem: int  # noqa: N815
    srcComponent: int  # noqa: N815


class _Layout(NamedTuple):
    """The fields of a message on the wire: a name for each value, and where the values of arrays begin and end."""

    kind: Any
    payload: struct.Struct
    names: tuple[str, ...]
    arrays: tuple[tuple[str, int, int], ...]

    def read(self, frame: MavlinkFrame) -> Message:
        """Returns the message as pymavlink decodes it, but without its bytes, and without repeating the checks of
        `frames`.
        """
        values = self.payload.unpack_from(frame.payload.ljust(self.payload.size, b"\0"))
        message = object.__new__(self.kind)
        fields = message.__dict__ = dict(zip(self.names, values, strict=True))
        for name, begin, end in self.arrays:
            fields[name] = list(values[begin:end])
        ids = frame.message_id, frame.sequence, frame.system_id, frame.component_id
        fields["_header"] = tuple.__new__(_Header, ids)  # as `_Header(*ids)` does, one call less
        fields["_type"], fields["_fieldnames"] = self.kind.msgname, self.kind.fieldnames
        return message


@cache
def _layout(message_id: int) -> _Layout | None:
    """Returns None where pymavlink decodes the message: one with texts, or one that it does not know."""
    kind = mavlink.mavlink_map.get(message_id)
    if kind is None or "char" in kind.fieldtypes:
        return None
    names: list[str] = []
    arrays = []
    for name, length, array_length in zip(kind.ordered_fieldnames, kind.lengths, kind.array_lengths, strict=True):
        if array_length:
            arrays.append((name, len(names), len(names) + length))
        names += [name] * length
    newer = [(name, code) for name, code in _NEWER_FIELDS.get(message_id, ()) if name not in names]
    payload = struct.Struct(kind.unpacker.format + "".join(code for _, code in newer))
    return _Layout(kind, payload, (*names, *(name for name, _ in newer)), tuple(arrays))


_NEWER_FIELDS = {
    mavlink.MAVLINK_MSG_ID_MISSION_ACK: (("opaque_id", "I"),),
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT: (("opaque_id", "I"),),
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: (("mission_id", "I"), ("fence_id", "I"), ("rally_points_id", "I")),
}
"""Extensions of messages that the dialects of pymavlink do not have yet, with their codes of `struct`. They are 0 where
an autopilot does not send them, as all extensions of MAVLink."""
