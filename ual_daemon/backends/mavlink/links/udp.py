"""UDP: listens for an autopilot and answers to the address that it sends from, or calls one."""

from __future__ import annotations

import errno
import logging
import select
import socket
from collections.abc import Mapping

from typing_extensions import override

from ual_daemon.backends.hosts import Host
from ual_daemon.backends.mavlink.links.base import (
    READ_BATCH_BYTES,
    Address,
    Chunk,
    LinkError,
    MavlinkLink,
    cannot_listen,
)
from ual_daemon.backends.mavlink.links.endpoints import UdpEndpoint

_log = logging.getLogger(__name__)

_DATAGRAM_SIZE = READ_BATCH_BYTES
"""The rest of a longer one is dropped: nothing that speaks MAVLink sends one, as frames have at most 293 bytes."""
_BATCH_DATAGRAMS = 64
"""The most datagrams that are received at once, for the same reason as `READ_BATCH_BYTES`."""
_RECEIVE_BUFFER_BYTES = 1 << 20


class UdpLink(MavlinkLink):
    """A UDP socket. Nothing that happens at the other end breaks it."""

    is_stream = False
    peer: Address | None = None  # an attribute: each datagram asks

    def __init__(self, endpoint: UdpEndpoint) -> None:
        self._endpoint = endpoint
        self._host = Host(endpoint.host, endpoint.port, socket.SOCK_DGRAM, LinkError)
        self._socket: socket.socket | None = None
        self._descriptors: Mapping[int, int] = {}
        self._poll = select.poll()
        self._trouble = ""

    @property
    @override
    def trouble(self) -> str:
        return self._trouble

    @override
    def open(self) -> None:
        family, address = self._host.address()
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
            if self._endpoint.is_listening:
                sock.bind(address)
            else:
                self.peer = address
        except OSError as error:
            sock.close()
            raise cannot_listen(self._endpoint, error) from None
        self.connections_count += 1
        self._socket = sock
        self._descriptors = {sock.fileno(): select.POLLIN}
        self._poll = select.poll()
        self._poll.register(sock, select.POLLIN)

    @override
    def close(self) -> None:
        sock, self._socket, self._descriptors = self._socket, None, {}
        if sock is not None:
            sock.close()

    @override
    def descriptors(self) -> Mapping[int, int]:
        return self._descriptors

    @override
    def answer_to(self, address: Address | None) -> None:
        self.peer = address

    @override
    def receive(self, now_s: float) -> list[Chunk]:
        chunks: list[Chunk] = []
        sock = self._socket
        if sock is None:
            return chunks
        try:
            chunk = sock.recvfrom(_DATAGRAM_SIZE)
            chunks.append(chunk)
            bytes_count = len(chunk[0])
            # Polled, as nearly always there is no more, and an exception for each datagram is expensive.
            poll = self._poll.poll
            while poll(0) and bytes_count < READ_BATCH_BYTES and len(chunks) < _BATCH_DATAGRAMS:
                chunk = sock.recvfrom(_DATAGRAM_SIZE)
                chunks.append(chunk)
                bytes_count += len(chunk[0])
        except OSError:  # an ICMP error in answer to a datagram of ours: the other end is not there (yet)
            pass
        return chunks

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        sock, peer = self._socket, self.peer
        if sock is None or peer is None:
            return False
        try:
            sock.sendto(data, peer)
        except OSError as error:
            trouble = cannot_send(peer, error)
            if trouble != self._trouble:
                self._trouble = trouble
                _log.warning("%s", trouble)
            return False
        self._trouble = ""
        return True

    @override
    def send_to(self, data: bytes, address: Address, *, is_perishable: bool = False) -> bool:
        sock = self._socket
        if sock is None:
            return False
        sock.sendto(data, address)
        return True


def cannot_send(peer: Address, error: OSError) -> str:
    """Returns, human-readable, why nothing can be sent to an address."""
    why = "it is a broadcast address" if error.errno == errno.EACCES else error.strerror
    return f"cannot send to {peer[0]}: {why}"
