"""Encoding and decoding, with pymavlink's generated messages: with `checksum` all that touches its machinery."""

from __future__ import annotations

import struct
import threading
from typing import Any

# All dialects in one: "common" lacks CURRENT_MODE, which PX4 sends.
from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink import checksum
from ual_daemon.backends.mavlink.frames import MAGIC_V2, Frame
from ual_daemon.backends.mavlink.signing import Signer

__all__ = ["EVENT_ID", "Codec", "CorruptFrameError", "Message", "TargetMessage", "mavlink"]

Message = Any
"""A message of pymavlink; its classes are generated without types."""

EVENT_ID = 410
"""PX4's event interface, which no dialect of pymavlink has: see `px4_events`."""


_HEADER = struct.Struct("<BBBBBBBHB")
"""Magic, payload length, incompatible and compatible flags, sequence, system, component, message id (24 bits)."""


class TargetMessage(mavlink.MAVLink_set_position_target_local_ned_message):  # type: ignore[misc]  # without types
    """SET_POSITION_TARGET_LOCAL_NED, framed without pymavlink's objects in between: every setpoint waits for it."""

    def _pack(self, mav: Any, crc_extra: int, payload: bytes, force_mavlink1: bool = False) -> bytes:  # noqa: ANN401
        if mav.signing.sign_outgoing or force_mavlink1:
            signed: bytes = super()._pack(mav, crc_extra, payload, force_mavlink1)
            return signed
        payload = payload.rstrip(b"\0") or payload[:1]  # as MAVLink 2 asks: trailing zeros are not sent
        header = _HEADER.pack(MAGIC_V2, len(payload), 0, 0, mav.seq, mav.srcSystem, mav.srcComponent, self.id, 0)
        return b"".join((header, payload, checksum.of(header[1:] + payload, crc_extra)))


class CorruptFrameError(Exception):
    """The frame is no message: its content does not fit."""


class Codec:
    """Our end of a MAVLink conversation: who we are, and the running number of what we send, signed if so wished."""

    def __init__(self, component_id: int, signer: Signer | None = None) -> None:
        self._lock = threading.Lock()
        self._signer = signer
        self._sender = mavlink.MAVLink(None, srcSystem=0, srcComponent=component_id)
        self._receiver = mavlink.MAVLink(None)
        if signer is not None:
            self._sender.signing.secret_key = signer.key
            self._sender.signing.sign_outgoing = True

    @property
    def system_id(self) -> int:
        return int(self._sender.srcSystem)

    @property
    def component_id(self) -> int:
        return int(self._sender.srcComponent)

    def join(self, system_id: int) -> None:
        """From now on we are a component of this system."""
        with self._lock:
            self._sender.srcSystem = system_id

    def encode(self, message: Message) -> bytes:
        """The bytes of a message. From any thread."""
        with self._lock:
            if self._signer is not None:
                self._sender.signing.timestamp = self._signer.next_timestamp()
            data: bytes = message.pack(self._sender)
            self._sender.seq = (self._sender.seq + 1) % 256
        return data

    def decode(self, frame: Frame) -> Message:
        """The message in a frame; its signature is not checked. Raises `CorruptFrameError`. From one thread."""
        try:
            return self._receiver.decode(bytearray(frame.data))
        except mavlink.MAVError as error:
            raise CorruptFrameError(str(error)) from None
