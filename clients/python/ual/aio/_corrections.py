"""Corrections for the receiver of a UAV, over gRPC, for asyncio."""

from __future__ import annotations

from collections.abc import AsyncIterable

import grpc.aio

from ual import _corrections_calls as calls
from ual._calls import Service
from ual.aio._connection import Connection
from ual.corrections import CorrectionsStatus
from ual.wire import corrections as convert


class Corrections:
    """`ual.interface.Corrections`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Corrections of {self._connection.described}>"

    async def stream(self, rtcm: AsyncIterable[bytes], sender: str = "") -> CorrectionsStatus:
        """Passes on a stream of RTCM 3, cut anywhere, until it ends. Needs no lease. Returns what has become of it.

        Args:
            rtcm: The bytes of a base station, as they come. Whole messages with a right checksum are passed on.
            sender: What sends, human-readable, such as the name of the caster. It is in the error that others get.

        Raises:
            ResourceExhaustedError: Another program sends, whom the metadata `held_by` names; or it is too much.
            PermissionDeniedError: The daemon only watches.

        """
        elements = calls.AsyncElements(rtcm, sender)
        connection = self._connection
        async with connection.calling() as route:
            method = route.stubs.method_of(Service.CORRECTIONS, calls.METHOD)
            call = method(elements.__aiter__(), metadata=connection.target.metadata)
            try:
                response = await call
            except grpc.aio.AioRpcError as error:
                raise connection.error(error) from None
            finally:
                call.cancel()
        if elements.failure is not None:
            raise elements.failure
        return convert.of_response(response)

    async def status(self) -> CorrectionsStatus:
        """Returns what has been sent and dropped since the daemon began, and by whom."""
        return await self._connection.run(calls.status())
