"""The ends of links: in memory, UDP, TCP. They never block."""

from __future__ import annotations

import contextlib
import socket
from abc import ABC, abstractmethod
from collections import deque

Address = tuple[str, int]
_QUEUE_BYTES = 65536
_READ_BYTES = 65536


class Port(ABC):
    """One link of an autopilot. `is_stream`: bytes come in pieces of any size. `sessions_count` counts connections."""

    is_stream = False
    sessions_count = 0

    @abstractmethod
    def receive(self, now_s: float) -> list[bytes]:
        """Returns the bytes that have come."""

    @abstractmethod
    def send(self, data: bytes, now_s: float) -> None:
        """Sends a frame; drops it if there is no peer."""

    def descriptors(self) -> list[int]:
        """The file to wait for."""
        return []

    def restart(self) -> None:  # noqa: B027 - only connections can close
        """Closes connections, as the autopilot does when it boots."""

    def close(self) -> None:  # noqa: B027 - only sockets must be closed
        """Closes the link."""


class MemoryPort(Port):
    """A link without sockets, for stepped time. The autopilot writes to `sent` and reads from `arriving`."""

    def __init__(self) -> None:
        self.sent: deque[tuple[float, bytes]] = deque()
        self.arriving: deque[bytes] = deque()

    def receive(self, now_s: float) -> list[bytes]:
        found = list(self.arriving)
        self.arriving.clear()
        return found

    def send(self, data: bytes, now_s: float) -> None:
        self.sent.append((now_s, data))


class UdpPort(Port):
    """Listens at `local` (port 0: any) and sends to `remote`; if that is None, to the last sender."""

    def __init__(self, local: Address = ("127.0.0.1", 0), remote: Address | None = None) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(local)
        self.address: Address = self._socket.getsockname()
        self._remote = remote
        self._answers = remote is None

    def receive(self, now_s: float) -> list[bytes]:
        found = []
        with contextlib.suppress(BlockingIOError):
            while True:
                data, address = self._socket.recvfrom(_READ_BYTES)
                found.append(data)
                if self._answers:
                    self._remote = address
        return found

    def send(self, data: bytes, now_s: float) -> None:
        if self._remote is not None:
            with contextlib.suppress(BlockingIOError, ConnectionError):  # lost, as by a radio
                self._socket.sendto(data, self._remote)

    def descriptors(self) -> list[int]:
        return [self._socket.fileno()]

    def close(self) -> None:
        self._socket.close()


class TcpPort(Port):
    """Accepts one connection at `local` (port 0: any)."""

    is_stream = True

    def __init__(self, local: Address = ("127.0.0.1", 0)) -> None:
        self._server = socket.socket()
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._server.setblocking(False)
        self._server.bind(local)
        self._server.listen()
        self.address: Address = self._server.getsockname()
        self._client: socket.socket | None = None
        self._abandoned: list[socket.socket] = []
        self._rest = b""

    def receive(self, now_s: float) -> list[bytes]:
        if self._client is None:
            with contextlib.suppress(BlockingIOError):
                self._client, _ = self._server.accept()
                self._client.setblocking(False)
                self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._rest = b""
                self.sessions_count += 1
        if self._client is None:
            return []
        try:
            data = self._client.recv(_READ_BYTES)
        except BlockingIOError:
            return []
        except ConnectionError:
            data = b""
        if not data:
            self.restart()
            return []
        return [data]

    def send(self, data: bytes, now_s: float) -> None:
        if self._client is None or len(self._rest) > _QUEUE_BYTES:
            return
        self._rest += data
        try:
            self._rest = self._rest[self._client.send(self._rest) :]
        except BlockingIOError:
            pass
        except ConnectionError:
            self.restart()

    def descriptors(self) -> list[int]:
        return [(self._client or self._server).fileno()]

    def leave_half_open(self) -> None:
        """Stops without closing: the peer keeps a connection on which nothing happens any more."""
        if self._client is not None:
            self._abandoned.append(self._client)
            self._client = None

    def restart(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def close(self) -> None:
        self.restart()
        for each in self._abandoned:
            each.close()
        self._server.close()
