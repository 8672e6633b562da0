"""Inbox of a link: chunks that another thread has received, with a file descriptor that shows that some wait."""

from __future__ import annotations

import os
import select
import threading
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

from ual_daemon.backends.mavlink.links.base import BATCH_BYTES, Chunk

QUEUE_BYTES = 1 << 18
"""Bytes that may wait for the thread of one vehicle; more is dropped, as a system drops data that overflows a
socket.
"""


class _Ends(NamedTuple):
    """A pipe: it holds one byte while chunks wait."""

    read: int
    write: int


class Inbox:
    """Chunks that wait. `put` is for the thread that receives them, the rest for the link's own."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: deque[Chunk] = deque()
        self._waiting_bytes = 0
        self._ends: _Ends | None = None

    def open(self) -> None:
        """Begins to take chunks."""
        ends = os.pipe()
        for each in ends:
            os.set_blocking(each, False)
        self._ends = _Ends(*ends)

    def close(self) -> None:
        """Discards what waits, and takes nothing more."""
        with self._lock:
            ends, self._ends = self._ends, None
            self._waiting.clear()
            self._waiting_bytes = 0
            for each in ends or ():
                os.close(each)

    def descriptors(self) -> Mapping[int, int]:
        """See `MavlinkLink.descriptors`."""
        ends = self._ends
        return {} if ends is None else {ends.read: select.POLLIN}

    def put(self, chunk: Chunk) -> None:
        """Takes a chunk; drops it where too many wait."""
        with self._lock:
            if self._ends is None or self._waiting_bytes + len(chunk[0]) > QUEUE_BYTES:
                return
            if not self._waiting:
                os.write(self._ends.write, b"\0")
            self._waiting.append(chunk)
            self._waiting_bytes += len(chunk[0])

    def take(self) -> list[Chunk]:
        """Returns what waits, as far as it may be received at once."""
        found: list[Chunk] = []
        taken = 0
        with self._lock:
            while self._waiting and taken < BATCH_BYTES:
                found.append(self._waiting.popleft())
                taken += len(found[-1][0])
            self._waiting_bytes -= taken
            if found and not self._waiting and self._ends is not None:
                os.read(self._ends.read, 1)
        return found
