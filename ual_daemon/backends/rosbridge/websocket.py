"""One connection: a WebSocket that never blocks. Its protocol is that of `websockets`, its socket is ours."""

from __future__ import annotations

import contextlib
import errno
import os
import select
import socket
import ssl
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

from typing_extensions import override
from websockets.client import ClientProtocol
from websockets.exceptions import WebSocketException
from websockets.frames import Frame, Opcode
from websockets.http11 import Response
from websockets.protocol import State
from websockets.uri import parse_uri

from ual_daemon.backends import tcp
from ual_daemon.backends.hosts import Host
from ual_daemon.backends.rosbridge.url import BridgeUrl

_CONNECT_S = 3.0
_SLICE_S = 0.05
_RECEIVED_BATCH_BYTES = 65536
_SEND_BUFFER_BYTES = 16384
"""Small, so that setpoints that a stalled bridge does not read are dropped here instead of being flown later."""
_LARGEST_MESSAGE_BYTES = 16_000_000


class BridgeTransport(ABC):
    """A connection to a bridge. Any thread may send; one thread receives."""

    @abstractmethod
    def receive(self, timeout_s: float) -> Sequence[str | bytes]:
        """Returns the messages that have come, after waiting for the first one.

        Raises:
            OSError: The connection is lost.
        """

    @abstractmethod
    def send(self, text: bytes, *, is_perishable: bool = False) -> bool:
        """Sends a message. Returns False if it is perishable and earlier ones have not left yet: it is not sent.

        Raises:
            OSError: The connection is lost.
        """

    @abstractmethod
    def ping(self) -> None:
        """Asks for a sign of life; `received_count` then shows it."""

    @property
    @abstractmethod
    def received_count(self) -> int:
        """A number that changes with everything that comes, also with answers to `ping`."""

    @abstractmethod
    def close(self) -> None:
        """Closes it, without waiting."""

    def abort(self) -> None:
        """Gives it up: what has not reached the other computer is discarded."""
        self.close()


Dial = Callable[[BridgeUrl, Callable[[], None]], BridgeTransport]
"""Connects, and calls the given function at least every 0.1 s meanwhile, which may raise to give up.

Raises OSError if there is no connection.
"""


def dial(url: BridgeUrl, on_wait: Callable[[], None]) -> BridgeTransport:
    """Connects by TCP, TLS where the URL has it, and WebSocket. See `Dial`."""
    family, address = Host(url.host, url.port, socket.SOCK_STREAM, OSError).address()
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        return _opened(sock, address, url, on_wait)
    except ssl.SSLError as error:
        sock.close()
        raise ConnectionError(f"no TLS with {url}: {error.reason or error}") from error
    except BaseException:
        sock.close()
        raise


def _opened(
    sock: socket.socket, address: tuple[object, ...], url: BridgeUrl, on_wait: Callable[[], None]
) -> BridgeTransport:
    wait = _SocketWait(url, on_wait)
    sock.setblocking(False)
    tcp.prepare(sock)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
    code = sock.connect_ex(address)
    while code in (errno.EINPROGRESS, errno.EALREADY, errno.EWOULDBLOCK):
        wait(sock, select.POLLOUT)
        code = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if code:
        why = "nobody listens there" if code == errno.ECONNREFUSED else os.strerror(code)
        raise OSError(code, f"cannot connect to {url}: {why}")
    if url.has_tls:
        sock = _secured(sock, url, wait)
    websocket = WebSocket(sock, url)
    while not websocket.is_open:
        wait(sock, select.POLLIN)
        websocket.receive(0.0)
    return websocket


class _SocketWait:
    """Waits for a socket in slices, with a limit for all of them."""

    def __init__(self, url: BridgeUrl, on_wait: Callable[[], None]) -> None:
        self._url = url
        self._on_wait = on_wait
        self._ends_s = time.monotonic() + _CONNECT_S

    def __call__(self, sock: socket.socket, events: int) -> None:
        """Blocks until the socket is ready.

        Raises:
            TimeoutError: It took too long.
        """
        while not _poll(sock, events, _SLICE_S):
            self._on_wait()
            if time.monotonic() > self._ends_s:
                raise TimeoutError(f"{self._url} does not answer")


def _secured(sock: socket.socket, url: BridgeUrl, wait: _SocketWait) -> socket.socket:
    """Returns the socket with TLS. The certificate must be that of the host (SSL_CERT_FILE adds authorities)."""
    secured = ssl.create_default_context().wrap_socket(sock, server_hostname=url.host, do_handshake_on_connect=False)
    while True:
        try:
            secured.do_handshake()
        except ssl.SSLWantReadError:
            wait(secured, select.POLLIN)
        except ssl.SSLWantWriteError:
            wait(secured, select.POLLOUT)
        else:
            return secured


