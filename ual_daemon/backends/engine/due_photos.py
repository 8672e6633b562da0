"""Takes the pictures that are due by time or by distance, one at a time, and counts those that are missed."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

_log = logging.getLogger(__name__)


class DuePhotos:
    """Of the camera of a number. `order` orders a picture, and `busy` says why no other one can be taken meanwhile."""

    def __init__(self, number: int, order: Callable[[], Future[Any]], busy: str) -> None:
        self._number = number
        self._order = order
        self._busy = busy
        self._lock = threading.Lock()
        self._running: Future[Any] | None = None
        self.missed_count = 0

    def take(self, due_count: int) -> None:
        """Takes one picture of those that are due, and counts the others as missed. Waits for nothing."""
        if not due_count:
            return
        with self._lock:
            self.missed_count += due_count - 1
        if self._running is not None and not self._running.done():
            self._miss(self._busy)
            return
        self._running = ordered = self._order()
        ordered.add_done_callback(self._on_end)

    def _on_end(self, ordered: Future[Any]) -> None:
        error = None if ordered.cancelled() else ordered.exception()
        if error is not None:
            self._miss(str(error))

    def _miss(self, why: str) -> None:
        if not self.missed_count:
            _log.warning("camera %d misses pictures: %s", self._number, why)
        with self._lock:
            self.missed_count += 1
