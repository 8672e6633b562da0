"""Socket options of listening sockets that gRPC cannot set."""

from __future__ import annotations

import os
import socket
import stat
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path

_DEFER_S = 5
"""Seconds for which the kernel waits for a caller's first bytes before it hands its connection over all the same."""
_DESCRIPTORS = Path("/proc/self/fd")


class Deferral:
    """Lets the kernel hold connections to TCP ports of this process until their caller has sent something.

    Each client of gRPC sends at once. Connections that are closed before, as in a flood of them, never reach gRPC: it
    accepts as long as there are new ones, and reads nothing meanwhile. Does nothing for a unix socket, and where the
    system cannot.

    The servers of a process share one. Its open files are looked at once for all ports that were added since the last
    time. A fleet that looked at them for each port would need minutes to start.
    """

    def __init__(self) -> None:
        self._ports: set[int] = set()

    def add(self, address: str, port: int) -> None:
        """Takes note of a port that was opened."""
        if not address.startswith("unix:"):
            self._ports.add(port)

    def apply(self) -> None:
        """Applies it to what was added since the last time."""
        option = getattr(socket, "TCP_DEFER_ACCEPT", None)
        if self._ports and option is not None:
            for listening in _listening(self._ports):
                with suppress(OSError):
                    listening.setsockopt(socket.IPPROTO_TCP, option, _DEFER_S)
        self._ports.clear()


def _listening(ports: Collection[int]) -> Iterator[socket.socket]:
    """Yields this process's listening sockets of the ports, each until the next is requested."""
    for descriptor in _sockets():
        with suppress(OSError), socket.socket(fileno=os.dup(descriptor)) as each:
            is_internet = each.family in (socket.AF_INET, socket.AF_INET6) and each.type == socket.SOCK_STREAM
            if (
                is_internet
                and each.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
                and each.getsockname()[1] in ports
            ):
                yield each


def _sockets() -> Iterator[int]:
    with suppress(OSError):  # no /proc
        for entry in _DESCRIPTORS.iterdir():
            with suppress(OSError):  # closed meanwhile
                if stat.S_ISSOCK(os.fstat(int(entry.name)).st_mode):
                    yield int(entry.name)
