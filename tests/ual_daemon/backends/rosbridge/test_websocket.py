"""The socket of a connection: used by one thread at a time, and never after it was closed."""

from __future__ import annotations

import select
import socket
import ssl
from collections.abc import Callable, Iterator

import pytest
from typing_extensions import override
from websockets.protocol import State

from ual_daemon.backends.rosbridge import parse_url
from ual_daemon.backends.rosbridge.websocket import WebSocket


class Watched(ssl.SSLSocket):
    """Has no TLS, but takes note of how it is used, and whether that is under the lock."""

    websocket: WebSocket | None = None
    used: list[tuple[str, bool]]

    def _use(self, what: str) -> None:
        if self.websocket is not None:
            self.used.append((what, self.websocket._lock.locked()))

    @override
    def send(self, data: object, flags: int = 0) -> int:
        self._use("send")
        return len(data)  # type: ignore[arg-type]

    @override
    def recv(self, buflen: int = 1024, flags: int = 0) -> bytes:
        self._use("recv")
        raise BlockingIOError

    @override
    def pending(self) -> int:
        self._use("pending")
        return 1

    @override
    def setsockopt(self, *_: object) -> None:
        self._use("setsockopt")

    @override
    def close(self) -> None:
        self._use("close")


@pytest.fixture
def watched() -> Iterator[Watched]:
    sock = Watched.__new__(Watched)
    socket.socket.__init__(sock)
    sock.used = []
    yield sock
    socket.socket.close(sock)


@pytest.fixture
def websocket(watched: Watched) -> WebSocket:
    websocket = watched.websocket = WebSocket(watched, parse_url("rosbridges://127.0.0.1:1"))
    websocket._protocol.state = State.OPEN
    return websocket


END = {"close": WebSocket.close, "abort": WebSocket.abort}


@pytest.mark.parametrize("end", END.values(), ids=END)
def test_the_socket_is_used_by_one_thread_at_a_time(
    websocket: WebSocket, watched: Watched, end: Callable[[WebSocket], None]
) -> None:
    """A socket with TLS that another thread closes sends unencrypted for a moment before its descriptor is closed."""
    websocket.receive(0.0)
    websocket.send(b"1")
    websocket.ping()
    end(websocket)
    assert {what for what, _ in watched.used} >= {"pending", "recv", "send", "close"}
    assert all(is_locked for _, is_locked in watched.used)


@pytest.mark.parametrize("end", END.values(), ids=END)
@pytest.mark.parametrize(
    "use",
    [
        lambda it: it.send(b"1"),
        lambda it: it.send(b"1", is_perishable=True),
        lambda it: it.receive(0.0),
    ],
    ids=["send", "send what is perishable", "receive"],
)
def test_a_connection_that_is_closed_is_lost_and_its_socket_is_not_used(
    websocket: WebSocket, watched: Watched, end: Callable[[WebSocket], None], use: Callable[[WebSocket], object]
) -> None:
    end(websocket)
    watched.used.clear()
    with pytest.raises(ConnectionError):
        use(websocket)
    websocket.ping()
    websocket.close()
    websocket.abort()
    assert watched.used == []


def test_what_is_sent_during_an_abort_does_not_leave() -> None:
    """Over a real socket: the other side gets nothing after it."""
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setblocking(False)
        websocket = WebSocket(ours, parse_url("rosbridge://127.0.0.1:1"))
        websocket._protocol.state = State.OPEN
        websocket.abort()
        with pytest.raises(ConnectionError):
            websocket.send(b"1")
        assert select.select([theirs], [], [], 10.0)[0]
        assert theirs.recv(65536).startswith(b"GET ")
        assert theirs.recv(65536) == b""
