"""`FenceService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

import asyncio

from typing_extensions import override

from ual.v1 import fence_pb2 as pb
from ual.v1 import fence_pb2_grpc
from ual.wire import fence as wire
from ual.wire import requests
from ual_daemon.extensions.base import lease_of
from ual_daemon.server.services.by_hand import FenceServiceBase
from ual_daemon.server.services.waiting import answer
from ual_daemon.services.fence import FencedVehicle, VehicleFence


class FenceServicer(FenceServiceBase, fence_pb2_grpc.FenceServiceServicer):
    """The methods of `FenceService` for one UAV. ``ual/v1/fence.proto`` describes each of them."""

    def __init__(self, vehicle: FencedVehicle) -> None:
        self._of_vehicle = VehicleFence(vehicle)

    @override
    async def GetFence(self, request: pb.GetFenceRequest, context: object) -> pb.GetFenceResponse:
        result = await answer(self._of_vehicle.get(), "GetFence")
        return pb.GetFenceResponse(fence=wire.kept_fence_to_proto(result))

    @override
    async def UploadFence(self, request: pb.UploadFenceRequest, context: object) -> pb.UploadFenceResponse:
        result = await answer(
            await asyncio.to_thread(
                lambda: self._of_vehicle.upload(**requests.upload_fence_arguments(request), lease_id=lease_of(context))
            ),
            "UploadFence",
        )
        return pb.UploadFenceResponse(fence=wire.kept_fence_to_proto(result))

    @override
    async def ClearFence(self, request: pb.ClearFenceRequest, context: object) -> pb.ClearFenceResponse:
        result = await answer(
            await asyncio.to_thread(
                lambda: self._of_vehicle.clear(
                    with_rally_points=request.with_rally_points, force=request.force, lease_id=lease_of(context)
                )
            ),
            "ClearFence",
        )
        return pb.ClearFenceResponse(fence=wire.kept_fence_to_proto(result))
