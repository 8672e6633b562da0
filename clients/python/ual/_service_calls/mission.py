"""The calls of `ual.interface.Mission`. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Sequence

from ual._calls import Call, built, nothing, of, request
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, StoredMission
from ual.types import TaskInfo
from ual.v1 import mission_pb2 as pb
from ual.wire import mission as wire
from ual.wire import requests, uav


def plan(items: Sequence[Item]) -> Call[MissionPlan]:
    return of(
        "PlanMission",
        built(lambda: requests.plan_mission_request(items=items), "items", items),
        lambda response: wire.mission_plan_from_proto(response.plan),
    )


def upload(items: Sequence[Item]) -> Call[StoredMission]:
    return of(
        "UploadMission",
        built(lambda: requests.upload_mission_request(items=items), "items", items),
        lambda response: wire.stored_mission_from_proto(response.mission),
    )


def download() -> Call[StoredMission]:
    return of(
        "DownloadMission",
        pb.DownloadMissionRequest(),
        lambda response: wire.stored_mission_from_proto(response.mission),
    )


def clear() -> Call[None]:
    return of("ClearMission", pb.ClearMissionRequest(), nothing)


def start(first_item: int, on_link_loss: LinkLossAction | None) -> Call[TaskInfo]:
    return of(
        "StartMission",
        built(
            lambda: requests.start_mission_request(first_item=first_item, on_link_loss=on_link_loss),
            "first_item",
            first_item,
        ),
        lambda response: uav.task_info_from_proto(response.task),
    )


def pause() -> Call[None]:
    return of("PauseMission", pb.PauseMissionRequest(), nothing)


def resume() -> Call[None]:
    return of("ResumeMission", pb.ResumeMissionRequest(), nothing)


def jump_to(item: int) -> Call[None]:
    return of("JumpToItem", request(pb.JumpToItemRequest, item=item), nothing)


def progress() -> Call[MissionProgress]:
    return of(
        "GetMissionProgress",
        pb.GetMissionProgressRequest(),
        lambda response: wire.mission_progress_from_proto(response.progress),
    )


def watch() -> Call[MissionProgress]:
    return of(
        "WatchMission", pb.WatchMissionRequest(), lambda response: wire.mission_progress_from_proto(response.progress)
    )
