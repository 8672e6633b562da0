"""Missions of the autopilot by the services and the action of the node."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from flying import Client, each_of
from ual_msgs import msg, srv

import ual
from ual.interface import Mission
from ual.missions import Item, LinkLossAction, MissionPlan, MissionProgress, MissionStage, StoredMission
from ual_ros2.beside.filling import Filling
from ual_ros2.beside.mission_items import item_fields, items
from ual_ros2.ros_time import RosTime

Call = Callable[..., Any]


class RosMission(Mission):
    """The mission of one UAV.

    Args:
        client: The program in ROS.
        ns: The name of the UAV.
        call: Calls a service.
        trigger: Calls one that has no request.
        fly: Begins the action.

    """

    def __init__(
        self,
        client: Client,
        ns: str,
        call: Call,
        trigger: Callable[[str], None],
        fly: Callable[[dict[str, Any]], ual.TaskInfo],
    ) -> None:
        self._client = client
        self._topic = f"/{ns}/ual/mission"
        self._call = call
        self._trigger = trigger
        self._fly = fly
        self._filling = Filling(RosTime(client.node.get_clock()))

    def plan(self, items: Sequence[Item]) -> MissionPlan:
        found = self._call(srv.PlanMission, "plan_mission", items=self._messages(items))
        return MissionPlan(found.length, found.duration, found.lowest, found.highest, found.executed_count)

    def upload(self, items: Sequence[Item]) -> StoredMission:
        return _stored(self._call(srv.UploadMission, "upload_mission", items=self._messages(items)))

    def download(self) -> StoredMission:
        return _stored(self._call(srv.DownloadMission, "download_mission"))

    def clear(self) -> None:
        self._trigger("clear_mission")

    def start(self, first_item: int = 1, on_link_loss: LinkLossAction | None = None) -> ual.TaskInfo:
        if first_item == 0:  # which begins with the first one in ROS, as in the contract
            raise ual.InvalidArgumentError("first_item: items are counted from 1", {"field": "first_item"})
        what = "" if on_link_loss is None else on_link_loss.name
        return self._fly({"first_item": first_item, "on_link_loss": what})

    def pause(self) -> None:
        self._trigger("pause_mission")

    def resume(self) -> None:
        self._trigger("resume_mission")

    def jump_to(self, item: int) -> None:
        self._call(srv.JumpToItem, "jump_to_item", item=item)

    def progress(self) -> MissionProgress:
        return _progress(self._call(srv.GetMissionProgress, "get_mission_progress").progress)

    def watch(self) -> Iterator[MissionProgress]:
        newest = None
        for told in each_of(self._client.hear(msg.MissionProgress, self._topic, 10)):
            if (progress := _progress(told)) != newest:
                newest = progress
                yield progress

    def _messages(self, items: Sequence[Item]) -> list[Any]:
        return [self._filling.filled(msg.MissionItem(), item_fields(each)) for each in items]


def _stored(answer: Any) -> StoredMission:
    return StoredMission(tuple(items(answer.items)), answer.digest)


def _progress(message: Any) -> MissionProgress:
    stage = MissionStage[message.stage]
    return MissionProgress(stage, message.item or None, message.reached or None, message.task_id)
