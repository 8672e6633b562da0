"""Host names to addresses."""

from __future__ import annotations

import socket
from typing import cast

from ual_daemon.backends.mavlink.links.base import Address, LinkError


def resolve(host: str, port: int, kind: socket.SocketKind) -> tuple[socket.AddressFamily, Address]:
    """The family and address of a host's port. May take the time of a DNS request. Raises `LinkError`."""
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=kind)[0]
    except OSError as error:
        raise LinkError(f"cannot find the host {host}: {error.strerror}; trying again") from None
    return family, cast("Address", address)
