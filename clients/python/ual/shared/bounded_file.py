"""Reads the files that a user names. A device or a pipe without an end must not keep the program waiting."""

from __future__ import annotations

import os
import stat
from pathlib import Path

LARGEST_FILE_BYTES = 1 << 20
_WITHOUT_WAITING = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
"""Protects against a write into a pipe. Windows has no such flags."""


def read(path: Path) -> bytes:
    """Returns the content of a regular file of at most `LARGEST_FILE_BYTES`.

    Raises:
        OSError: It cannot be read, is not a regular file, or is longer; `strerror` says which.

    """
    with os.fdopen(os.open(path, _WITHOUT_WAITING), "rb") as file:
        mode = os.fstat(file.fileno()).st_mode
        if stat.S_ISDIR(mode):
            raise IsADirectoryError(0, "it is a directory")
        if not stat.S_ISREG(mode):
            raise OSError(0, "it is not a regular file (a device or a pipe)")
        data = file.read(LARGEST_FILE_BYTES + 1)
    if len(data) > LARGEST_FILE_BYTES:
        raise OSError(0, f"it is longer than {LARGEST_FILE_BYTES} bytes")
    return data
