"""The stream of corrections, over gRPC, for asyncio."""

from __future__ import annotations

from collections.abc import AsyncIterable

import grpc.aio

from ual._corrections import AsyncElements
from ual.aio._connection import Connection
from ual.corrections import CorrectionsStatus
from ual.wire.corrections import corrections_status_from_proto


class CorrectionsBase:
    """Members that are more than a call: the stream."""

    _connection: Connection

    async def stream(self, rtcm: AsyncIterable[bytes], sender: str = "") -> CorrectionsStatus:
        """Passes on a stream of RTCM 3, cut anywhere, until it ends. Needs no lease. Returns what has become of it.

        Args:
            rtcm: The bytes of a base station, as they come. Whole messages with a right checksum are passed on.
            sender: What sends, human-readable, such as the name of the caster. It is in the error that others get.

        Raises:
            ResourceExhaustedError: Another program sends; the metadata `held_by` names it; or it is too much.
            PermissionDeniedError: The daemon only watches.

        """
        elements = AsyncElements(rtcm, sender)
        connection = self._connection
        async with connection.calling() as route:
            method = route.stubs.method_of("CorrectionsService", "StreamCorrections")
            call = method(elements.__aiter__(), metadata=connection.target.metadata)
            try:
                response = await call
            except grpc.aio.AioRpcError as error:
                raise connection.error(error) from None
            finally:
                call.cancel()
        if elements.failure is not None:
            raise elements.failure
        return corrections_status_from_proto(response.status)
