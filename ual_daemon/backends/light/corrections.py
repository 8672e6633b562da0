"""Corrections of satellites for a light UAV: they are counted, so that programs which send them can be tried."""

from __future__ import annotations

import threading
from collections.abc import Callable

from typing_extensions import override

from ual_daemon.backends.offers.corrections import AutopilotCorrections, Injected


class LightCorrections(AutopilotCorrections):
    """Takes corrections of any length. The fix stays as it is. `clock` returns the simulated time."""

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self._lock = threading.Lock()
        self._counts = Injected()

    @override
    def inject(self, message: bytes) -> None:
        with self._lock:
            before, now_s = self._counts, self._clock()
            messages_count, bytes_count = before.messages_count + 1, before.bytes_count + len(message)
            self._counts = Injected(messages_count, bytes_count, left_s=now_s)

    @override
    def injected(self) -> Injected:
        return self._counts

    @override
    def now_s(self) -> float:
        return self._clock()

    @property
    def age_s(self) -> float | None:
        """Seconds since the last message, to 0.1 s; None before the first."""
        left_s = self._counts.left_s
        return None if left_s is None else round(max(0.0, self._clock() - left_s), 1)
