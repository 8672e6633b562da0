"""`FenceService`: the fence and the rally points that the autopilot keeps."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any

from typing_extensions import override

from ual.v1 import fence_pb2 as pb
from ual.v1 import fence_pb2_grpc
from ual.wire import fences as convert
from ual_daemon.extensions.base import lease_of
from ual_daemon.extensions.shipped.fence import LIMIT_S, FencedVehicle, VehicleFence
from ual_daemon.server.shipped.waiting import ended


class FenceServicer(fence_pb2_grpc.FenceServiceServicer):
    """The fence of one UAV. ``ual/v1/fence.proto`` describes each method."""

    def __init__(self, vehicle: FencedVehicle) -> None:
        self._fence = VehicleFence(vehicle)

    # Names and order are those of the contract.

    @override
    async def GetFence(self, request: pb.GetFenceRequest, context: object) -> pb.GetFenceResponse:
        found = await ended(self._fence.get(), LIMIT_S, "GetFence")
        return pb.GetFenceResponse(fence=convert.to_proto(found))

    @override
    async def UploadFence(self, request: pb.UploadFenceRequest, context: object) -> pb.UploadFenceResponse:
        uploading = await asyncio.to_thread(  # it writes a file
            self._fence.upload,
            None if request.is_configured else convert.plan_from_proto(request),
            lease_of(context),
            replace=request.replace,
            enable=not request.is_only_kept,
            force=request.force,
        )
        found = await ended(uploading, LIMIT_S, "UploadFence")
        return pb.UploadFenceResponse(fence=convert.to_proto(found))

    @override
    async def ClearFence(self, request: pb.ClearFenceRequest, context: object) -> pb.ClearFenceResponse:
        clear, with_rally_points = self._fence.clear, request.with_rally_points
        clearing = await asyncio.to_thread(
            clear, lease_of(context), with_rally_points=with_rally_points, force=request.force
        )
        return pb.ClearFenceResponse(fence=convert.to_proto(await ended(clearing, LIMIT_S, "ClearFence")))

    @override
    async def EnableFence(self, request: pb.EnableFenceRequest, context: object) -> pb.EnableFenceResponse:
        switching = self._fence.enable(lease_of(context), is_on=request.enable)
        return pb.EnableFenceResponse(fence=convert.to_proto(await ended(switching, LIMIT_S, "EnableFence")))


def fence_service(vehicle: FencedVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["FenceService"].full_name
    add = fence_pb2_grpc.add_FenceServiceServicer_to_server
    return name, partial(add, FenceServicer(vehicle))
