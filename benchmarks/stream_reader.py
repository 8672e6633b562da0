"""Reads many streams of telemetry at little cost: as the subscribers on other computers, whose processors are not ours.

    python -m benchmarks.stream_reader RATE_HZ    # a child: see `benchmarks.children`

Speaks the little HTTP/2 that one stream on a connection needs (RFC 9113), without a gRPC library. A message costs 10 to
20 µs instead of 150, so that one process reads 500 streams beside the daemon that it measures.
"""

from __future__ import annotations

import selectors
import socket
import struct
import sys
import time
from collections.abc import Iterator
from typing import Any

from benchmarks.children import serve
from ual.v1 import ual_pb2 as pb

_PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
_DATA, _HEADERS, _RESET, _SETTINGS, _PING, _GO_AWAY, _WINDOW_UPDATE = 0, 1, 3, 4, 6, 7, 8
_ACK = _END_STREAM = 0x1
_END_HEADERS = 0x4
_WINDOW = (1 << 31) - 1
_FIRST_WINDOW = (1 << 16) - 1
_PATH = b"/ual.v1.UalService/StreamTelemetry"


def _frame(kind: int, flags: int, stream: int, payload: bytes = b"") -> bytes:
    return struct.pack(">I", len(payload))[1:] + struct.pack(">BBI", kind, flags, stream) + payload


def _text(text: bytes) -> bytes:
    return bytes((len(text),)) + text


def _request(rate_hz: float) -> bytes:
    """Returns all that a client sends: windows that never fill, the headers (RFC 7541, no compression), the request."""
    headers = b"\x83\x86\x04" + _text(_PATH) + b"\x01" + _text(b"localhost")
    headers += b"\x00" + _text(b"te") + _text(b"trailers")
    headers += b"\x00" + _text(b"content-type") + _text(b"application/grpc")
    message = pb.StreamTelemetryRequest(rate_hz=rate_hz).SerializeToString()
    return b"".join(
        (
            _PREFACE,
            _frame(_SETTINGS, 0, 0, struct.pack(">HI", 4, _WINDOW)),
            _frame(_WINDOW_UPDATE, 0, 0, struct.pack(">I", _WINDOW - _FIRST_WINDOW)),
            _frame(_HEADERS, _END_HEADERS, 1, headers),
            _frame(_DATA, _END_STREAM, 1, struct.pack(">BI", 0, len(message)) + message),
        )
    )


class Stream:
    """One stream of telemetry, over a connection of its own."""

    def __init__(self, path: str, rate_hz: float) -> None:
        """`path` is that of the unix socket."""
        self.count = 0
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(path)
        self.socket.sendall(_request(rate_hz))
        self.socket.setblocking(False)
        self._frames = self._messages = b""

    def read(self) -> None:
        """Counts the messages that have come.

        Raises:
            EOFError: The stream has ended.

        """
        received = self.socket.recv(1 << 16)
        self._frames += received
        for kind, flags, payload in self._whole_frames():
            if kind == _DATA:
                self._count(payload)
            elif kind in (_PING, _SETTINGS) and not flags & _ACK:
                self.socket.sendall(_frame(kind, _ACK, 0, payload if kind == _PING else b""))
            elif kind in (_RESET, _GO_AWAY) or (kind == _HEADERS and flags & _END_STREAM):
                raise EOFError("the daemon has ended a stream")
        if not received:
            raise EOFError("the daemon has closed a connection")

    def _whole_frames(self) -> Iterator[tuple[int, int, bytes]]:
        data, begin = self._frames, 0
        while len(data) - begin >= 9:
            end = begin + 9 + int.from_bytes(data[begin : begin + 3], "big")
            if end > len(data):
                break
            yield data[begin + 3], data[begin + 4], data[begin + 9 : end]
            begin = end
        self._frames = data[begin:]

    def _count(self, payload: bytes) -> None:
        self._messages += payload
        while len(self._messages) >= 5:
            end = 5 + int.from_bytes(self._messages[1:5], "big")
            if end > len(self._messages):
                return
            self._messages = self._messages[end:]
            self.count += 1


class Streams:
    """Answers of the child: ``open`` streams, ``read`` them for a while and tell how many messages each had."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._streams: list[Stream] = []
        self._selector = selectors.DefaultSelector()

    def handle(self, asked: dict[str, Any]) -> dict[str, Any]:
        if asked["do"] == "open":
            self._streams = [Stream(path, self._rate_hz) for path in asked["paths"]]
            for stream in self._streams:
                self._selector.register(stream.socket, selectors.EVENT_READ, stream)
            return {}
        before = [stream.count for stream in self._streams]
        begin_s = time.monotonic()
        self._read_until(begin_s + asked["duration_s"])
        passed_s = time.monotonic() - begin_s
        return {
            "rates_hz": [(stream.count - old) / passed_s for stream, old in zip(self._streams, before, strict=True)]
        }

    def _read_until(self, end_s: float) -> None:
        while (left_s := end_s - time.monotonic()) > 0.0:
            for key, _ in self._selector.select(left_s):
                key.data.read()


if __name__ == "__main__":
    serve(Streams(float(sys.argv[1])).handle)
