"""`ParachuteService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from typing_extensions import override

from ual.v1 import parachute_pb2 as pb
from ual.v1 import parachute_pb2_grpc
from ual_daemon.extensions.base import lease_of
from ual_daemon.server.services.waiting import answer
from ual_daemon.services.gripper import EquippedVehicle
from ual_daemon.services.parachute import VehicleParachute


class ParachuteServicer(parachute_pb2_grpc.ParachuteServiceServicer):
    """The methods of `ParachuteService` for one UAV. ``ual/v1/parachute.proto`` describes each of them."""

    def __init__(self, vehicle: EquippedVehicle) -> None:
        self._of_vehicle = VehicleParachute(vehicle)

    @override
    async def GetParachuteOrder(
        self, request: pb.GetParachuteOrderRequest, context: object
    ) -> pb.GetParachuteOrderResponse:
        result = self._of_vehicle.ordered()
        return pb.GetParachuteOrderResponse(ordered=result)

    @override
    async def EnableParachute(self, request: pb.EnableParachuteRequest, context: object) -> pb.EnableParachuteResponse:
        await answer(self._of_vehicle.enable(lease_id=lease_of(context)), "EnableParachute")
        return pb.EnableParachuteResponse()

    @override
    async def DisableParachute(
        self, request: pb.DisableParachuteRequest, context: object
    ) -> pb.DisableParachuteResponse:
        await answer(self._of_vehicle.disable(lease_id=lease_of(context)), "DisableParachute")
        return pb.DisableParachuteResponse()

    @override
    async def ReleaseParachute(
        self, request: pb.ReleaseParachuteRequest, context: object
    ) -> pb.ReleaseParachuteResponse:
        await answer(self._of_vehicle.release(lease_id=lease_of(context)), "ReleaseParachute")
        return pb.ReleaseParachuteResponse()
