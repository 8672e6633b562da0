"""Makes pictures one after another, on a thread of its own, so that the flight has the other processors."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from ual.errors import ResourceExhaustedError, UalError
from ual_daemon.backends import futures

T = TypeVar("T")

MOST_WAITING_PICTURES = 8
"""Pictures that may wait, of all cameras of a UAV."""


class PictureWorker:
    """Begins its thread with the first picture. From any thread."""

    def __init__(self, thread_name: str) -> None:
        self._thread_name = thread_name
        self._lock = threading.Lock()
        self._executor: ThreadPoolExecutor | None = None
        self._waiting_count = 0
        self._is_closed = False

    def submit(self, make: Callable[[], T]) -> Future[T]:
        """Has a picture made. The future ends with a `ResourceExhaustedError` where too many wait."""
        with self._lock:
            if self._waiting_count >= MOST_WAITING_PICTURES:
                text = f"{MOST_WAITING_PICTURES} pictures are being made already, which is the limit: wait for one"
                return futures.failed(ResourceExhaustedError(text, {"limit": str(MOST_WAITING_PICTURES)}))
            if self._is_closed:
                return futures.failed(UalError("this UAV is closed"))
            if self._executor is None:
                self._executor = ThreadPoolExecutor(1, self._thread_name)
            made = self._executor.submit(make)
            self._waiting_count += 1  # first that: it may have no thread
        made.add_done_callback(lambda _: self._on_made())
        return made

    def close(self) -> None:
        """Ends the thread, once the picture in progress is made. Those that wait are cancelled."""
        with self._lock:
            executor, self._executor, self._is_closed = self._executor, None, True
        if executor is not None:
            executor.shutdown(cancel_futures=True)

    def _on_made(self) -> None:
        with self._lock:
            self._waiting_count -= 1
