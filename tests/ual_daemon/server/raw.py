"""Calls by hand, for what no client of gRPC sends."""

from __future__ import annotations

import socket
import struct

from typing_extensions import Self

from tests.waiting import LIMIT_S


def http2(kind: int, flags: int, stream: int, payload: bytes) -> bytes:
    return struct.pack(">I", len(payload))[1:] + bytes((kind, flags)) + struct.pack(">I", stream) + payload


def headers(values: dict[bytes, bytes]) -> bytes:
    """As literals."""
    return b"".join(b"\0" + bytes((len(name),)) + name + bytes((len(value),)) + value for name, value in values.items())


REQUEST = {
    b":method": b"POST",
    b":scheme": b"http",
    b":path": b"/a.B/C",
    b":authority": b"a",
    b"te": b"trailers",
    b"content-type": b"application/grpc",
}
RESET = http2(3, 0, 1, bytes(4))[:-4]
"""The header of the frame by which a server ends a call without a status; grpcio 1.76 so ends some that are damaged."""
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + http2(4, 0, 0, b"")


def answer_to(address: str, values: dict[bytes, bytes]) -> bytes:
    """Returns the answer to a call with these headers, up to its status, or its reset."""
    host, _, port = address.partition(":")
    with socket.create_connection((host, int(port)), LIMIT_S) as caller:
        block = headers({**REQUEST, **values})
        parts = [block[begin : begin + 16000] for begin in range(0, len(block), 16000)]
        frames = [
            http2(9 if number else 1, 4 * (number == len(parts) - 1), 1, part) for number, part in enumerate(parts)
        ]
        caller.sendall(PREFACE + b"".join(frames) + http2(0, 1, 1, bytes(5)))
        answer = b""
        while not (b"grpc-status" in answer and b"grpc-message" in answer) and RESET not in answer:
            received = caller.recv(4096)
            assert received
            answer += received
    return answer


def requests(path: str, stream: int, *messages: bytes) -> bytes:
    """Returns the frames of a call with these messages, after which more may come."""
    block = headers({**REQUEST, b":path": path.encode()})
    data = (http2(0, 0, stream, b"\0" + struct.pack(">I", len(each)) + each) for each in messages)
    return http2(1, 4, stream, block) + b"".join(data)


def end(stream: int) -> bytes:
    """Returns the frame after which no message comes."""
    return http2(0, 1, stream, b"")


def give_up(stream: int) -> bytes:
    """Returns the frame by which a caller gives up a call."""
    return http2(3, 0, stream, struct.pack(">I", 8))


class Caller:
    """A connection to a server."""

    def __init__(self, address: str) -> None:
        host, _, port = address.partition(":")
        self._socket = socket.create_connection((host, int(port)), LIMIT_S)
        self._received = self._socket.makefile("rb")
        self._pings_count = 0
        self._socket.sendall(PREFACE)

    def send(self, frames: bytes) -> None:
        """Sends frames. Returns when the server's core has read them, whatever its callbacks do meanwhile."""
        self._pings_count += 1
        mark = struct.pack(">Q", self._pings_count)
        self._socket.sendall(frames + http2(6, 0, 0, mark))
        while True:
            head = self._received.read(9)
            payload = self._received.read(int.from_bytes(head[:3], "big"))
            if head[3:5] == b"\6\1" and payload == mark:
                return

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._received.close()
        self._socket.close()
