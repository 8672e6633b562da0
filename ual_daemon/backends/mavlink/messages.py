"""Encoding and decoding, with pymavlink's generated messages: with `checksum` all that touches its machinery."""

from __future__ import annotations

import threading
from typing import Any

# All dialects in one: "common" lacks CURRENT_MODE, which PX4 sends.
from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.frames import Frame
from ual_daemon.backends.mavlink.signing import Signer

__all__ = ["EVENT_ID", "Codec", "CorruptFrameError", "Message", "mavlink"]

Message = Any
"""A message of pymavlink; its classes are generated without types."""

EVENT_ID = 410
"""PX4's event interface, which no dialect of pymavlink has. Its arrival is used, its content is not."""


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
