"""`GimbalService`: the gimbals of a UAV."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from typing_extensions import override

from ual.v1 import gimbal_pb2 as pb
from ual.v1 import gimbal_pb2_grpc
from ual.wire import gimbals as convert
from ual_daemon.extensions.shipped.gimbals import ORDER_S, VehicleGimbals, watch_interval_s
from ual_daemon.extensions.shipped.vehicle import GimbalVehicle
from ual_daemon.server.shipped.waiting import ended


class GimbalServicer(gimbal_pb2_grpc.GimbalServiceServicer):
    """The gimbals of one UAV. ``ual/v1/gimbal.proto`` describes each method."""

    def __init__(self, vehicle: GimbalVehicle) -> None:
        self._gimbals = VehicleGimbals(vehicle)

    # Names and order are those of the contract.

    @override
    async def ListGimbals(self, request: pb.ListGimbalsRequest, context: object) -> pb.ListGimbalsResponse:
        return pb.ListGimbalsResponse(gimbals=map(convert.info_to_proto, self._gimbals.get_all()))

    @override
    async def GetGimbalStatus(self, request: pb.GetGimbalStatusRequest, context: object) -> pb.GetGimbalStatusResponse:
        return pb.GetGimbalStatusResponse(status=convert.status_to_proto(self._gimbals.status(request.gimbal)))

    @override
    async def WatchGimbal(
        self, request: pb.WatchGimbalRequest, context: object
    ) -> AsyncIterator[pb.WatchGimbalResponse]:
        interval_s = watch_interval_s(request.rate_hz)
        while True:
            yield pb.WatchGimbalResponse(status=convert.status_to_proto(self._gimbals.status(request.gimbal)))
            await asyncio.sleep(interval_s)

    @override
    async def SetGimbalAngles(self, request: pb.SetGimbalAnglesRequest, context: object) -> pb.SetGimbalAnglesResponse:
        angles, reference = convert.angles_from_proto(request.angles), convert.reference_from_proto(request.reference)
        turning = self._gimbals.set_angles(request.gimbal, angles, reference, request.frame_id)
        await _ordered(turning, "SetGimbalAngles")
        return pb.SetGimbalAnglesResponse()

    @override
    async def SetGimbalRates(self, request: pb.SetGimbalRatesRequest, context: object) -> pb.SetGimbalRatesResponse:
        turning = self._gimbals.set_rates(request.gimbal, request.pitch_rad_s, request.yaw_rad_s)
        await _ordered(turning, "SetGimbalRates")
        return pb.SetGimbalRatesResponse()

    @override
    async def PointGimbal(self, request: pb.PointGimbalRequest, context: object) -> pb.PointGimbalResponse:
        pointing = self._gimbals.point_at(request.gimbal, convert.point_from_request(request))
        await _ordered(pointing, "PointGimbal")
        return pb.PointGimbalResponse()

    @override
    async def MoveGimbalToNeutral(
        self, request: pb.MoveGimbalToNeutralRequest, context: object
    ) -> pb.MoveGimbalToNeutralResponse:
        await _ordered(self._gimbals.move_to_neutral(request.gimbal), "MoveGimbalToNeutral")
        return pb.MoveGimbalToNeutralResponse()

    @override
    async def RetractGimbal(self, request: pb.RetractGimbalRequest, context: object) -> pb.RetractGimbalResponse:
        await _ordered(self._gimbals.retract(request.gimbal), "RetractGimbal")
        return pb.RetractGimbalResponse()

    @override
    async def TakeGimbalControl(
        self, request: pb.TakeGimbalControlRequest, context: object
    ) -> pb.TakeGimbalControlResponse:
        await _ordered(self._gimbals.take_control(request.gimbal), "TakeGimbalControl")
        return pb.TakeGimbalControlResponse()

    @override
    async def ReleaseGimbalControl(
        self, request: pb.ReleaseGimbalControlRequest, context: object
    ) -> pb.ReleaseGimbalControlResponse:
        await _ordered(self._gimbals.release_control(request.gimbal), "ReleaseGimbalControl")
        return pb.ReleaseGimbalControlResponse()


async def _ordered(order: Future[None], what: str) -> None:
    await ended(order, ORDER_S, what)


def gimbal_service(vehicle: GimbalVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["GimbalService"].full_name
    return name, partial(gimbal_pb2_grpc.add_GimbalServiceServicer_to_server, GimbalServicer(vehicle))
