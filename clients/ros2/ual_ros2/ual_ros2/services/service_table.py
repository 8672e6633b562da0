"""The services and actions beside flying: which one each is, and what serves it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from ual_msgs import action

import ual
from ual_ros2.command import ActionCommand, RosCommand, Serves
from ual_ros2.derived.calls import CALLS
from ual_ros2.derived.services import SERVICES, SIMULATION
from ual_ros2.messages import Message
from ual_ros2.services import cameras, corrections, equipment, fence, gimbals, logs, missions, simulation
from ual_ros2.services.corrections import CorrectionsRelay
from ual_ros2.services.fields import Fields
from ual_ros2.services.filling import Filling


class ServiceTable:
    """All of one UAV.

    Args:
        filling: Fills the answers.
        corrections: Of which the status is told.
        log_directory: Where logs are downloaded to; None: nowhere.

    """

    def __init__(self, filling: Filling, corrections: CorrectionsRelay, log_directory: Path | None) -> None:
        self._filling = filling
        self._corrections = corrections
        self._downloads = logs.LogDownloads(log_directory)
        self._flights = missions.MissionFlights()
        self._calls: Mapping[str, Serves] = {
            **CALLS,
            "enable_fence": fence.enable,
            "fly_mission": self._flights.serve,
            "get_corrections_status": self._get_corrections,
            "get_gimbal_status": gimbals.get_status,
            "get_image": cameras.get_image,
            "list_equipment": equipment.list_all,
            "list_photos": cameras.list_photos,
            "order_winch": equipment.order_winch,
            "plan_mission": missions.plan,
            "simulation/list_faults": simulation.list_faults,
            "take_photo": cameras.take_photo,
            "upload_fence": fence.upload,
            "upload_mission": missions.upload,
        }

    def services(self) -> tuple[RosCommand, ...]:
        """Returns the services that each UAV has."""
        return tuple(self._filling.command(each, self._calls[each.name]) for each in SERVICES)

    def simulation(self) -> tuple[RosCommand, ...]:
        """Returns the services that a simulated UAV has beside."""
        return tuple(self._filling.command(each, self._calls[each.name]) for each in SIMULATION)

    def actions(self) -> tuple[ActionCommand, ...]:
        """Returns the actions."""
        fill = self._filling.filled
        return (
            ActionCommand(
                "fly_mission",
                action.FlyMission,
                self._flights.fly,
                told=self._filling.to_messages(action.FlyMission.Result),
                method="StartMission",
                also=lambda feedback, _: _put(fill, feedback, self._flights.progress_of(feedback.task_id)),
            ),
            ActionCommand(
                "download_log",
                action.DownloadLog,
                self._downloads.download,
                told=self._filling.to_messages(action.DownloadLog.Result),
                is_task=False,
                also=lambda feedback, goal: _put(fill, feedback, self._downloads.progress(goal)),
            ),
        )

    async def _get_corrections(self, uav: ual.aio.Uav, _: Message) -> Fields:
        return {"status": await corrections.get_status(uav, self._corrections)}


def _put(fill: Callable[[Message, Fields], Message], message: Message, fields: Fields | None) -> bool:
    if fields is None:
        return False
    fill(message, fields)
    return True
