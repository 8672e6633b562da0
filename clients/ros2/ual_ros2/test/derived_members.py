"""The members of `ual.interface` that are services in ROS.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from derived_values import (
    ask_clear_fence,
    ask_clear_mission,
    ask_disable_parachute,
    ask_download_mission,
    ask_enable_parachute,
    ask_fly_mission,
    ask_get_camera_status,
    ask_get_corrections_status,
    ask_get_fence,
    ask_get_gimbal_status,
    ask_get_image,
    ask_get_mission_progress,
    ask_get_parachute_order,
    ask_get_parameter,
    ask_grip,
    ask_jump_to_item,
    ask_list_cameras,
    ask_list_equipment,
    ask_list_gimbals,
    ask_list_logs,
    ask_list_parameters,
    ask_list_photos,
    ask_list_video_streams,
    ask_move_gimbal_to_neutral,
    ask_order_winch,
    ask_pause_mission,
    ask_plan_mission,
    ask_point_gimbal,
    ask_release,
    ask_release_gimbal_control,
    ask_release_parachute,
    ask_resume_mission,
    ask_retract_gimbal,
    ask_set_camera_focus,
    ask_set_camera_mode,
    ask_set_camera_zoom,
    ask_set_gimbal_angles,
    ask_set_gimbal_rates,
    ask_set_parameter,
    ask_set_relay,
    ask_set_servo,
    ask_simulation_begin_fault,
    ask_simulation_end_fault,
    ask_simulation_list_faults,
    ask_simulation_list_parts,
    ask_simulation_pilot_arm,
    ask_simulation_pilot_disarm,
    ask_simulation_pilot_give_back,
    ask_simulation_pilot_move_sticks,
    ask_simulation_pilot_take_over,
    ask_simulation_place_on_ground,
    ask_simulation_set_noise,
    ask_simulation_set_speed_factor,
    ask_simulation_set_wind,
    ask_simulation_step,
    ask_start_photos,
    ask_start_video,
    ask_stop_photos,
    ask_stop_video,
    ask_take_gimbal_control,
    ask_take_photo,
    ask_upload_mission,
    read_camera,
    read_camera_status,
    read_corrections_status,
    read_gimbal,
    read_gimbal_status,
    read_kept_fence,
    read_log,
    read_mission_progress,
    read_parameter,
    read_photo,
    read_task,
    read_video_stream,
)
from reading import Member, nothing
from std_srvs.srv import Trigger
from ual_msgs import srv

import ual
import ual.interface
import ual.missions.plan
import ual.simulation
from ual_ros2.derived.values import read_fault, read_mission_item

MEMBERS: Final[Mapping[tuple[str, str], Member]] = {
    ("cameras", "get_all"): Member(
        srv.ListCameras, "list_cameras", ask_list_cameras, lambda answer: list(map(read_camera, answer.cameras))
    ),
    ("camera", "status"): Member(
        srv.GetCameraStatus,
        "get_camera_status",
        ask_get_camera_status,
        lambda answer: read_camera_status(answer.status),
    ),
    ("camera", "take_photo"): Member(
        srv.TakePhoto, "take_photo", ask_take_photo, lambda answer: read_photo(answer.photo)
    ),
    ("camera", "start_photos"): Member(srv.StartPhotos, "start_photos", ask_start_photos, nothing),
    ("camera", "stop_photos"): Member(srv.OrderCamera, "stop_photos", ask_stop_photos, nothing),
    ("camera", "start_video"): Member(srv.OrderCamera, "start_video", ask_start_video, nothing),
    ("camera", "stop_video"): Member(srv.OrderCamera, "stop_video", ask_stop_video, nothing),
    ("camera", "set_mode"): Member(srv.SetCameraMode, "set_camera_mode", ask_set_camera_mode, nothing),
    ("camera", "set_zoom"): Member(srv.SetCameraZoom, "set_camera_zoom", ask_set_camera_zoom, nothing),
    ("camera", "set_focus"): Member(srv.SetCameraFocus, "set_camera_focus", ask_set_camera_focus, nothing),
    ("camera", "photos"): Member(
        srv.ListPhotos, "list_photos", ask_list_photos, lambda answer: list(map(read_photo, answer.photos))
    ),
    ("camera", "streams"): Member(
        srv.ListVideoStreams,
        "list_video_streams",
        ask_list_video_streams,
        lambda answer: list(map(read_video_stream, answer.streams)),
    ),
    ("camera", "image"): Member(srv.GetImage, "get_image", ask_get_image, nothing),
    ("corrections", "status"): Member(
        srv.GetCorrectionsStatus,
        "get_corrections_status",
        ask_get_corrections_status,
        lambda answer: read_corrections_status(answer.status),
    ),
    ("fence", "get"): Member(srv.GetFence, "get_fence", ask_get_fence, lambda answer: read_kept_fence(answer.fence)),
    ("fence", "clear"): Member(
        srv.ClearFence, "clear_fence", ask_clear_fence, lambda answer: read_kept_fence(answer.fence)
    ),
    ("gimbals", "get_all"): Member(
        srv.ListGimbals, "list_gimbals", ask_list_gimbals, lambda answer: list(map(read_gimbal, answer.gimbals))
    ),
    ("gimbal", "status"): Member(
        srv.GetGimbalStatus,
        "get_gimbal_status",
        ask_get_gimbal_status,
        lambda answer: read_gimbal_status(answer.status),
    ),
    ("gimbal", "set_angles"): Member(srv.SetGimbalAngles, "set_gimbal_angles", ask_set_gimbal_angles, nothing),
    ("gimbal", "set_rates"): Member(srv.SetGimbalRates, "set_gimbal_rates", ask_set_gimbal_rates, nothing),
    ("gimbal", "point_at"): Member(srv.PointGimbal, "point_gimbal", ask_point_gimbal, nothing),
    ("gimbal", "move_to_neutral"): Member(
        srv.OrderGimbal, "move_gimbal_to_neutral", ask_move_gimbal_to_neutral, nothing
    ),
    ("gimbal", "retract"): Member(srv.OrderGimbal, "retract_gimbal", ask_retract_gimbal, nothing),
    ("gimbal", "take_control"): Member(srv.OrderGimbal, "take_gimbal_control", ask_take_gimbal_control, nothing),
    ("gimbal", "release_control"): Member(
        srv.OrderGimbal, "release_gimbal_control", ask_release_gimbal_control, nothing
    ),
    ("gripper", "get_all"): Member(srv.ListEquipment, "list_equipment", ask_list_equipment, nothing),
    ("gripper", "grip"): Member(srv.MoveGripper, "grip", ask_grip, nothing),
    ("gripper", "release"): Member(srv.MoveGripper, "release", ask_release, nothing),
    ("gripper", "order_winch"): Member(srv.OrderWinch, "order_winch", ask_order_winch, nothing),
    ("gripper", "set_servo"): Member(srv.SetServo, "set_servo", ask_set_servo, nothing),
    ("gripper", "set_relay"): Member(srv.SetRelay, "set_relay", ask_set_relay, nothing),
    ("logs", "get_all"): Member(
        srv.ListLogs, "list_logs", ask_list_logs, lambda answer: list(map(read_log, answer.logs))
    ),
    ("mission", "plan"): Member(
        srv.PlanMission,
        "plan_mission",
        ask_plan_mission,
        lambda answer: ual.missions.plan.MissionPlan(
            length_m=answer.length,
            duration_s=answer.duration,
            lowest_m=answer.lowest,
            highest_m=answer.highest,
            executed_count=answer.executed_count,
        ),
    ),
    ("mission", "upload"): Member(
        srv.UploadMission,
        "upload_mission",
        ask_upload_mission,
        lambda answer: ual.missions.plan.StoredMission(
            items=tuple(map(read_mission_item, answer.items)), digest=answer.digest
        ),
    ),
    ("mission", "download"): Member(
        srv.DownloadMission,
        "download_mission",
        ask_download_mission,
        lambda answer: ual.missions.plan.StoredMission(
            items=tuple(map(read_mission_item, answer.items)), digest=answer.digest
        ),
    ),
    ("mission", "clear"): Member(Trigger, "clear_mission", ask_clear_mission, nothing),
    ("mission", "start"): Member(srv.FlyMission, "fly_mission", ask_fly_mission, lambda answer: read_task(answer.task)),
    ("mission", "pause"): Member(Trigger, "pause_mission", ask_pause_mission, nothing),
    ("mission", "resume"): Member(Trigger, "resume_mission", ask_resume_mission, nothing),
    ("mission", "jump_to"): Member(srv.JumpToItem, "jump_to_item", ask_jump_to_item, nothing),
    ("mission", "progress"): Member(
        srv.GetMissionProgress,
        "get_mission_progress",
        ask_get_mission_progress,
        lambda answer: read_mission_progress(answer.progress),
    ),
    ("parachute", "ordered"): Member(
        srv.GetParachuteOrder, "get_parachute_order", ask_get_parachute_order, lambda answer: answer.ordered
    ),
    ("parachute", "enable"): Member(Trigger, "enable_parachute", ask_enable_parachute, nothing),
    ("parachute", "disable"): Member(Trigger, "disable_parachute", ask_disable_parachute, nothing),
    ("parachute", "release"): Member(Trigger, "release_parachute", ask_release_parachute, nothing),
    ("parameters", "get"): Member(
        srv.GetParameter, "get_parameter", ask_get_parameter, lambda answer: read_parameter(answer.parameter)
    ),
    ("parameters", "get_all"): Member(
        srv.ListParameters,
        "list_parameters",
        ask_list_parameters,
        lambda answer: list(map(read_parameter, answer.parameters)),
    ),
    ("parameters", "set"): Member(
        srv.SetParameter, "set_parameter", ask_set_parameter, lambda answer: read_parameter(answer.parameter)
    ),
    ("simulation", "parts"): Member(
        srv.ListSimulationParts,
        "simulation/list_parts",
        ask_simulation_list_parts,
        lambda answer: frozenset(ual.simulation.SimulationPart[each] for each in answer.parts),
    ),
    ("simulation", "pilot_arm"): Member(Trigger, "simulation/pilot_arm", ask_simulation_pilot_arm, nothing),
    ("simulation", "pilot_disarm"): Member(Trigger, "simulation/pilot_disarm", ask_simulation_pilot_disarm, nothing),
    ("simulation", "pilot_take_over"): Member(
        Trigger, "simulation/pilot_take_over", ask_simulation_pilot_take_over, nothing
    ),
    ("simulation", "pilot_move_sticks"): Member(
        srv.MoveSticks, "simulation/pilot_move_sticks", ask_simulation_pilot_move_sticks, nothing
    ),
    ("simulation", "pilot_give_back"): Member(
        Trigger, "simulation/pilot_give_back", ask_simulation_pilot_give_back, nothing
    ),
    ("simulation", "begin_fault"): Member(
        srv.BeginFault, "simulation/begin_fault", ask_simulation_begin_fault, lambda answer: answer.fault_id
    ),
    ("simulation", "end_fault"): Member(srv.EndFault, "simulation/end_fault", ask_simulation_end_fault, nothing),
    ("simulation", "faults"): Member(
        srv.ListFaults,
        "simulation/list_faults",
        ask_simulation_list_faults,
        lambda answer: list(map(read_fault, answer.faults)),
    ),
    ("simulation", "set_speed_factor"): Member(
        srv.SetSpeedFactor, "simulation/set_speed_factor", ask_simulation_set_speed_factor, nothing
    ),
    ("simulation", "step"): Member(srv.StepTime, "simulation/step", ask_simulation_step, nothing),
    ("simulation", "set_noise"): Member(srv.SetNoise, "simulation/set_noise", ask_simulation_set_noise, nothing),
    ("simulation", "set_wind"): Member(srv.SetWind, "simulation/set_wind", ask_simulation_set_wind, nothing),
    ("simulation", "place_on_ground"): Member(
        srv.PlaceOnGround, "simulation/place_on_ground", ask_simulation_place_on_ground, nothing
    ),
}


class ServiceMembers(ual.interface.Uav):
    """A UAV with its services beside flying."""

    _services: Any

    @property
    def parameters(self) -> ual.interface.Parameters:
        found: ual.interface.Parameters = self._services.parameters
        return found

    @property
    def mission(self) -> ual.interface.Mission:
        found: ual.interface.Mission = self._services.mission
        return found

    @property
    def cameras(self) -> ual.interface.Cameras:
        found: ual.interface.Cameras = self._services.cameras
        return found

    @property
    def gimbals(self) -> ual.interface.Gimbals:
        found: ual.interface.Gimbals = self._services.gimbals
        return found

    @property
    def corrections(self) -> ual.interface.Corrections:
        found: ual.interface.Corrections = self._services.corrections
        return found

    @property
    def fence(self) -> ual.interface.Fence:
        found: ual.interface.Fence = self._services.fence
        return found

    @property
    def gripper(self) -> ual.interface.Gripper:
        found: ual.interface.Gripper = self._services.gripper
        return found

    @property
    def parachute(self) -> ual.interface.Parachute:
        found: ual.interface.Parachute = self._services.parachute
        return found

    @property
    def logs(self) -> ual.interface.Logs:
        found: ual.interface.Logs = self._services.logs
        return found
