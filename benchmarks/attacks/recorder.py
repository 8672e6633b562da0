"""Arrival times of datagrams at a socket, by the system's own clock: a process that reads late does not falsify
them.
"""

from __future__ import annotations

import socket
import struct
import time

_RECEIVE_BUFFER = 4 << 20
_TIMESTAMPS = 35
"""SO_TIMESTAMPNS of Linux, which Python does not name. Also the type of the message that brings the time."""
_TIME = struct.Struct("qq")
_BYTES = 65536


def socket_with_times() -> socket.socket:
    """Returns a UDP socket of this computer that does not block, for `receive`."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
    made.setsockopt(socket.SOL_SOCKET, _TIMESTAMPS, 1)
    made.bind(("127.0.0.1", 0))
    made.setblocking(False)
    return made


def receive(from_socket: socket.socket) -> tuple[bytes, tuple[str, int], int]:
    """Returns the next datagram, its sender, and when it came, in ns of the monotonic clock.

    Raises:
        BlockingIOError: There is none.

    """
    data, ancillary, _, address = from_socket.recvmsg(_BYTES, 64)
    for level, kind, content in ancillary:
        if level == socket.SOL_SOCKET and kind == _TIMESTAMPS:
            seconds, nanoseconds = _TIME.unpack_from(content)
            return data, address, seconds * 10**9 + nanoseconds + time.monotonic_ns() - time.time_ns()
    return data, address, time.monotonic_ns()
