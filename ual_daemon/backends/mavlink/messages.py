"""Encoding and decoding, with pymavlink's generated messages: the only module that touches its machinery."""

from __future__ import annotations

import threading
from typing import Any

# All dialects in one: "common" lacks CURRENT_MODE, which PX4 sends.
from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.frames import Frame

__all__ = ["EVENT_ID", "Codec", "CorruptFrameError", "Message", "mavlink"]

Message = Any
"""A message of pymavlink; its classes are generated without types."""

EVENT_ID = 410
"""PX4's event interface, which no dialect of pymavlink has. Its arrival is used, its content is not."""


class CorruptFrameError(Exception):
    """The bytes are no message: checksum or length is wrong."""


class Codec:
    """Our end of a MAVLink conversation: who we are, and the running number of what we send."""

    def __init__(self, component_id: int) -> None:
        self._lock = threading.Lock()
        self._sender = mavlink.MAVLink(None, srcSystem=0, srcComponent=component_id)
        self._receiver = mavlink.MAVLink(None)

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
            data: bytes = message.pack(self._sender)
            self._sender.seq = (self._sender.seq + 1) % 256
        return data

    def decode(self, frame: Frame) -> Message:
        """The message in a frame. Raises `CorruptFrameError`. From one thread."""
        try:
            return self._receiver.decode(bytearray(frame.data))
        except mavlink.MAVError as error:
            raise CorruptFrameError(str(error)) from None
