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
        self.all: tuple[T, ...] = ()
        """The listeners at present."""

    def __iter__(self) -> Iterator[T]:
        return iter(self.all)

    def add(self, listener: T) -> Callable[[], None]:
        """Adds a listener. Returns the function that removes it."""
        with self._lock:
            self.all = (*self.all, listener)

        def remove() -> None:
            with self._lock:
                self.all = tuple(other for other in self.all if other is not listener)

        return remove
