"""`CorrectionsService`: corrections for the satellite receiver."""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import Any, cast

from typing_extensions import override

from ual.v1 import corrections_pb2 as pb
from ual.v1 import corrections_pb2_grpc
from ual.wire import corrections as convert
from ual_daemon.extensions.shipped.corrections import CorrectionsStream, VehicleCorrections
from ual_daemon.extensions.shipped.vehicle import ServedVehicle
from ual_daemon.server.transport.base import Call


class CorrectionsServicer(corrections_pb2_grpc.CorrectionsServiceServicer):
    """The corrections of one UAV. ``ual/v1/corrections.proto`` describes each method."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._corrections = VehicleCorrections(vehicle)

    # Names and order are those of the contract.

    @override
    def StreamCorrections(  # type: ignore[override] # each is taken where it was received: see `dispatch`
        self, request_iterator: None, context: object
    ) -> Generator[None, pb.StreamCorrectionsRequest | None, pb.StreamCorrectionsResponse]:
        stream: CorrectionsStream | None = None
        try:
            while (request := (yield)) is not None:
                if stream is None:
                    stream = self._corrections.open(request.sender or _caller(context))
                stream.send(request.rtcm)
        finally:
            if stream is not None:
                stream.close()
        return pb.StreamCorrectionsResponse(status=convert.to_proto(self._corrections.status()))

    @override
    def GetCorrectionsStatus(
        self, request: pb.GetCorrectionsStatusRequest, context: object
    ) -> pb.GetCorrectionsStatusResponse:
        return pb.GetCorrectionsStatusResponse(status=convert.to_proto(self._corrections.status()))


def corrections_service(vehicle: ServedVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["CorrectionsService"].full_name
    add = corrections_pb2_grpc.add_CorrectionsServiceServicer_to_server
    return name, partial(add, CorrectionsServicer(vehicle))


def _caller(context: object) -> str:
    """Returns by what name a program is known that gave none."""
    call = cast("Call", context)
    return call.identity or call.peer()
