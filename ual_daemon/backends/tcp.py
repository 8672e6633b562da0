"""TCP connections that carry what flies: what a stalled one holds is dropped, and not delivered when it goes on."""

from __future__ import annotations

import contextlib
import socket
import struct

STALLED_CONNECTION_S = 0.5
"""Seconds without an acknowledgement of repeated data after which the system ends a connection (Linux): about 0.7 s
after the last sign of life. A command that it holds would else be executed when the network is there again, however
late. It takes TCP itself longer to recover from such an outage than to connect again.
"""
_USER_TIMEOUT = getattr(socket, "TCP_USER_TIMEOUT", None)
_DISCARD = struct.pack("ii", 1, 0)
"""SO_LINGER: on, for 0 s."""


def prepare(sock: socket.socket) -> None:
    """Has a socket send each message at once, and give up what the other computer does not acknowledge."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    if _USER_TIMEOUT is not None:
        sock.setsockopt(socket.IPPROTO_TCP, _USER_TIMEOUT, round(STALLED_CONNECTION_S * 1000.0))


def discard(sock: socket.socket) -> None:
    """Closes a socket. What has not reached the other computer never does; `close` alone goes on sending it."""
    with contextlib.suppress(OSError):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _DISCARD)
    sock.close()
