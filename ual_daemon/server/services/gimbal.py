"""`GimbalService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import AsyncIterator

from typing_extensions import override

from ual.v1 import gimbal_pb2 as pb
from ual.v1 import gimbal_pb2_grpc
from ual.wire import convert, requests
from ual.wire import gimbal as wire
from ual_daemon.server.services.waiting import answer, answers
from ual_daemon.services.gimbals import VehicleGimbals
from ual_daemon.services.vehicle import GimbalVehicle


class GimbalServicer(gimbal_pb2_grpc.GimbalServiceServicer):
    """The methods of `GimbalService` for one UAV. ``ual/v1/gimbal.proto`` describes each of them."""

    def __init__(self, vehicle: GimbalVehicle) -> None:
        self._of_vehicle = VehicleGimbals(vehicle)

    @override
    async def GetGimbalStatus(self, request: pb.GetGimbalStatusRequest, context: object) -> pb.GetGimbalStatusResponse:
        result = self._of_vehicle.status(request.gimbal)
        return pb.GetGimbalStatusResponse(status=wire.gimbal_status_to_proto(result))

    @override
    async def WatchGimbal(
        self, request: pb.WatchGimbalRequest, context: object
    ) -> AsyncIterator[pb.WatchGimbalResponse]:
        async for result in answers(self._of_vehicle.watch(request.gimbal, rate_hz=request.rate_hz), "WatchGimbal"):
            yield pb.WatchGimbalResponse(status=wire.gimbal_status_to_proto(result))

    @override
    async def SetGimbalAngles(self, request: pb.SetGimbalAnglesRequest, context: object) -> pb.SetGimbalAnglesResponse:
        await answer(self._of_vehicle.set_angles(**requests.set_gimbal_angles_arguments(request)), "SetGimbalAngles")
        return pb.SetGimbalAnglesResponse()

    @override
    async def SetGimbalRates(self, request: pb.SetGimbalRatesRequest, context: object) -> pb.SetGimbalRatesResponse:
        await answer(
            self._of_vehicle.set_rates(request.gimbal, pitch_rad_s=request.pitch_rad_s, yaw_rad_s=request.yaw_rad_s),
            "SetGimbalRates",
        )
        return pb.SetGimbalRatesResponse()

    @override
    async def PointGimbal(self, request: pb.PointGimbalRequest, context: object) -> pb.PointGimbalResponse:
        await answer(
            self._of_vehicle.point_at(request.gimbal, point=convert.point_stamped_from_proto(request.point, "point")),
            "PointGimbal",
        )
        return pb.PointGimbalResponse()

    @override
    async def MoveGimbalToNeutral(
        self, request: pb.MoveGimbalToNeutralRequest, context: object
    ) -> pb.MoveGimbalToNeutralResponse:
        await answer(self._of_vehicle.move_to_neutral(request.gimbal), "MoveGimbalToNeutral")
        return pb.MoveGimbalToNeutralResponse()

    @override
    async def RetractGimbal(self, request: pb.RetractGimbalRequest, context: object) -> pb.RetractGimbalResponse:
        await answer(self._of_vehicle.retract(request.gimbal), "RetractGimbal")
        return pb.RetractGimbalResponse()

    @override
    async def TakeGimbalControl(
        self, request: pb.TakeGimbalControlRequest, context: object
    ) -> pb.TakeGimbalControlResponse:
        await answer(self._of_vehicle.take_control(request.gimbal), "TakeGimbalControl")
        return pb.TakeGimbalControlResponse()

    @override
    async def ReleaseGimbalControl(
        self, request: pb.ReleaseGimbalControlRequest, context: object
    ) -> pb.ReleaseGimbalControlResponse:
        await answer(self._of_vehicle.release_control(request.gimbal), "ReleaseGimbalControl")
        return pb.ReleaseGimbalControlResponse()

    @override
    async def ListGimbals(self, request: pb.ListGimbalsRequest, context: object) -> pb.ListGimbalsResponse:
        result = self._of_vehicle.get_all()
        return pb.ListGimbalsResponse(gimbals=map(wire.gimbal_info_to_proto, result))
