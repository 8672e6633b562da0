"""A connection to a small rosbridge in the same process: its link steps the bridge instead of waiting for it."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

from typing_extensions import override

from tests.simulators.rosbridge import Bridge
from ual_daemon.backends.rosbridge.websocket import BridgeTransport

_NO_LOCK: AbstractContextManager[object] = contextlib.nullcontext()


class MemoryTransport(BridgeTransport):
    """Advances the time instead of waiting; without a time to wait, it takes what has come."""

    def __init__(
        self,
        bridge: Bridge,
        advance: Callable[[], None],
        lock: AbstractContextManager[object] = _NO_LOCK,
        is_full: Callable[[], bool] = lambda: False,
    ) -> None:
        """`advance` steps the bridge by one step. `lock` guards the bridge from other threads.

        `is_full` is whether the bridge reads nothing, so that what is perishable does not leave.
        """
        self._bridge = bridge
        self._session = bridge.connect()
        self._advance = advance
        self._lock = lock
        self._is_full = is_full
        self._heard = 0

    @property
    @override
    def received_count(self) -> int:
        return self._heard

    @override
    def receive(self, timeout_s: float) -> Sequence[str | bytes]:
        if timeout_s:
            self._advance()
        return self._take()

    def _take(self) -> Sequence[str | bytes]:
        self._heard += 1
        with self._lock:
            found = list(self._session.out)
            self._session.out.clear()
        return found

    @override
    def send(self, text: bytes, *, is_perishable: bool = False) -> bool:
        if is_perishable and self._is_full():
            return False
        with self._lock:
            self._session.receive(text)
        return True

    @override
    def ping(self) -> None:
        """It is always answered."""

    @override
    def close(self) -> None:
        self._bridge.sessions.remove(self._session)
