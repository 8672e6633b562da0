"""HTTP/2 by hand (RFC 9113), for callers that do what no client of gRPC does: frames, and a socket that sends them."""

from __future__ import annotations

import socket
import struct
from contextlib import suppress
from select import select

DATA, HEADERS, RST_STREAM, SETTINGS, PING, WINDOW_UPDATE, CONTINUATION = 0x0, 0x1, 0x3, 0x4, 0x6, 0x8, 0x9
END_STREAM, ACK, END_HEADERS = 0x1, 0x1, 0x4
CANCEL = struct.pack(">I", 0x8)
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
CONNECT_S = 5.0
_WAIT_S = 0.2
_HEADER_BYTES = 9


def frame(kind: int, flags: int = 0, stream: int = 0, payload: bytes = b"") -> bytes:
    """Returns one frame."""
    return struct.pack(">I", len(payload))[1:] + bytes((kind, flags)) + struct.pack(">I", stream) + payload


def literals(values: dict[bytes, bytes]) -> bytes:
    """Returns a block of headers (HPACK), all as literals: it means the same on each connection, however often."""
    return b"".join(b"\0" + _text(name) + _text(value) for name, value in values.items())


def request(method: str) -> bytes:
    """Returns the headers of a call of ``/package.Service/Method``."""
    return literals(
        {
            b":method": b"POST",
            b":scheme": b"http",
            b":path": method.encode(),
            b":authority": b"localhost",
            b"te": b"trailers",
            b"content-type": b"application/grpc",
        }
    )


def _text(text: bytes) -> bytes:
    # A length of 7 bits, the first of which says that more follows.
    if len(text) < 127:
        return bytes((len(text),)) + text
    left, size = len(text) - 127, b"\x7f"
    while left >= 128:
        left, size = left >> 7, size + bytes((left & 127 | 128,))
    return size + bytes((left,)) + text


def reset(connection: socket.socket) -> None:
    """Closes the connection at once (TCP RST): it leaves no port behind that waits (TIME_WAIT)."""
    with suppress(OSError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    connection.close()


class Http2Peer:
    """One connection that has begun to speak HTTP/2. It throws away what it receives, but answers pings."""

    def __init__(self, host: str, port: int, limit_s: float = CONNECT_S) -> None:
        self._socket = socket.create_connection((host, port), limit_s)
        self._socket.setblocking(False)
        self._received = b""
        self.is_open = self.send(PREFACE + frame(SETTINGS))

    def fileno(self) -> int:
        """Returns the socket's number, for `select`."""
        return self._socket.fileno()

    def send(self, data: bytes) -> bool:
        """Sends all of it, and receives meanwhile. Returns False if the other end has closed the connection."""
        view = memoryview(data)
        try:
            while view:
                readable, writable, _ = select((self._socket,), (self._socket,), (), _WAIT_S)
                if readable:
                    self._receive()
                if writable:
                    view = view[self._socket.send(view) :]
                if not (readable or writable):
                    return False  # it does not read any more
        except OSError:
            return False
        return True

    def answer(self) -> bool:
        """Receives what is there, and answers pings. Returns False if the other end has closed the connection."""
        try:
            pings = self._receive()
        except OSError:
            return False
        return self.send(b"".join(frame(PING, ACK, 0, ping) for ping in pings)) if pings else True

    def close(self) -> None:
        """Closes the connection at once."""
        reset(self._socket)

    def _receive(self) -> list[bytes]:
        """Returns the pings."""
        pings = []
        with suppress(BlockingIOError):
            received = self._socket.recv(1 << 16)
            if not received:
                raise ConnectionResetError
            self._received += received
        while (size := self._next_bytes()) <= len(self._received):
            kind, flags = self._received[3], self._received[4]
            if kind == PING and not flags & ACK:
                pings.append(self._received[_HEADER_BYTES:size])
            self._received = self._received[size:]
        return pings

    def _next_bytes(self) -> int:
        return _HEADER_BYTES + int.from_bytes(self._received[:3], "big")
