"""What the kernel does for a listening socket, where gRPC has no option for it."""

from __future__ import annotations

import os
import socket
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_DEFER_S = 5
"""How long the kernel waits for the first bytes of a caller before it hands its connection over all the same."""
_DESCRIPTORS = Path("/proc/self/fd")


def defer_accept(address: str, port: int) -> None:
    """Lets the kernel hold connections to a TCP port of this process until their caller has sent something.

    Each client of gRPC sends at once. Connections that are closed before, as in a flood of them, never reach gRPC: it
    accepts as long as there are new ones, and reads nothing meanwhile. Does nothing for a unix socket, and where the
    system cannot.
    """
    option = getattr(socket, "TCP_DEFER_ACCEPT", None)
    if option is None or address.startswith("unix:"):
        return
    for listening in _listening(port):
        with suppress(OSError):
            listening.setsockopt(socket.IPPROTO_TCP, option, _DEFER_S)


def _listening(port: int) -> Iterator[socket.socket]:
    """Yields this process's listening sockets of the port, each until the next is asked for."""
    for descriptor in _sockets():
        with suppress(OSError), socket.socket(fileno=os.dup(descriptor)) as each:
            is_internet = each.family in (socket.AF_INET, socket.AF_INET6) and each.type == socket.SOCK_STREAM
            if (
                is_internet
                and each.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
                and each.getsockname()[1] == port
            ):
                yield each


def _sockets() -> Iterator[int]:
    with suppress(OSError):  # no /proc
        for entry in _DESCRIPTORS.iterdir():
            with suppress(OSError):  # closed meanwhile
                if stat.S_ISSOCK(os.fstat(int(entry.name)).st_mode):
                    yield int(entry.name)
