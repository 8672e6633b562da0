"""The services and actions beside flying: which one each is, and what serves it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial, reduce
from pathlib import Path

from ual_msgs import action

import ual
from ual_ros2.beside import cameras, corrections, equipment, fence, gimbals, logs, missions, simulation
from ual_ros2.beside.corrections import Corrections
from ual_ros2.beside.fields import Fields
from ual_ros2.beside.filling import Filling
from ual_ros2.command import Action, Command, Serves, Service
from ual_ros2.derived.calls import CALLS
from ual_ros2.derived.services import SERVICES, SIMULATION
from ual_ros2.messages import Message


class Table:
    """All of one UAV.

    Args:
        filling: Fills the answers.
        corrections: Of which the status is told.
        log_directory: Where logs are downloaded to; None: nowhere.

    """

    def __init__(self, filling: Filling, corrections: Corrections, log_directory: Path | None) -> None:
        self._filling = filling
        self._corrections = corrections
        self._downloads = logs.Downloads(log_directory)
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

    def services(self) -> tuple[Command, ...]:
        """Returns the services that each UAV has."""
        return tuple(map(self._command, SERVICES))

    def simulation(self) -> tuple[Command, ...]:
        """Returns the services that a simulated UAV has beside."""
        return tuple(map(self._command, SIMULATION))

    def actions(self) -> tuple[Action, ...]:
        """Returns the actions."""
        fill = self._filling.filled
        return (
            Action(
                "fly_mission",
                action.FlyMission,
                self._flights.fly,
                told=self._told(action.FlyMission.Result),
                method="StartMission",
                also=lambda feedback, _: _put(fill, feedback, self._flights.progress_of(feedback.task_id)),
            ),
            Action(
                "download_log",
                action.DownloadLog,
                self._downloads.download,
                told=self._told(action.DownloadLog.Result),
                is_task=False,
                also=lambda feedback, goal: _put(fill, feedback, self._downloads.progress(goal)),
            ),
        )

    async def _get_corrections(self, uav: ual.aio.Uav, _: Message) -> Fields:
        return {"status": await corrections.get_status(uav, self._corrections)}

    def _command(self, service: Service) -> Command:
        return Command(
            service.name,
            service.kind,
            self._calls[service.name],
            partial(_frames, service.frames),
            self._told(service.kind.Response),
            method=service.method,
        )

    def _told(self, make: Callable[[], Message]) -> Callable[[Fields], Mapping[str, Message]]:
        def told(fields: Fields) -> Mapping[str, Message]:
            answer = self._filling.filled(make(), fields)
            return {name: getattr(answer, name) for name in fields}

        return told


def _put(fill: Callable[[Message, Fields], Message], message: Message, fields: Fields | None) -> bool:
    if fields is None:
        return False
    fill(message, fields)
    return True


def _frames(paths: Iterable[str], request: Message) -> Iterable[str]:
    """Returns the frames that a request is given in, by the paths of its fields."""
    return [str(reduce(getattr, path.split("."), request)) for path in paths]
