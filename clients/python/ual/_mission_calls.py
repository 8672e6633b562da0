"""Every call of `MissionService`; see `ual._calls`. ``make clients`` writes the members of both clients from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ual._calls import Call, built, of
from ual.missions import checks
from ual.missions.items import Item
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, StoredMission
from ual.types import TaskInfo
from ual.v1 import mission_pb2 as pb
from ual.wire import convert
from ual.wire import missions as wire


def plan(items: Sequence[Item]) -> Call[MissionPlan]:
    request = built(lambda: pb.PlanMissionRequest(items=_messages(items)), "items", items)
    return of("PlanMission", request, wire.plan_of_response)


def upload(items: Sequence[Item]) -> Call[StoredMission]:
    request = built(lambda: pb.UploadMissionRequest(items=_messages(items)), "items", items)
    return of("UploadMission", request, wire.stored_of_response)


def _messages(items: Sequence[Item]) -> list[pb.MissionItem]:
    """Makes the messages of items, if they are not too many."""
    checks.require_count(items)
    return wire.items_to_proto(items)


def download() -> Call[StoredMission]:
    request = pb.DownloadMissionRequest()
    return of("DownloadMission", request, wire.stored_of_response)


def clear() -> Call[None]:
    return of("ClearMission", pb.ClearMissionRequest(), _nothing)


def start(first_item: int, on_link_loss: LinkLossAction | None) -> Call[TaskInfo]:
    def make() -> pb.StartMissionRequest:
        if first_item == 0:  # which is none on the wire: it would begin with the first item
            raise ValueError("items are counted from 1")
        return pb.StartMissionRequest(first_item=first_item, on_link_loss=wire.link_loss_to_proto(on_link_loss))

    def read(response: pb.StartMissionResponse) -> TaskInfo:
        return convert.task_from_proto(response.task)

    request = built(make, "first_item", first_item)
    return of("StartMission", request, read)


def pause() -> Call[None]:
    return of("PauseMission", pb.PauseMissionRequest(), _nothing)


def resume() -> Call[None]:
    return of("ResumeMission", pb.ResumeMissionRequest(), _nothing)


def jump_to(item: int) -> Call[None]:
    request = built(lambda: pb.JumpToItemRequest(item=item), "item", item)
    return of("JumpToItem", request, _nothing)


def progress() -> Call[MissionProgress]:
    request = pb.GetMissionProgressRequest()
    return of("GetMissionProgress", request, wire.progress_of_response)


def watch() -> Call[MissionProgress]:
    return of("WatchMission", pb.WatchMissionRequest(), wire.progress_of_response)


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
