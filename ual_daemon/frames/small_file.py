"""Small files of this user, in a directory into which others may write, too."""

from __future__ import annotations

import os
import stat
from pathlib import Path

_LONGEST_FILE_BYTES = 4096


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
        text = os.read(handle, _LONGEST_FILE_BYTES + 1)
    finally:
        os.close(handle)
    if len(text) > _LONGEST_FILE_BYTES:
        raise ValueError("too long")
    return text
