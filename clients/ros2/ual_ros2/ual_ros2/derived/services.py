"""The services and actions of the node. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from typing import Final

from std_srvs.srv import Trigger
from ual_msgs import action, srv

from ual_ros2.command import Service

FLYING: Final = (
    Service("list_frames", srv.ListFrames, "ListFrames"),
    Service("add_frame", srv.AddFrame, "AddFrame", ("transform.header.frame_id",)),
    Service("remove_frame", srv.RemoveFrame, "RemoveFrame"),
    Service("get_route", srv.GetRoute, "GetRoute"),
    Service("arm", Trigger, "Arm"),
    Service("disarm", Trigger, "Disarm"),
    Service("take_off", srv.TakeOff, "TakeOff"),
    Service("land", srv.Land, "Land"),
    Service("go_to_waypoint", srv.GoToWaypoint, "GoToWaypoint", ("waypoint.header.frame_id",)),
    Service("go_to_waypoint_geo", srv.GoToWaypointGeo, "GoToWaypointGeo"),
    Service("return_to_launch", srv.ReturnToLaunch, "ReturnToLaunch"),
    Service("set_pose", srv.SetPose, "SetPose", ("pose.header.frame_id",)),
    Service("set_velocity", srv.SetVelocity, "SetVelocity", ("velocity.header.frame_id",)),
    Service("set_external_pose", srv.SetExternalPose, "SetExternalPose"),
    Service("take_control", srv.TakeControl, "RecoverFromManual"),
    Service("set_home", srv.SetHome, "SetHome"),
    Service("abort", srv.Abort, "Abort"),
    Service("pause", Trigger, "Pause"),
    Service("resume", Trigger, "Resume"),
    Service("get_task", srv.GetTask, "GetTask"),
)
"""Services of flights, and questions about a flight."""
TASKS: Final = (
    Service("take_off", action.TakeOff, "TakeOff"),
    Service("land", action.Land, "Land"),
    Service("go_to_waypoint", action.GoToWaypoint, "GoToWaypoint", ("waypoint.header.frame_id",)),
    Service("go_to_waypoint_geo", action.GoToWaypointGeo, "GoToWaypointGeo"),
    Service("follow_path", action.FollowPath, "FollowPath", ("point_of_interest.header.frame_id",)),
    Service("return_to_launch", action.ReturnToLaunch, "ReturnToLaunch"),
)
"""The actions that fly. Their names are those of services: ROS keeps the two apart."""
SERVICES: Final = (
    Service("list_cameras", srv.ListCameras, "ListCameras"),
    Service("get_camera_status", srv.GetCameraStatus, "GetCameraStatus"),
    Service("take_photo", srv.TakePhoto, "TakePhoto"),
    Service("start_photos", srv.StartPhotos, "StartPhotos"),
    Service("stop_photos", srv.OrderCamera, "StopPhotos"),
    Service("start_video", srv.OrderCamera, "StartVideo"),
    Service("stop_video", srv.OrderCamera, "StopVideo"),
    Service("set_camera_mode", srv.SetCameraMode, "SetCameraMode"),
    Service("set_camera_zoom", srv.SetCameraZoom, "SetCameraZoom"),
    Service("set_camera_focus", srv.SetCameraFocus, "SetCameraFocus"),
    Service("list_photos", srv.ListPhotos, "ListPhotos"),
    Service("list_video_streams", srv.ListVideoStreams, "ListVideoStreams"),
    Service("get_image", srv.GetImage, "GetImage"),
    Service("get_corrections_status", srv.GetCorrectionsStatus, "GetCorrectionsStatus"),
    Service("get_fence", srv.GetFence, "GetFence"),
    Service("upload_fence", srv.UploadFence, "UploadFence"),
    Service("clear_fence", srv.ClearFence, "ClearFence"),
    Service("enable_fence", srv.EnableFence, "EnableFence"),
    Service("list_gimbals", srv.ListGimbals, "ListGimbals"),
    Service("get_gimbal_status", srv.GetGimbalStatus, "GetGimbalStatus"),
    Service("set_gimbal_angles", srv.SetGimbalAngles, "SetGimbalAngles", ("frame_id",)),
    Service("set_gimbal_rates", srv.SetGimbalRates, "SetGimbalRates"),
    Service("point_gimbal", srv.PointGimbal, "PointGimbal", ("point.header.frame_id",)),
    Service("move_gimbal_to_neutral", srv.OrderGimbal, "MoveGimbalToNeutral"),
    Service("retract_gimbal", srv.OrderGimbal, "RetractGimbal"),
    Service("take_gimbal_control", srv.OrderGimbal, "TakeGimbalControl"),
    Service("release_gimbal_control", srv.OrderGimbal, "ReleaseGimbalControl"),
    Service("list_equipment", srv.ListEquipment, "GetEquipment"),
    Service("grip", srv.MoveGripper, "Grip"),
    Service("release", srv.MoveGripper, "Release"),
    Service("order_winch", srv.OrderWinch, "OrderWinch"),
    Service("set_servo", srv.SetServo, "SetServo"),
    Service("set_relay", srv.SetRelay, "SetRelay"),
    Service("list_logs", srv.ListLogs, "ListLogs"),
    Service("plan_mission", srv.PlanMission, "PlanMission"),
    Service("upload_mission", srv.UploadMission, "UploadMission"),
    Service("download_mission", srv.DownloadMission, "DownloadMission"),
    Service("clear_mission", Trigger, "ClearMission"),
    Service("fly_mission", srv.FlyMission, "StartMission"),
    Service("pause_mission", Trigger, "PauseMission"),
    Service("resume_mission", Trigger, "ResumeMission"),
    Service("jump_to_item", srv.JumpToItem, "JumpToItem"),
    Service("get_mission_progress", srv.GetMissionProgress, "GetMissionProgress"),
    Service("get_parachute_order", srv.GetParachuteOrder, "GetParachuteOrder"),
    Service("enable_parachute", Trigger, "EnableParachute"),
    Service("disable_parachute", Trigger, "DisableParachute"),
    Service("release_parachute", Trigger, "ReleaseParachute"),
    Service("get_parameter", srv.GetParameter, "GetParameter"),
    Service("list_parameters", srv.ListParameters, "ListParameters"),
    Service("set_parameter", srv.SetParameter, "SetParameter"),
)
"""Services other than flying."""
SIMULATION: Final = (
    Service("simulation/list_parts", srv.ListSimulationParts, "ListParts"),
    Service("simulation/pilot_arm", Trigger, "PilotArm"),
    Service("simulation/pilot_disarm", Trigger, "PilotDisarm"),
    Service("simulation/pilot_take_over", Trigger, "PilotTakeOver"),
    Service("simulation/pilot_move_sticks", srv.MoveSticks, "PilotMoveSticks"),
    Service("simulation/pilot_give_back", Trigger, "PilotGiveBack"),
    Service("simulation/begin_fault", srv.BeginFault, "BeginFault"),
    Service("simulation/end_fault", srv.EndFault, "EndFault"),
    Service("simulation/list_faults", srv.ListFaults, "ListFaults"),
    Service("simulation/set_speed_factor", srv.SetSpeedFactor, "SetSpeedFactor"),
    Service("simulation/step", srv.StepTime, "Step"),
    Service("simulation/set_noise", srv.SetNoise, "SetNoise"),
    Service("simulation/set_wind", srv.SetWind, "SetWind"),
    Service("simulation/place_on_ground", srv.PlaceOnGround, "PlaceOnGround"),
)
"""Additional services of a simulated UAV."""
