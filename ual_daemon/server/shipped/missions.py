"""`MissionService`: the missions that the autopilot flies by itself."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from functools import partial
from typing import Any

from typing_extensions import override

from ual.missions import checks
from ual.missions.items import Item
from ual.v1 import mission_pb2 as pb
from ual.v1 import mission_pb2_grpc
from ual.wire import convert
from ual.wire import missions as wire
from ual_daemon.extensions.base import lease_of
from ual_daemon.extensions.shipped.missions import JUMP_S, LOOK_S, START_S, TRANSFER_S, VehicleMissions
from ual_daemon.extensions.shipped.vehicle import CommandedVehicle
from ual_daemon.server.shipped.waiting import ended


class MissionServicer(mission_pb2_grpc.MissionServiceServicer):
    """The missions of one UAV. ``ual/v1/mission.proto`` describes each method."""

    def __init__(self, vehicle: CommandedVehicle) -> None:
        self._missions = VehicleMissions(vehicle)

    # Names and order are those of the contract.

    @override
    async def PlanMission(self, request: pb.PlanMissionRequest, context: object) -> pb.PlanMissionResponse:
        items = _items(request.items)
        plan = await asyncio.to_thread(self._missions.plan, items)  # a thousand items in a fence take a second
        return pb.PlanMissionResponse(plan=wire.plan_to_proto(plan))

    @override
    async def UploadMission(self, request: pb.UploadMissionRequest, context: object) -> pb.UploadMissionResponse:
        items, lease_id = _items(request.items), lease_of(context)
        uploading = await asyncio.to_thread(self._missions.upload, items, lease_id)
        found = await ended(uploading, TRANSFER_S, "UploadMission")
        return pb.UploadMissionResponse(mission=wire.stored_to_proto(found))

    @override
    async def DownloadMission(self, request: pb.DownloadMissionRequest, context: object) -> pb.DownloadMissionResponse:
        found = await ended(self._missions.download(), TRANSFER_S, "DownloadMission")
        return pb.DownloadMissionResponse(mission=wire.stored_to_proto(found))

    @override
    async def ClearMission(self, request: pb.ClearMissionRequest, context: object) -> pb.ClearMissionResponse:
        clearing = await asyncio.to_thread(self._missions.clear, lease_of(context))  # it writes a file
        await ended(clearing, TRANSFER_S, "ClearMission")
        return pb.ClearMissionResponse()

    @override
    async def StartMission(self, request: pb.StartMissionRequest, context: object) -> pb.StartMissionResponse:
        action = wire.link_loss_from_proto(request.on_link_loss)
        starting = self._missions.start(request.first_item or 1, action, lease_of(context))
        info = await ended(starting, START_S, "StartMission")
        return pb.StartMissionResponse(task=convert.task_to_proto(info))

    @override
    async def PauseMission(self, request: pb.PauseMissionRequest, context: object) -> pb.PauseMissionResponse:
        self._missions.pause(lease_of(context))
        return pb.PauseMissionResponse()

    @override
    async def ResumeMission(self, request: pb.ResumeMissionRequest, context: object) -> pb.ResumeMissionResponse:
        self._missions.resume(lease_of(context))
        return pb.ResumeMissionResponse()

    @override
    async def JumpToItem(self, request: pb.JumpToItemRequest, context: object) -> pb.JumpToItemResponse:
        await ended(self._missions.jump_to(request.item, lease_of(context)), JUMP_S, "JumpToItem")
        return pb.JumpToItemResponse()

    @override
    async def GetMissionProgress(
        self, request: pb.GetMissionProgressRequest, context: object
    ) -> pb.GetMissionProgressResponse:
        return pb.GetMissionProgressResponse(progress=wire.progress_to_proto(self._missions.progress()))

    @override
    async def WatchMission(
        self, request: pb.WatchMissionRequest, context: object
    ) -> AsyncIterator[pb.WatchMissionResponse]:
        last = None
        while True:
            progress = self._missions.progress()
            if progress != last:
                last = progress
                yield pb.WatchMissionResponse(progress=wire.progress_to_proto(progress))
            await asyncio.sleep(LOOK_S)


def _items(messages: Sequence[pb.MissionItem]) -> list[Item]:
    """Reads items, if they are not too many."""
    checks.require_count(messages)
    return wire.items_from_proto(messages)


def mission_service(vehicle: CommandedVehicle) -> tuple[str, Callable[[Any], None]]:
    """Returns the name of the service, and what registers its methods."""
    name: str = pb.DESCRIPTOR.services_by_name["MissionService"].full_name
    add = mission_pb2_grpc.add_MissionServiceServicer_to_server
    return name, partial(add, MissionServicer(vehicle))
