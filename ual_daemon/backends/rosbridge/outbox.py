"""Queue of messages to send on one connection."""

from __future__ import annotations

import threading

from ual_daemon.backends.rosbridge.websocket import BridgeTransport


class Outbox:
    """Sends messages in their order, each as soon as the connection takes it. Any thread may use it.

    A newer message of a key takes the place of one that waits. The lock orders messages; sending never blocks.
    """

    def __init__(self, transport: BridgeTransport) -> None:
        self._transport = transport
        self._waiting: dict[str, bytes] = {}
        self._lock = threading.Lock()

    def put(self, key: str, message: bytes, *, may_leave: bool = True) -> None:
        """Sends a message, at once if it may leave and the connection takes it.

        Raises:
            OSError: The connection is lost.
        """
        with self._lock:
            self._waiting.pop(key, None)
            self._waiting[key] = message
            if may_leave:
                self._send()

    def flush(self) -> None:
        """Sends what waits, as far as the connection takes it.

        Raises:
            OSError: The connection is lost.
        """
        with self._lock:
            self._send()

    def waits(self, key: str) -> bool:
        """Returns whether the message of a key has not left yet."""
        with self._lock:
            return key in self._waiting

    def withdraw(self, key: str) -> None:
        """Withdraws the message of a key, if it has not left yet."""
        with self._lock:
            self._waiting.pop(key, None)

    def clear(self) -> tuple[str, ...]:
        """Withdraws all messages, and returns their keys."""
        with self._lock:
            keys = tuple(self._waiting)
            self._waiting.clear()
        return keys

    def _send(self) -> None:
        for key in tuple(self._waiting):
            if not self._transport.send(self._waiting[key], is_perishable=True):
                return
            del self._waiting[key]
