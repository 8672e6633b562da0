"""TCP: connects to the server of an autopilot or a router, or lets one of them connect to us."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import select
import socket
from collections.abc import Mapping

from typing_extensions import override

from ual_daemon.backends import tcp
from ual_daemon.backends.hosts import Host
from ual_daemon.backends.mavlink.links.base import (
    READ_BATCH_BYTES,
    Address,
    Chunk,
    LinkError,
    MavlinkLink,
    StreamWriter,
    cannot_listen,
)
from ual_daemon.backends.mavlink.links.endpoints import TcpEndpoint

_log = logging.getLogger(__name__)

LARGEST_WRITE_BYTES = 512
"""Bytes that may wait for their acknowledgement where there is room for messages that are not urgent: setpoints always
do.
"""
HANDOVER_S = 1.5
"""A connection that is silent for this long is replaced by a new one: an autopilot sends a heartbeat each second."""


class TcpClientLink(MavlinkLink):
    """A connection that we open."""

    needs_traffic = True

    def __init__(self, endpoint: TcpEndpoint) -> None:
        self._endpoint = endpoint
        self._host = Host(endpoint.host, endpoint.port, socket.SOCK_STREAM, LinkError)
        self._address: Address | None = None
        self._socket: socket.socket | None = None
        self._writer = StreamWriter(os.write, LARGEST_WRITE_BYTES)

    @override
    def open(self) -> None:
        family, address = self._host.address()
        sock = socket.socket(family, socket.SOCK_STREAM)
        _prepare(sock)
        code = sock.connect_ex(address)
        if code not in (0, errno.EINPROGRESS):
            sock.close()
            raise self._trouble(code)
        self._socket, self._address = sock, address

    @override
    def close(self) -> None:
        sock = self._let_go()
        if sock is not None:
            sock.close()

    @override
    def abort(self) -> None:
        sock = self._let_go()
        if sock is not None:
            tcp.discard(sock)

    @override
    def descriptors(self) -> Mapping[int, int]:
        if self._socket is None:
            return {}
        return {self._socket.fileno(): select.POLLIN if self._writer.is_attached else select.POLLOUT}

    @property
    @override
    def peer(self) -> Address | None:
        return None if self._socket is None else self._address

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        sock = self._socket
        if sock is None:
            return []
        if not self._writer.is_attached:
            self._finish_connecting(sock)
            return []
        try:
            data = sock.recv(READ_BATCH_BYTES)
        except BlockingIOError:
            return []
        except OSError as error:
            raise LinkError(f"the connection to {self._endpoint} broke: {error.strerror}; connecting anew") from None
        if not data:
            raise LinkError(f"{self._endpoint} closed the connection; connecting anew")
        return [(data, self._address)]

    @property
    @override
    def has_room(self) -> bool:
        return self._writer.has_room

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        return self._writer.write(data, is_perishable=is_perishable)

    def _let_go(self) -> socket.socket | None:
        self._writer.attach(None)
        sock, self._socket = self._socket, None
        return sock

    def _finish_connecting(self, sock: socket.socket) -> None:
        code = sock.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            raise self._trouble(code)
        try:
            sock.getpeername()
        except OSError:  # not connected yet
            return
        self.connections_count += 1
        self._writer.attach(sock.fileno())

    def _trouble(self, code: int) -> LinkError:
        why = "nobody listens there" if code == errno.ECONNREFUSED else os.strerror(code)
        return LinkError(f"cannot connect to {self._endpoint}: {why}; trying again")


class TcpServerLink(MavlinkLink):
    """A port at which one other end at a time can connect to us.

    Others are refused, unless the present connection has fallen silent. When an autopilot comes back after its cable
    was pulled, its own old connection, which was never closed, must not keep it out.
    """

    needs_traffic = True

    def __init__(self, endpoint: TcpEndpoint) -> None:
        self._endpoint = endpoint
        self._host = Host(endpoint.host, endpoint.port, socket.SOCK_STREAM, LinkError)
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None
        self._address: Address | None = None
        self._received_s = 0.0
        self._writer = StreamWriter(os.write, LARGEST_WRITE_BYTES)

    @override
    def open(self) -> None:
        family, address = self._host.address()
        sock = socket.socket(family, socket.SOCK_STREAM)
        try:
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.bind(address)
            sock.listen(1)
        except OSError as error:
            sock.close()
            raise cannot_listen(self._endpoint, error) from None
        self._listener = sock

    @override
    def close(self) -> None:
        client = self._let_go()
        if client is not None:
            client.close()
        self._stop_listening()

    @override
    def abort(self) -> None:
        self._hang_up()
        self._stop_listening()

    @override
    def descriptors(self) -> Mapping[int, int]:
        return {sock.fileno(): select.POLLIN for sock in (self._listener, self._client) if sock is not None}

    @property
    @override
    def peer(self) -> Address | None:
        return self._address

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        address, data = self._address, self._read()
        if data:
            self._received_s = now_s
            return [(data, address)]
        self._accept(now_s)  # only when all data of the one before are read
        return []

    @property
    @override
    def has_room(self) -> bool:
        return self._writer.has_room

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        return self._writer.write(data, is_perishable=is_perishable)

    @override
    def drop_peer(self, why: str) -> None:
        self._hang_up()

    def _read(self) -> bytes:
        if self._client is None:
            return b""
        try:
            data = self._client.recv(READ_BATCH_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def _accept(self, now_s: float) -> None:
        if self._listener is None:
            return
        with contextlib.suppress(BlockingIOError, ConnectionError):  # none, or closed again
            client, address = self._listener.accept()
            if self._client is not None and now_s - self._received_s < HANDOVER_S:
                _log.warning("%s tried to connect to %s, which is taken", address[0], self._endpoint)
                client.close()
                return
            self._hang_up()
            _prepare(client)
            self._received_s = now_s
            self.connections_count += 1
            self._client, self._address = client, address
            self._writer.attach(client.fileno())

    def _hang_up(self) -> None:
        client = self._let_go()
        if client is not None:
            tcp.discard(client)

    def _let_go(self) -> socket.socket | None:
        self._writer.attach(None)
        client, self._client, self._address = self._client, None, None
        return client

    def _stop_listening(self) -> None:
        listener, self._listener = self._listener, None
        if listener is not None:
            listener.close()


def _prepare(sock: socket.socket) -> None:
    sock.setblocking(False)
    tcp.prepare(sock)
