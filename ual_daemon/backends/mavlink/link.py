"""The link to the autopilot: a UDP socket that one thread waits on and any thread sends through."""

from __future__ import annotations

import contextlib
import logging
import select
import socket

from ual_daemon.backends.mavlink.settings import Endpoint

_log = logging.getLogger(__name__)

_DATAGRAM_SIZE = 65536
_BATCH = 64
"""Datagrams taken at once, so that a flood cannot keep the thread from its other work."""
_RECEIVE_BUFFER = 1 << 20

Address = tuple[str, int] | tuple[str, int, int, int]


class UdpLink:
    """Listens at, or calls, an endpoint. `send` and `wake` are for any thread, the rest for the one that receives.

    It holds system resources from the moment it is made until `close`.
    """

    def __init__(self, endpoint: Endpoint) -> None:
        self._endpoint = endpoint
        self._socket: socket.socket | None = None
        self._peer: Address | None = None
        self._waker, self._woken = socket.socketpair()
        self._waker.setblocking(False)
        self._woken.setblocking(False)
        self._poll = select.poll()
        self._poll.register(self._woken, select.POLLIN)
        self._is_sending_well = True

    def open(self) -> None:
        """Takes the port. Raises `OSError` whose message says what and why."""
        where = f"{self._endpoint.host}:{self._endpoint.port}"
        family, _, _, _, address = socket.getaddrinfo(self._endpoint.host, self._endpoint.port, type=socket.SOCK_DGRAM)[
            0
        ]
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER)
            if self._endpoint.is_listening:
                sock.bind(address)
            else:
                self._peer = address  # type: ignore[assignment]  # getaddrinfo's type has other families' addresses
        except OSError as error:
            sock.close()
            raise OSError(f"cannot listen at UDP {where}: {error.strerror}") from None
        self._poll.register(sock, select.POLLIN)
        self._socket = sock

    def close(self) -> None:
        """Gives the port back. Nothing is sent or received any more."""
        sock, self._socket = self._socket, None
        if sock is not None:
            self._poll.unregister(sock)
            sock.close()
        self._poll.unregister(self._woken)
        self._waker.close()
        self._woken.close()

    @property
    def is_open(self) -> bool:
        return self._socket is not None

    @property
    def peer(self) -> Address | None:
        """Whom we send to; None until known."""
        return self._peer

    def answer_to(self, address: Address) -> None:
        """From now on sends go to this address."""
        self._peer = address

    def wake(self) -> None:
        """Ends a running, or the next, `receive` at once."""
        with contextlib.suppress(OSError):  # full of wake-ups that are not read yet, or closed: nobody to wake
            self._waker.send(b"\0")

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        """What has come, after waiting for it up to a time; empty when nothing has, or when woken."""
        ready = self._poll.poll(max(0.0, timeout_s) * 1000.0)
        if any(descriptor == self._woken.fileno() for descriptor, _ in ready):
            self._woken.recv(4096)
        sock = self._socket
        if sock is None:
            return []
        datagrams: list[tuple[bytes, Address]] = []
        with contextlib.suppress(BlockingIOError):  # no more
            while len(datagrams) < _BATCH:
                datagrams.append(sock.recvfrom(_DATAGRAM_SIZE))
        return datagrams

    def discard(self) -> None:
        """Throws away all that has come and is not received yet."""
        while self.receive(0.0):
            pass

    def send(self, data: bytes) -> bool:
        """Sends to the peer; false when there is none (yet) or the system would not take it."""
        sock, peer = self._socket, self._peer
        if sock is None or peer is None:
            return False
        try:
            sock.sendto(data, peer)
        except OSError as error:
            if self._is_sending_well:
                self._is_sending_well = False
                _log.warning("cannot send to %s: %s", peer[0], error.strerror)
            return False
        self._is_sending_well = True
        return True
