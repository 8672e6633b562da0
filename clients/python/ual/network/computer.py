"""Identifier of this computer: programs that share a loopback address have the same one."""

from __future__ import annotations

import hashlib
import os
import socket
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

_ID_DIGITS = 16


def host() -> str:
    """Returns this computer's name."""
    return socket.gethostname()


@lru_cache(maxsize=1)
def identifier() -> str:
    """Returns the identifier: of this start of the computer, and of the network namespace (a container has its own)."""
    parts = [host()]
    with suppress(OSError):
        parts.append(Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip())
    with suppress(OSError):
        parts.append(str(os.stat("/proc/self/ns/net").st_ino))  # noqa: PTH116 (follows the link, as it should)
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:_ID_DIGITS]
