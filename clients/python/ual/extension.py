"""Interface for the client of an extension's service: calls over the connection of an `ual.Uav`, with UAL's errors.

A package that extends the daemon has a client class, and names it by an entry point ``ual.extensions``: then
`ual.Uav.extension` returns it, made with a `Link`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import grpc

from ual._connection import Connection
from ual.contract.method import QUICK_S
from ual.errors import NotSupportedError

GROUP = "ual.extensions"

R = TypeVar("R")


class Link:
    """The connection of one `ual.Uav`. May be used from any thread."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def ns(self) -> str:
        """The namespace of the UAV, as far as it is known."""
        return self._connection.target.known_ns

    def call(
        self, make_stub: Callable[[grpc.Channel], Any], method: str, request: object, timeout_s: float = QUICK_S
    ) -> Any:  # noqa: ANN401 (the package's own)
        """Makes a call and returns its response.

        Args:
            make_stub: The class of the generated stub.
            method: The name of the method.
            request: Its request.
            timeout_s: How long to wait, in seconds.

        Raises:
            UalError: The daemon refused it, or cannot be reached; as the calls of `ual.Uav` do.

        """
        return self._connection.run_extension(make_stub, method, request, timeout_s)

    def stream(self, make_stub: Callable[[grpc.Channel], Any], method: str, request: object) -> Iterator[Any]:
        """Yields the responses of a stream until it ends, or the iterator is closed. Raises as `call` does."""
        return self._connection.stream_extension(make_stub, method, request)


def client_of(name: str, connection: Connection) -> Any:  # noqa: ANN401 (the package's own)
    """Returns the client of an extension. Raises as `load` does."""
    return load(GROUP, name)(Link(connection))


def load(group: str, name: str) -> Any:  # noqa: ANN401 (the package's own)
    """Returns the class of an extension's client, of a group of entry points.

    Raises:
        NotSupportedError: No package with this extension is installed here.

    """
    from importlib import metadata

    points = metadata.entry_points(group=group)
    found = next((point for point in points if point.name == name), None)
    if found is None:
        known = ", ".join(sorted(point.name for point in points)) or "none"
        raise NotSupportedError(
            f"no package with a client of the extension {name} is installed (installed are: {known})",
            {"extension": name},
        )
    return found.load()
