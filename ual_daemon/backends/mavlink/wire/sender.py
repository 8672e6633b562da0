"""From messages to bytes that leave through the link."""

from __future__ import annotations

import threading

from ual_daemon.backends.mavlink.links import MessageTransport
from ual_daemon.backends.mavlink.wire.messages import Codec, Message, VelocityTarget


class Sender:
    """Encodes and sends messages. From any thread."""

    def __init__(self, link: MessageTransport, codec: Codec) -> None:
        self._link = link
        self._codec = codec
        self._lock = threading.Lock()

    def join(self, system_id: int) -> None:
        """Makes us a component of this system in all messages from now on."""
        self._codec.join(system_id)

    def send_velocity(self, target: VelocityTarget) -> bool:
        """Sends a velocity, or drops it where it would be late, as `send` does."""
        with self._lock:
            return self._link.send(self._codec.encode_velocity(target), is_perishable=True)

    def send(self, message: Message, *, is_perishable: bool = False) -> bool:
        """Sends a message. Returns False when it could not leave, or when it is perishable and would be late."""
        with self._lock:  # messages must leave in the order in which they are numbered and signed; no send blocks
            return self._link.send(self._codec.encode(message), is_perishable=is_perishable)
