"""The stream of corrections, over gRPC."""

from __future__ import annotations

from collections.abc import AsyncIterable, AsyncIterator, Iterable, Iterator

import grpc
from typing_extensions import override

from ual import interface
from ual._connection import Connection
from ual._wrong_type import require
from ual.corrections import CorrectionsStatus, cut, cut_one
from ual.v1 import corrections_pb2 as pb
from ual.wire.corrections import corrections_status_from_proto


class CorrectionsBase(interface.Corrections):
    """Members that are more than a call: the stream."""

    _connection: Connection

    @override
    def stream(self, rtcm: Iterable[bytes], sender: str = "") -> CorrectionsStatus:
        elements = Elements(rtcm, sender)
        call = self._connection.stream("StreamCorrections", iter(elements), "CorrectionsService")
        try:
            response = call.result()
        except grpc.RpcError as error:
            raise self._connection.error(error) from None
        finally:
            call.cancel()  # an interruption ends it, too
        if elements.failure is not None:
            raise elements.failure
        return corrections_status_from_proto(response.status)


class Elements:
    """The elements of a stream, for gRPC, which takes them on its own thread. `failure` is what its bytes raised."""

    def __init__(self, rtcm: Iterable[bytes], sender: str) -> None:
        require(sender, str, "sender")
        self.failure: BaseException | None = None
        self._rtcm = rtcm
        self._sender = sender

    def __iter__(self) -> Iterator[pb.StreamCorrectionsRequest]:
        yield first(self._sender)
        try:
            for each in cut(self._rtcm):
                yield pb.StreamCorrectionsRequest(rtcm=each)
        except Exception as error:  # noqa: BLE001  whatever it is, the stream ends, and its caller gets it
            self.failure = error


class AsyncElements:
    """The same, for asyncio."""

    def __init__(self, rtcm: AsyncIterable[bytes], sender: str) -> None:
        require(sender, str, "sender")
        self.failure: BaseException | None = None
        self._rtcm = rtcm
        self._sender = sender

    async def __aiter__(self) -> AsyncIterator[pb.StreamCorrectionsRequest]:
        yield first(self._sender)
        try:
            async for data in self._rtcm:
                for each in cut_one(data):
                    yield pb.StreamCorrectionsRequest(rtcm=each)
        except Exception as error:  # noqa: BLE001  whatever it is, the stream ends, and its caller gets it
            self.failure = error


def first(sender: str) -> pb.StreamCorrectionsRequest:
    """Returns the element that identifies the sender. It comes before the first bytes, so that a refusal does, too."""
    return pb.StreamCorrectionsRequest(sender=sender)
