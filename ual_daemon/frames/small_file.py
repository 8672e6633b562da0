"""Small files that a daemon keeps for its next start, in a directory into which others may write, too."""

from __future__ import annotations

import os
import stat
from pathlib import Path

_LONGEST_FILE = 4096
_READABLE = 0o644
_OWN = 0o600


def read_own(path: Path) -> bytes:
    """Reads a file of this user. All users of the computer may put files into the directory: one of another user's
    could lead the UAV anywhere.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise ValueError("not a regular file")
        if found.st_uid != os.geteuid():
            raise ValueError("a file of another user")
        text = os.read(handle, _LONGEST_FILE + 1)
    finally:
        os.close(handle)
    if len(text) > _LONGEST_FILE:
        raise ValueError("too long")
    return text


def replace(path: Path, text: str, *, is_durable: bool = False) -> None:
    """Writes a file. A reader sees the old one or the new one, never a part of one.

    `is_durable`: the new one is on the disk once this returns, so that a loss of power does not bring the old one back.
    """
    # The name cannot be guessed: other users may write in this directory, too.
    unfinished = path.with_name(f"{path.name}.{os.urandom(8).hex()}.tmp")
    handle = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, _OWN)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            os.fchmod(handle, _READABLE)
            stream.write(text)
            if is_durable:
                stream.flush()
                os.fsync(handle)
        unfinished.replace(path)
        if is_durable:
            _sync(path.parent)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise


def _sync(directory: Path) -> None:
    """Has the names of a directory written to the disk."""
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
