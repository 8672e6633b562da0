"""Interface for the asyncio client of an extension's service; see `ual.extension`."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from typing import Any

import grpc
import grpc.aio

from ual.aio._connection import Connection
from ual.contract.method import QUICK_S

GROUP = "ual.aio.extensions"


class Link:
    """The connection of one `ual.aio.Uav`."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def ns(self) -> str:
        """The namespace of the UAV, as far as it is known."""
        return self._connection.target.known_ns

    async def call(
        self,
        make_stub: Callable[[grpc.aio.Channel], Any],
        method: str,
        request: object,
        timeout_s: float = QUICK_S,
    ) -> Any:  # noqa: ANN401 (the package's own)
        """Makes a call and returns its response; see `ual.extension.Link.call`."""
        async with self._connection.calling() as route:
            call = getattr(make_stub(route.channel), method)
            try:
                return await call(request, timeout=timeout_s, metadata=self._connection.target.metadata)
            except grpc.aio.AioRpcError as error:
                raise self._connection.error(error) from None

    async def stream(
        self, make_stub: Callable[[grpc.aio.Channel], Any], method: str, request: object
    ) -> AsyncIterator[Any]:
        """Yields the responses of a stream until it ends; see `ual.extension.Link.stream`."""
        async with self._connection.calling() as route:
            call = getattr(make_stub(route.channel), method)(request, metadata=self._connection.target.metadata)
            try:
                async for response in call:
                    yield response
            except grpc.aio.AioRpcError as error:
                raise self._connection.error(error) from None
            finally:
                call.cancel()
