"""A file that is being written, looked for under its name: it may have been removed, moved or replaced meanwhile."""

from __future__ import annotations

import os
from pathlib import Path

_ROOT_USER_ID = 0


def identity_of(path: Path) -> tuple[int, int, int] | None:
    """Returns the device, the inode and the time of change of what is at a path; None where nothing can be found.

    The inode of a file that was removed is soon another one's.
    """
    try:
        found = path.lstat()
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_mtime_ns


def loss_of(path: Path, file: int) -> str:
    """Returns what has become of an open file that was at a path, human-readable; empty if it is there."""
    own = os.fstat(file)
    try:
        found = path.lstat()
    except OSError as error:
        if own.st_nlink:
            return f"was moved, or cannot be reached: {error.strerror}"
        return "was removed"
    if (found.st_dev, found.st_ino) == (own.st_dev, own.st_ino):
        return ""
    return "was replaced" if not own.st_nlink else "was moved and replaced"


def has_space(file: int, size_bytes: int) -> bool:
    """Returns whether the disk of an open file has so much space left for this process, as far as it says so."""
    try:
        disk = os.fstatvfs(file)
    except OSError:
        return True  # a write tells
    left = disk.f_bfree if os.geteuid() == _ROOT_USER_ID else disk.f_bavail
    return not disk.f_blocks or left * disk.f_frsize >= size_bytes
