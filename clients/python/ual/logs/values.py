"""A log of the autopilot, and a piece of one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Log:
    """A log that the autopilot has written.

    Args:
        id: The autopilot's own name or number of it, such as ``2026-11-25/13_22_11.ulg`` or ``7``.
        size_bytes: How long it was when it was listed. One that is being written grows.
        time_s: When it was written, in UTC since 1970; None where the autopilot does not say. PX4 without a satellite
            fix does not know the time.
        is_missing: The autopilot has it, but has not described it when it was asked: `size_bytes` is 0, and not known.

    """

    id: str
    size_bytes: int
    time_s: float | None = None
    is_missing: bool = False


@dataclass(frozen=True, slots=True)
class LogChunk:
    """A piece of a log.

    Args:
        log: The log, as it was listed when the download began.
        offset: Where the piece begins, in bytes.
        data: The bytes.
        sha256: In the last piece: the SHA-256 of all bytes of this download, in hexadecimal; else empty.

    """

    log: Log
    offset: int
    data: bytes
    sha256: str = ""

    @property
    def end(self) -> int:
        """Where the next piece begins."""
        return self.offset + len(self.data)
