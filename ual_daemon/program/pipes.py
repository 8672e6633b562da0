"""Pipes between the processes of a fleet, read in pieces without waiting."""

from __future__ import annotations

import os
from contextlib import suppress

_CHUNK_BYTES = 1 << 16
_MOST_CHUNKS = 16
"""Chunks that are read from one pipe before the others have their turn. A pipe holds less."""


class PipeReader:
    """Reads what comes through a pipe, in pieces."""

    def __init__(self, reads: int, end: bytes) -> None:
        """`reads` is the pipe's end; `end` ends each piece."""
        self.reads = reads
        self._end = end
        self._rest = b""
        os.set_blocking(reads, False)

    def pieces(self) -> tuple[list[bytes], bool]:
        """Returns the whole pieces that have come since the last call, and whether there may be more later."""
        chunk = None
        with suppress(BlockingIOError):
            for _ in range(_MOST_CHUNKS):
                chunk = os.read(self.reads, _CHUNK_BYTES)
                self._rest += chunk
                if not chunk:
                    break
        *whole, self._rest = self._rest.split(self._end)
        return whole, chunk != b""


class Pipe(PipeReader):
    """A new pipe: another process writes, this one reads."""

    def __init__(self, end: bytes) -> None:
        """`end` ends each piece."""
        reads, self.writes = os.pipe()
        super().__init__(reads, end)