def _poll(sock: socket.socket, events: int, timeout_s: float) -> bool:
    poller = select.poll()
    poller.register(sock, events)
    return bool(poller.poll(timeout_s * 1000.0))


class WebSocket(BridgeTransport):
    """See `BridgeTransport`."""

    def __init__(self, sock: socket.socket, url: BridgeUrl) -> None:
        self._socket = sock
        self._url = url
        self._protocol = ClientProtocol(parse_uri(url.websocket), max_size=_LARGEST_MESSAGE_BYTES)
        self._lock = threading.Lock()
        """Held whenever the socket is used, closed included: one with TLS that is closed sends unencrypted for a moment
        before its descriptor is. Nothing that blocks is done under it.
        """
        self._is_closed = False
        self._out = bytearray()
        self._received = 0
        self._parts: list[bytes] = []
        self._is_text = True
        with self._lock:
            self._protocol.send_request(self._protocol.connect())
            self._flush()

    @property
    def is_open(self) -> bool:
        """Whether both sides have agreed to speak WebSocket."""
        return self._protocol.state is State.OPEN

    @property
    @override
    def received_count(self) -> int:
        return self._received

    @override
    def receive(self, timeout_s: float) -> Sequence[str | bytes]:
        if not self._has_pending() and not _poll(self._socket, select.POLLIN, timeout_s):
            self._flush_rest()
            return ()
        with self._lock:
            self._read()
            self._flush()
            events = self._protocol.events_received()
            self._check()
        return [message for event in events if (message := self._message(event)) is not None]

    @override
    def send(self, text: bytes, *, is_perishable: bool = False) -> bool:
        with self._lock:
            if is_perishable and self._out:
                self._flush()
            if is_perishable and self._out:
                return False
            if self._protocol.state is not State.OPEN:
                raise ConnectionError(f"{self._url} closed the connection")
            self._require_open()
            self._protocol.send_text(text)
            self._flush()
        return True

    @override
    def ping(self) -> None:
        with self._lock:
            if not self._is_closed and self._protocol.state is State.OPEN and not self._out:
                self._protocol.send_ping(b"ual")
                self._flush()

    @override
    def close(self) -> None:
        with self._lock:
            if self._is_closed:
                return
            with contextlib.suppress(OSError, WebSocketException):
                if self._protocol.state is State.OPEN:
                    self._protocol.send_close(1000)
                    self._flush()
            self._is_closed = True
            self._socket.close()

    @override
    def abort(self) -> None:
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
            tcp.discard(self._socket)

    def _require_open(self) -> None:
        if self._is_closed:
            raise ConnectionError(f"the connection to {self._url} is closed")

    def _has_pending(self) -> bool:
        with self._lock:
            self._require_open()
            return isinstance(self._socket, ssl.SSLSocket) and self._socket.pending() > 0

    def _flush_rest(self) -> None:
        with self._lock:
            self._flush()

    def _read(self) -> None:
        try:
            data = self._socket.recv(_RECEIVED_BATCH_BYTES)
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            return
        self._received += 1
        if data:
            self._protocol.receive_data(data)
        else:
            self._protocol.receive_eof()

    def _flush(self) -> None:
        """Sends as much as the socket takes."""
        self._require_open()
        self._out += b"".join(self._protocol.data_to_send())
        try:
            while self._out:
                del self._out[: self._socket.send(self._out)]
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            return

    def _check(self) -> None:
        if self._protocol.handshake_exc is not None:
            raise ConnectionError(f"{self._url} is no rosbridge: {self._protocol.handshake_exc}")
        if self._protocol.state in (State.CLOSING, State.CLOSED):
            raise ConnectionResetError(f"{self._url} closed the connection")

    def _message(self, event: object) -> str | bytes | None:
        """Returns the message that an event completes."""
        if isinstance(event, Response) or not isinstance(event, Frame):
            return None
        if event.opcode in (Opcode.TEXT, Opcode.BINARY):
            self._parts, self._is_text = [bytes(event.data)], event.opcode is Opcode.TEXT
        elif event.opcode is Opcode.CONT:
            self._parts.append(bytes(event.data))
        else:
            return None
        if not event.fin:
            return None
        whole = b"".join(self._parts)
        return whole.decode("utf-8", "replace") if self._is_text else whole
