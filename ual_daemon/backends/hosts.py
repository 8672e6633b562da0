"""Resolves host names without waiting for the name service."""

from __future__ import annotations

import concurrent.futures
import socket
import threading
from concurrent.futures import Future
from typing import cast

Address = tuple[str, int] | tuple[str, int, int, int]

_LOOKUP_TIMEOUT_S = 0.02
"""Enough for numeric addresses, and for names that this computer resolves by itself."""


class Host:
    """A port of a host. The name is resolved again each time, on a thread of its own: that may take many seconds."""

    def __init__(self, name: str, port: int, kind: socket.SocketKind, error: type[Exception]) -> None:
        """`error` is what is raised where there is no address."""
        self._error = error
        self._name = name
        self._port = port
        self._kind = kind
        self._found: Future[tuple[socket.AddressFamily, Address]] | None = None

    def address(self) -> tuple[socket.AddressFamily, Address]:
        """Returns the family and the address.

        Raises:
            Exception: There is none, or not yet (of the type `error`); call again later.

        """
        numeric = self._numeric()
        if numeric is not None:
            return numeric
        if self._found is None:
            self._found = Future()
            threading.Thread(target=self._resolve, args=(self._found,), name="host name", daemon=True).start()
        done, _ = concurrent.futures.wait([self._found], timeout=_LOOKUP_TIMEOUT_S)
        if not done:  # a timeout error would be ambiguous: a name service that times out raises the same
            raise self._error(f"looking for the host {self._name}")
        found, self._found = self._found, None
        try:
            return found.result()
        except (OSError, UnicodeError) as error:
            why = error.strerror if isinstance(error, OSError) else "that is no host name"
            raise self._error(f"cannot find the host {self._name}: {why}; trying again") from None

    def _numeric(self) -> tuple[socket.AddressFamily, Address] | None:
        """Returns the address if the name is one; the name service is not asked then."""
        for family, more in ((socket.AF_INET, ()), (socket.AF_INET6, (0, 0))):
            try:
                socket.inet_pton(family, self._name)
            except (OSError, UnicodeError):
                continue
            return family, cast("Address", (self._name, self._port, *more))
        return None

    def _resolve(self, found: Future[tuple[socket.AddressFamily, Address]]) -> None:
        try:
            family, _, _, _, address = socket.getaddrinfo(self._name, self._port, type=self._kind)[0]
        except (OSError, UnicodeError) as error:
            found.set_exception(error)
        else:
            found.set_result((family, cast("Address", address)))
