"""Corrections for the receiver of a UAV, over gRPC."""

from __future__ import annotations

from collections.abc import Iterable

import grpc
from typing_extensions import override

from ual import _corrections_calls as calls
from ual import interface
from ual._calls import Service
from ual._connection import Connection
from ual.corrections import CorrectionsStatus
from ual.wire import corrections as convert


class Corrections(interface.Corrections):
    """`ual.interface.Corrections`, over gRPC."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def __repr__(self) -> str:
        return f"<Corrections of {self._connection.described}>"

    @override
    def stream(self, rtcm: Iterable[bytes], sender: str = "") -> CorrectionsStatus:
        elements = calls.Elements(rtcm, sender)
        call = self._connection.stream(calls.METHOD, iter(elements), Service.CORRECTIONS)
        try:
            response = call.result()
        except grpc.RpcError as error:
            raise self._connection.error(error) from None
        finally:
            call.cancel()  # an interruption ends it, too
        if elements.failure is not None:
            raise elements.failure
        return convert.of_response(response)

    @override
    def status(self) -> CorrectionsStatus:
        return self._connection.run(calls.status())
