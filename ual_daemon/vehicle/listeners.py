"""The listeners of a vehicle."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

T = TypeVar("T")


class Listeners(Generic[T]):
    """Listeners that any thread may add and remove while another thread iterates over them (copy on write)."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listeners: tuple[T, ...] = ()

    def __iter__(self) -> Iterator[T]:
        return iter(self._listeners)

    def add(self, listener: T) -> Callable[[], None]:
        """Adds a listener. Returns the function that removes it."""
        with self._lock:
            self._listeners = (*self._listeners, listener)

        def remove() -> None:
            with self._lock:
                self._listeners = tuple(other for other in self._listeners if other is not listener)

        return remove
