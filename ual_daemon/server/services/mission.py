"""`MissionService`: unpack, call, pack. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from typing_extensions import override

from ual.v1 import mission_pb2 as pb
from ual.v1 import mission_pb2_grpc
from ual.wire import mission as wire
from ual.wire import requests, uav
from ual_daemon.extensions.base import lease_of
from ual_daemon.server.services.waiting import answer, answers
from ual_daemon.services.mission import VehicleMission
from ual_daemon.services.vehicle import CommandedVehicle


class MissionServicer(mission_pb2_grpc.MissionServiceServicer):
    """The methods of `MissionService` for one UAV. ``ual/v1/mission.proto`` describes each of them."""

    def __init__(self, vehicle: CommandedVehicle) -> None:
        self._of_vehicle = VehicleMission(vehicle)

    @override
    async def PlanMission(self, request: pb.PlanMissionRequest, context: object) -> pb.PlanMissionResponse:
        result = await answer(
            await asyncio.to_thread(lambda: self._of_vehicle.plan(**requests.plan_mission_arguments(request))),
            "PlanMission",
        )
        return pb.PlanMissionResponse(plan=wire.mission_plan_to_proto(result))

    @override
    async def UploadMission(self, request: pb.UploadMissionRequest, context: object) -> pb.UploadMissionResponse:
        result = await answer(
            await asyncio.to_thread(
                lambda: self._of_vehicle.upload(
                    **requests.upload_mission_arguments(request), lease_id=lease_of(context)
                )
            ),
            "UploadMission",
        )
        return pb.UploadMissionResponse(mission=wire.stored_mission_to_proto(result))

    @override
    async def DownloadMission(self, request: pb.DownloadMissionRequest, context: object) -> pb.DownloadMissionResponse:
        result = await answer(self._of_vehicle.download(), "DownloadMission")
        return pb.DownloadMissionResponse(mission=wire.stored_mission_to_proto(result))

    @override
    async def ClearMission(self, request: pb.ClearMissionRequest, context: object) -> pb.ClearMissionResponse:
        await answer(
            await asyncio.to_thread(lambda: self._of_vehicle.clear(lease_id=lease_of(context))), "ClearMission"
        )
        return pb.ClearMissionResponse()

    @override
    async def StartMission(self, request: pb.StartMissionRequest, context: object) -> pb.StartMissionResponse:
        result = await answer(
            self._of_vehicle.start(**requests.start_mission_arguments(request), lease_id=lease_of(context)),
            "StartMission",
        )
        return pb.StartMissionResponse(task=uav.task_info_to_proto(result))

    @override
    async def PauseMission(self, request: pb.PauseMissionRequest, context: object) -> pb.PauseMissionResponse:
        self._of_vehicle.pause(lease_id=lease_of(context))
        return pb.PauseMissionResponse()

    @override
    async def ResumeMission(self, request: pb.ResumeMissionRequest, context: object) -> pb.ResumeMissionResponse:
        self._of_vehicle.resume(lease_id=lease_of(context))
        return pb.ResumeMissionResponse()

    @override
    async def JumpToItem(self, request: pb.JumpToItemRequest, context: object) -> pb.JumpToItemResponse:
        await answer(self._of_vehicle.jump_to(item=request.item, lease_id=lease_of(context)), "JumpToItem")
        return pb.JumpToItemResponse()

    @override
    async def GetMissionProgress(
        self, request: pb.GetMissionProgressRequest, context: object
    ) -> pb.GetMissionProgressResponse:
        result = self._of_vehicle.progress()
        return pb.GetMissionProgressResponse(progress=wire.mission_progress_to_proto(result))

    @override
    async def WatchMission(
        self, request: pb.WatchMissionRequest, context: object
    ) -> AsyncIterator[pb.WatchMissionResponse]:
        async for result in answers(self._of_vehicle.watch(), "WatchMission"):
            yield pb.WatchMissionResponse(progress=wire.mission_progress_to_proto(result))
