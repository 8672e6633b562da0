"""The services and actions beside flying: which one each is, and what serves it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from std_srvs.srv import Trigger
from ual_msgs import action, srv

import ual
from ual_ros2.beside import cameras, corrections, equipment, fence, gimbals, logs, missions, parameters, simulation
from ual_ros2.beside.corrections import Corrections
from ual_ros2.beside.fields import Fields
from ual_ros2.beside.filling import Filling
from ual_ros2.command import Action, Command
from ual_ros2.messages import Entity, Message

Serves = Callable[[ual.aio.Uav, Message], Awaitable[Any]]


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

    def services(self) -> tuple[Command, ...]:
        """Returns the services that each UAV has."""
        return (
            *self._of_parameters(),
            *self._of_gimbals(),
            *self._of_cameras(),
            *self._of_equipment(),
            *self._of_missions(),
            *self._of_others(),
        )

    def simulation(self) -> tuple[Command, ...]:
        """Returns the services that a simulated UAV has beside."""
        return (
            self._asks("simulation/list_parts", srv.ListSimulationParts, simulation.list_parts),
            self._asks("simulation/begin_fault", srv.BeginFault, simulation.begin_fault),
            self._asks("simulation/list_faults", srv.ListFaults, simulation.list_faults),
            _of_world("pilot_arm", Trigger, lambda uav, _: uav.simulation.pilot_arm()),
            _of_world("pilot_disarm", Trigger, lambda uav, _: uav.simulation.pilot_disarm()),
            _of_world("pilot_take_over", Trigger, lambda uav, _: uav.simulation.pilot_take_over()),
            _of_world("pilot_give_back", Trigger, lambda uav, _: uav.simulation.pilot_give_back()),
            _of_world("pilot_move_sticks", srv.MoveSticks, simulation.move_sticks),
            _of_world("end_fault", srv.EndFault, lambda uav, it: uav.simulation.end_fault(it.fault_id)),
            _of_world(
                "set_speed_factor",
                srv.SetSpeedFactor,
                lambda uav, it: uav.simulation.set_speed_factor(it.speed_factor),
            ),
            _of_world("step", srv.StepTime, lambda uav, it: uav.simulation.step(it.duration)),
            _of_world("set_noise", srv.SetNoise, simulation.set_noise),
            _of_world("set_wind", srv.SetWind, simulation.set_wind),
            _of_world("place_on_ground", srv.PlaceOnGround, simulation.place),
        )

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

    def _of_parameters(self) -> Iterable[Command]:
        return (
            self._asks("get_parameter", srv.GetParameter, parameters.get),
            self._asks("list_parameters", srv.ListParameters, parameters.list_all),
            self._asks("set_parameter", srv.SetParameter, parameters.write),
        )

    def _of_gimbals(self) -> Iterable[Command]:
        return (
            self._asks("list_gimbals", srv.ListGimbals, gimbals.list_all),
            self._asks("get_gimbal_status", srv.GetGimbalStatus, gimbals.get_status),
            Command("set_gimbal_angles", srv.SetGimbalAngles, gimbals.set_angles, _of_angles),
            Command("set_gimbal_rates", srv.SetGimbalRates, gimbals.set_rates),
            Command("point_gimbal", srv.PointGimbal, gimbals.point, _of_point),
            *(
                Command(name, srv.OrderGimbal, order)
                for name, order in (
                    ("move_gimbal_to_neutral", lambda uav, it: uav.gimbals[it.gimbal].move_to_neutral()),
                    ("retract_gimbal", lambda uav, it: uav.gimbals[it.gimbal].retract()),
                    ("take_gimbal_control", lambda uav, it: uav.gimbals[it.gimbal].take_control()),
                    ("release_gimbal_control", lambda uav, it: uav.gimbals[it.gimbal].release_control()),
                )
            ),
        )

    def _of_cameras(self) -> Iterable[Command]:
        return (
            self._asks("list_cameras", srv.ListCameras, cameras.list_all),
            self._asks("get_camera_status", srv.GetCameraStatus, cameras.get_status),
            self._asks("take_photo", srv.TakePhoto, cameras.take_photo),
            self._asks("list_photos", srv.ListPhotos, cameras.list_photos),
            self._asks("list_video_streams", srv.ListVideoStreams, cameras.list_streams),
            self._asks("get_image", srv.GetImage, cameras.get_image),
            Command("set_camera_mode", srv.SetCameraMode, cameras.set_mode),
            Command("set_camera_zoom", srv.SetCameraZoom, cameras.set_zoom),
            Command("set_camera_focus", srv.SetCameraFocus, cameras.set_focus),
            Command("start_photos", srv.StartPhotos, cameras.start_photos),
            *(
                Command(name, srv.OrderCamera, order)
                for name, order in (
                    ("stop_photos", lambda uav, it: uav.cameras[it.camera].stop_photos()),
                    ("start_video", lambda uav, it: uav.cameras[it.camera].start_video()),
                    ("stop_video", lambda uav, it: uav.cameras[it.camera].stop_video()),
                )
            ),
        )

    def _of_equipment(self) -> Iterable[Command]:
        return (
            self._asks("list_equipment", srv.ListEquipment, equipment.list_all, "GetEquipment"),
            Command("grip", srv.MoveGripper, lambda uav, it: uav.gripper.grip(it.gripper)),
            Command("release", srv.MoveGripper, lambda uav, it: uav.gripper.release(it.gripper)),
            Command("order_winch", srv.OrderWinch, equipment.order_winch),
            Command("set_servo", srv.SetServo, equipment.set_servo),
            Command("set_relay", srv.SetRelay, lambda uav, it: uav.gripper.set_relay(it.state, relay=it.relay)),
        )

    def _of_missions(self) -> Iterable[Command]:
        return (
            self._asks("plan_mission", srv.PlanMission, missions.plan),
            self._asks("upload_mission", srv.UploadMission, missions.upload),
            self._asks("download_mission", srv.DownloadMission, missions.download),
            Command("clear_mission", Trigger, lambda uav, _: uav.mission.clear()),
            self._asks("fly_mission", srv.FlyMission, self._flights.serve, "StartMission"),
            Command("pause_mission", Trigger, lambda uav, _: uav.mission.pause()),
            Command("resume_mission", Trigger, lambda uav, _: uav.mission.resume()),
            Command("jump_to_item", srv.JumpToItem, lambda uav, it: uav.mission.jump_to(it.item)),
            self._asks("get_mission_progress", srv.GetMissionProgress, missions.get_progress),
        )

    def _of_others(self) -> Iterable[Command]:
        return (
            self._asks("get_fence", srv.GetFence, fence.get),
            self._asks("upload_fence", srv.UploadFence, fence.upload),
            self._asks("clear_fence", srv.ClearFence, fence.clear),
            self._asks("enable_fence", srv.EnableFence, fence.enable),
            self._asks("list_logs", srv.ListLogs, logs.list_all),
            self._asks("get_corrections_status", srv.GetCorrectionsStatus, self._get_corrections),
        )

    async def _get_corrections(self, uav: ual.aio.Uav, _: Message) -> Fields:
        return {"status": await corrections.get_status(uav, self._corrections)}

    def _asks(self, name: str, kind: Entity, serve: Serves, method: str = "") -> Command:
        """Returns a service that answers with fields."""
        return Command(name, kind, serve, told=self._told(kind.Response), method=method)

    def _told(self, make: Callable[[], Message]) -> Callable[[Fields], Mapping[str, Message]]:
        def told(fields: Fields) -> Mapping[str, Message]:
            answer = self._filling.filled(make(), fields)
            return {name: getattr(answer, name) for name in fields}

        return told


def _of_world(name: str, kind: Entity, serve: Serves) -> Command:
    """Returns a service that changes the simulated world, of which no lease has a say."""
    return Command(f"simulation/{name}", kind, serve)


def _put(fill: Callable[[Message, Fields], Message], message: Message, fields: Fields | None) -> bool:
    if fields is None:
        return False
    fill(message, fields)
    return True


def _of_point(request: Message) -> Iterable[str]:
    return (request.point.header.frame_id,)


def _of_angles(request: Message) -> Iterable[str]:
    return (request.frame_id,)
