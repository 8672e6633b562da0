"""Host names to addresses, without waiting for the name service."""

from __future__ import annotations

import concurrent.futures
import socket
import threading
from concurrent.futures import Future
from typing import cast

from ual_daemon.backends.mavlink.links.base import Address, LinkError

_PATIENCE_S = 0.02
"""Numbers, and names that this computer knows by itself, are found at once."""


class Host:
    """A host's port. A name is looked up anew each time, on a thread of its own: that may take many seconds."""

    def __init__(self, name: str, port: int, kind: socket.SocketKind) -> None:
        self._name = name
        self._port = port
        self._kind = kind
        self._found: Future[tuple[socket.AddressFamily, Address]] | None = None

    def address(self) -> tuple[socket.AddressFamily, Address]:
        """Its family and address. Raises `LinkError` where there is none, or not yet: then ask again later."""
        if self._found is None:
            self._found = Future()
            threading.Thread(target=self._look_up, args=(self._found,), name="host name", daemon=True).start()
        done, _ = concurrent.futures.wait([self._found], timeout=_PATIENCE_S)
        if not done:  # not by the error of a wait that is over: a name service that times out raises the same
            raise LinkError(f"looking for the host {self._name}")
        found, self._found = self._found, None
        try:
            return found.result()
        except (OSError, UnicodeError) as error:
            why = error.strerror if isinstance(error, OSError) else "that is no host name"
            raise LinkError(f"cannot find the host {self._name}: {why}; trying again") from None

    def _look_up(self, found: Future[tuple[socket.AddressFamily, Address]]) -> None:
        try:
            family, _, _, _, address = socket.getaddrinfo(self._name, self._port, type=self._kind)[0]
        except (OSError, UnicodeError) as error:
            found.set_exception(error)
        else:
            found.set_result((family, cast("Address", address)))
