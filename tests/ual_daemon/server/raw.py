"""Calls by hand, for what no client of gRPC sends."""

from __future__ import annotations

import socket
import struct

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
