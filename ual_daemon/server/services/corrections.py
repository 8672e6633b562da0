"""`CorrectionsService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from typing_extensions import override

from ual.v1 import corrections_pb2 as pb
from ual.v1 import corrections_pb2_grpc
from ual.wire import corrections as wire
from ual_daemon.server.services.by_hand import CorrectionsServiceBase
from ual_daemon.services.corrections import VehicleCorrections
from ual_daemon.services.vehicle import ServedVehicle


class CorrectionsServicer(CorrectionsServiceBase, corrections_pb2_grpc.CorrectionsServiceServicer):
    """The methods of `CorrectionsService` for one UAV. ``ual/v1/corrections.proto`` describes each of them."""

    def __init__(self, vehicle: ServedVehicle) -> None:
        self._of_vehicle = VehicleCorrections(vehicle)

    @override
    async def GetCorrectionsStatus(
        self, request: pb.GetCorrectionsStatusRequest, context: object
    ) -> pb.GetCorrectionsStatusResponse:
        result = self._of_vehicle.status()
        return pb.GetCorrectionsStatusResponse(status=wire.corrections_status_to_proto(result))
