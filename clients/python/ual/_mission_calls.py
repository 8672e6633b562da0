"""Every call of `MissionService`; see `ual._calls`. ``make clients`` writes the members of both clients from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ual._calls import Call, Service, built
from ual.missions import checks
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, StoredMission
from ual.types import TaskInfo
from ual.v1 import mission_pb2 as pb
from ual.wire import convert
from ual.wire import missions as wire

TRANSFER_S = 1300.0
"""How long a transfer may take: the daemon gives up before, also where it waits for others."""
START_S = 700.0
"""How long a start may take: the mission is read first."""
JUMP_S = 15.0
_NOT_KNOWN = "it is not known what the autopilot has now: download it"
_MAY_FLY = "if it reached the UAV it may fly the mission: ask for the state"


def plan(items: Sequence[Item]) -> Call[MissionPlan]:
    request = built(lambda: pb.PlanMissionRequest(items=_messages(items)), "items", items)
    return Call(Service.MISSION, "PlanMission", request, wire.plan_of_response)


def upload(items: Sequence[Item]) -> Call[StoredMission]:
    request = built(lambda: pb.UploadMissionRequest(items=_messages(items)), "items", items)
    return Call(Service.MISSION, "UploadMission", request, wire.stored_of_response, TRANSFER_S, _NOT_KNOWN)


def _messages(items: Sequence[Item]) -> list[pb.MissionItem]:
    """Makes the messages of items, if they are not too many."""
    checks.require_count(items)
    return wire.items_to_proto(items)


def download() -> Call[StoredMission]:
    request = pb.DownloadMissionRequest()
    return Call(Service.MISSION, "DownloadMission", request, wire.stored_of_response, TRANSFER_S)


def clear() -> Call[None]:
    return Call(Service.MISSION, "ClearMission", pb.ClearMissionRequest(), _nothing, TRANSFER_S, _NOT_KNOWN)


def start(first_item: int, on_link_loss: LinkLossAction | None) -> Call[TaskInfo]:
    def make() -> pb.StartMissionRequest:
        if first_item == 0:  # which is none on the wire: it would begin with the first item
            raise ValueError("items are counted from 1")
        return pb.StartMissionRequest(first_item=first_item, on_link_loss=wire.link_loss_to_proto(on_link_loss))

    def read(response: pb.StartMissionResponse) -> TaskInfo:
        return convert.task_from_proto(response.task)

    request = built(make, "first_item", first_item)
    return Call(Service.MISSION, "StartMission", request, read, START_S, _MAY_FLY)


def pause() -> Call[None]:
    return Call(Service.MISSION, "PauseMission", pb.PauseMissionRequest(), _nothing)


def resume() -> Call[None]:
    return Call(Service.MISSION, "ResumeMission", pb.ResumeMissionRequest(), _nothing)


def jump_to(item: int) -> Call[None]:
    request = built(lambda: pb.JumpToItemRequest(item=item), "item", item)
    return Call(Service.MISSION, "JumpToItem", request, _nothing, JUMP_S, _MAY_FLY)


def progress() -> Call[MissionProgress]:
    request = pb.GetMissionProgressRequest()
    return Call(Service.MISSION, "GetMissionProgress", request, wire.progress_of_response)


def watch() -> Call[MissionProgress]:
    return Call(Service.MISSION, "WatchMission", pb.WatchMissionRequest(), wire.progress_of_response, None)


def _nothing(_: object) -> None:
    return None


MEMBERS: Mapping[str, Callable[..., Call[Any]]] = {
    "plan": plan,
    "upload": upload,
    "download": download,
    "clear": clear,
    "start": start,
    "pause": pause,
    "resume": resume,
    "jump_to": jump_to,
    "progress": progress,
    "watch": watch,
}
"""The members of `ual.interface.Mission`, each with its call. Those that return an iterator are streams."""
