"""Frames by pymavlink, which most programs beside UAL use: what UAL sends and reads is compared with it."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame, split
from ual_daemon.backends.mavlink.wire.kinds import MavlinkMessage
from ual_daemon.backends.mavlink.wire.messages import Codec, TargetMessage
from ual_daemon.backends.mavlink.wire.signing import Signer


class AutopilotCodec:
    """Encodes messages as those of one component, numbered, and signed with a `signer`; decodes frames."""

    def __init__(self, component_id: int, signer: Signer | None = None) -> None:
        self._signer = signer
        self._sender = mavlink.MAVLink(None, srcSystem=0, srcComponent=component_id)
        self._receiver = mavlink.MAVLink(None)
        if signer is not None:
            self._sender.signing.secret_key = signer.key
            self._sender.signing.sign_outgoing = True

    @property
    def system_id(self) -> int:
        """The system that it is a component of."""
        return int(self._sender.srcSystem)

    @property
    def component_id(self) -> int:
        """Its component."""
        return int(self._sender.srcComponent)

    def join(self, system_id: int) -> None:
        """Makes it a component of this system from now on."""
        self._sender.srcSystem = system_id

    def encode(self, message: Any) -> bytes:
        """Returns the bytes of a message of pymavlink, with the next sequence number."""
        if self._signer is not None:
            self._sender.signing.timestamp = self._signer.next_timestamp()
        data: bytes = message.pack(self._sender)
        self._sender.seq = (self._sender.seq + 1) % 256
        return data

    def decode(self, frame: MavlinkFrame) -> Any:
        """Returns the message in a frame; its signature is not checked."""
        return self._receiver.decode(bytearray(frame.data))


def received(message: Any) -> Any:
    """Returns a message of UAL, or of pymavlink, as pymavlink receives it."""
    codec = AutopilotCodec(0)
    is_ours = isinstance(message, MavlinkMessage | TargetMessage)
    data = Codec(0).encode(message) if is_ours else codec.encode(message)
    return codec.decode(split(data)[0][0])
