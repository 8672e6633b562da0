"""The logs that the autopilot has written of its flights. As values, from ``logs.proto``.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass

from ual.contract._bases import LogChunkBase


@dataclass(frozen=True, slots=True)
class Log:
    """A log of the autopilot.

    Args:
        id: The autopilot's own name or number of it, such as ``2026-11-25/13_22_11.ulg`` or ``7``.
        size_bytes: How long it was when it was listed. One that is being written grows.
        time_s: When it was written, in UTC since 1970. None where the autopilot does not say: PX4 without a satellite
            fix does not know the time.
        is_missing: The autopilot has it, but has not described it on request: size and time are not known. List again.

    """

    id: str
    size_bytes: int
    time_s: float | None = None
    is_missing: bool = False


@dataclass(frozen=True, slots=True)
class LogChunk(LogChunkBase):
    """A piece of a log.

    Args:
        log: As it was listed when the download began. The download ends at its size.
        offset: Where the piece begins, in bytes.
        data: The bytes.
        sha256: In the last piece: the SHA-256 of all bytes of this download, in hexadecimal; else empty.

    """

    log: Log
    offset: int
    data: bytes
    sha256: str = ""
