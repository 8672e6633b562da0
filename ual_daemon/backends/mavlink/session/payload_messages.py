"""The messages that extensions listen to. They outlive the session with an autopilot."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.payload import PayloadCallback, PayloadMessage

_log = logging.getLogger(__name__)


class PayloadMessages:
    """Passes messages to the listeners for their ids. Only `on_message` belongs to the thread that receives."""

    def __init__(self) -> None:
        self.ids: frozenset[int] = frozenset()
        """The ids that are listened to."""
        self.on_ids: Callable[[frozenset[int]], object] = lambda _: None
        """Called with each new set of ids, by the thread that changes it, with the lock held."""
        self._lock = threading.Lock()
        self._callbacks: tuple[tuple[int, PayloadCallback], ...] = ()

    def add(self, message_id: int, callback: PayloadCallback) -> Callable[[], None]:
        """Listens to a message. Returns the function that ends this."""
        entry = (message_id, callback)
        with self._lock:
            self._set((*self._callbacks, entry))
        return lambda: self._remove(entry)

    def listen_by(self, on_ids: Callable[[frozenset[int]], object]) -> None:
        """Has another session take the ids from now on, and calls it with the present ones."""
        with self._lock:
            self.on_ids = on_ids
            on_ids(self.ids)

    def on_message(self, message: Message, now_s: float) -> None:
        """Takes a decoded message. A defect of a callback is logged, and costs no other listener the message."""
        message_id = message.get_msgId()
        if message_id not in self.ids:
            return
        fields = {name: getattr(message, name) for name in message.get_fieldnames()}
        passed = PayloadMessage(message.get_type(), fields, now_s)
        for callback in [callback for wanted_id, callback in self._callbacks if wanted_id == message_id]:
            try:
                callback(passed)
            except Exception:  # noqa: BLE001 - an extension's defect must not end the session with the autopilot
                _log.exception("an extension's callback failed with %s", passed.name)

    def _remove(self, entry: tuple[int, PayloadCallback]) -> None:
        with self._lock:
            self._set(tuple(each for each in self._callbacks if each is not entry))

    def _set(self, callbacks: tuple[tuple[int, PayloadCallback], ...]) -> None:
        self._callbacks = callbacks
        self.ids = frozenset(message_id for message_id, _ in callbacks)
        self.on_ids(self.ids)
