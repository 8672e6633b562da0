"""Writes files that only their owner may read."""

from __future__ import annotations

import os
from pathlib import Path

_OWN = 0o600
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)


def replace(path: Path, data: bytes, mode: int = _OWN) -> None:
    """Writes a file in one step: a reader sees the old content or the new one.

    Raises:
        OSError: It cannot be written.

    """
    path = path.resolve()  # a link stays one
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        create(beside, data, mode)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def create(path: Path, data: bytes, mode: int = _OWN) -> None:
    """Writes a file that must not be there yet.

    Raises:
        OSError: It is there, or cannot be written.

    """
    with os.fdopen(os.open(path, _NEW, mode), "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
