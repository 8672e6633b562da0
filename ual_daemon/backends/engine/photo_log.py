"""Photos of a camera, by numbers. From any thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

from ual.errors import InvalidArgumentError

P = TypeVar("P")

MOST_PHOTOS = 10_000
"""Most photos that are kept; older ones are forgotten."""


class PhotoLog(Generic[P]):
    """Keeps the last `MOST_PHOTOS`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: deque[P] = deque(maxlen=MOST_PHOTOS)
        self._count = 0

    @property
    def count(self) -> int:
        """Photos that were added."""
        return self._count

    def add(self, make: Callable[[int], P]) -> P:
        """Adds what is made of the next number, and returns it."""
        with self._lock:
            added = make(self._count)
            self._count += 1
            self._kept.append(added)
            return added

    def since(self, first: int) -> list[P]:
        """Returns those from a number on, oldest first."""
        with self._lock:
            kept, oldest = list(self._kept), self._count - len(self._kept)
        return kept[max(0, first - oldest) :]

    def get(self, number: int) -> P:
        """Returns the one of a number.

        Raises:
            InvalidArgumentError: There is none, or it was forgotten.

        """
        with self._lock:
            oldest = self._count - len(self._kept)
            if oldest <= number < self._count:
                return self._kept[number - oldest]
            have = f"it has {oldest} to {self._count - 1}" if self._kept else "it has none"
        raise InvalidArgumentError(f"photo: there is no picture {number}: {have}", {"field": "photo"})
