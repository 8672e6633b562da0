"""The calls of the node that follow from the contract.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from collections.abc import Awaitable, Mapping
from typing import Final

import ual
import ual.aio
import ual.cameras
import ual.gimbals
from ual_ros2 import paths, values
from ual_ros2.command import Flies, Flyer, Serves
from ual_ros2.derived.values import (
    camera_fields,
    camera_status_fields,
    frame_fields,
    gimbal_fields,
    kept_fence_fields,
    log_fields,
    mission_item_fields,
    mission_progress_fields,
    parameter_fields,
    read_fault,
    video_stream_fields,
)
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields, named, names_of


async def list_frames(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListFrames."""
    found = await uav.frames()
    return {
        "frames": [frame_fields(each) for each in found],
    }


async def add_frame(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves AddFrame."""
    await uav.add_frame(
        transform=values.transform_stamped(request.transform, values.stamp_s(request.transform.header.stamp))
    )
    return {}


async def remove_frame(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves RemoveFrame."""
    await uav.remove_frame(frame_id=request.frame_id)
    return {}


async def arm(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.arm()
    return {}


async def disarm(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.disarm()
    return {}


async def take_off(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves TakeOff."""
    begun = await uav.take_off(height_m=request.height, blocking=request.blocking)
    return {"task_id": begun.id}


async def land(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves Land."""
    begun = await uav.land(blocking=request.blocking)
    return {"task_id": begun.id}


async def go_to_waypoint(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GoToWaypoint."""
    begun = await uav.go_to_waypoint(waypoint=values.pose_stamped(request.waypoint), blocking=request.blocking)
    return {"task_id": begun.id}


async def go_to_waypoint_geo(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GoToWaypointGeo."""
    begun = await uav.go_to_waypoint_geo(
        latitude_deg=request.waypoint.latitude,
        longitude_deg=request.waypoint.longitude,
        altitude_m=request.waypoint.altitude,
        altitude_reference=values.altitude_reference(request.altitude_reference),
        blocking=request.blocking,
    )
    return {"task_id": begun.id}


async def return_to_launch(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves ReturnToLaunch."""
    begun = await uav.return_to_launch(height_m=request.height or None, blocking=request.blocking)
    return {"task_id": begun.id}


async def set_external_pose(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetExternalPose."""
    await uav.set_external_pose(
        pose=values.pose_stamped(request.pose, stamp_s=values.stamp_s(request.pose.header.stamp)),
        position_std_dev_m=request.position_std_dev if request.has_position_std_dev else None,
        orientation_std_dev_rad=request.orientation_std_dev if request.has_orientation_std_dev else None,
    )
    return {}


async def set_home(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetHome."""
    await uav.set_home(set_z=request.set_z)
    return {}


async def abort(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves Abort."""
    await uav.abort(freeze=request.freeze)
    return {}


async def pause(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.pause()
    return {}


async def resume(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.resume()
    return {}


async def list_cameras(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListCameras."""
    found = await uav.cameras.get_all()
    return {
        "cameras": [camera_fields(each) for each in found],
    }


async def get_camera_status(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetCameraStatus."""
    found = await uav.cameras[request.camera].status()
    return {
        "status": camera_status_fields(found),
    }


async def start_photos(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves StartPhotos."""
    await uav.cameras[request.camera].start_photos(
        interval_s=request.interval or None, distance_m=request.distance or None, count=request.count
    )
    return {}


async def stop_photos(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderCamera."""
    await uav.cameras[request.camera].stop_photos()
    return {}


async def start_video(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderCamera."""
    await uav.cameras[request.camera].start_video()
    return {}


async def stop_video(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderCamera."""
    await uav.cameras[request.camera].stop_video()
    return {}


async def set_camera_mode(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetCameraMode."""
    await uav.cameras[request.camera].set_mode(mode=named(ual.cameras.CameraMode, request.mode, "mode"))
    return {}


async def set_camera_zoom(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetCameraZoom."""
    await uav.cameras[request.camera].set_zoom(percent=100.0 * request.zoom)
    return {}


async def set_camera_focus(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetCameraFocus."""
    await uav.cameras[request.camera].set_focus(percent=None if request.is_automatic else 100.0 * request.focus)
    return {}


async def list_video_streams(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves ListVideoStreams."""
    found = await uav.cameras[request.camera].streams()
    return {
        "streams": [video_stream_fields(each) for each in found],
    }


async def get_fence(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves GetFence."""
    found = await uav.fence.get()
    return {
        "fence": kept_fence_fields(found),
    }


async def clear_fence(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves ClearFence."""
    found = await uav.fence.clear(with_rally_points=request.with_rally_points, force=request.force)
    return {
        "fence": kept_fence_fields(found),
    }


async def list_gimbals(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListGimbals."""
    found = await uav.gimbals.get_all()
    return {
        "gimbals": [gimbal_fields(each) for each in found],
    }


async def set_gimbal_angles(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetGimbalAngles."""
    await uav.gimbals[request.gimbal].set_angles(
        pitch_rad=request.pitch,
        yaw_rad=request.yaw,
        roll_rad=request.roll,
        reference=named(
            ual.gimbals.GimbalReference, request.reference, "reference", ual.gimbals.GimbalReference.HORIZON
        ),
        frame_id=request.frame_id,
    )
    return {}


async def set_gimbal_rates(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetGimbalRates."""
    await uav.gimbals[request.gimbal].set_rates(pitch_rad_s=request.pitch, yaw_rad_s=request.yaw)
    return {}


async def point_gimbal(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves PointGimbal."""
    await uav.gimbals[request.gimbal].point_at(point=values.point_stamped(request.point))
    return {}


async def move_gimbal_to_neutral(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderGimbal."""
    await uav.gimbals[request.gimbal].move_to_neutral()
    return {}


async def retract_gimbal(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderGimbal."""
    await uav.gimbals[request.gimbal].retract()
    return {}


async def take_gimbal_control(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderGimbal."""
    await uav.gimbals[request.gimbal].take_control()
    return {}


async def release_gimbal_control(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves OrderGimbal."""
    await uav.gimbals[request.gimbal].release_control()
    return {}


async def grip(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves MoveGripper."""
    await uav.gripper.grip(gripper=request.gripper)
    return {}


async def release(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves MoveGripper."""
    await uav.gripper.release(gripper=request.gripper)
    return {}


async def set_servo(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetServo."""
    await uav.gripper.set_servo(position=request.position, servo=request.servo, pwm_us=request.pwm_us or None)
    return {}


async def set_relay(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetRelay."""
    await uav.gripper.set_relay(state=request.state, relay=request.relay)
    return {}


async def list_logs(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListLogs."""
    found = await uav.logs.get_all()
    return {
        "logs": [log_fields(each) for each in found],
    }


async def download_mission(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves DownloadMission."""
    found = await uav.mission.download()
    return {
        "items": [mission_item_fields(each) for each in found.items],
        "digest": found.digest,
    }


async def clear_mission(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.mission.clear()
    return {}


async def pause_mission(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.mission.pause()
    return {}


async def resume_mission(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.mission.resume()
    return {}


async def jump_to_item(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves JumpToItem."""
    await uav.mission.jump_to(item=request.item)
    return {}


async def get_mission_progress(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves GetMissionProgress."""
    found = await uav.mission.progress()
    return {
        "progress": mission_progress_fields(found),
    }


async def get_parachute_order(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves GetParachuteOrder."""
    found = await uav.parachute.ordered()
    return {
        "ordered": found,
    }


async def enable_parachute(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.parachute.enable()
    return {}


async def disable_parachute(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.parachute.disable()
    return {}


async def release_parachute(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.parachute.release()
    return {}


async def get_parameter(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves GetParameter."""
    found = await uav.parameters.get(name=request.name)
    return {
        "parameter": parameter_fields(found),
    }


async def list_parameters(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListParameters."""
    found = await uav.parameters.get_all()
    return {
        "parameters": [parameter_fields(each) for each in found],
    }


async def set_parameter(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetParameter."""
    found = await uav.parameters.set(name=request.name, value=request.value, force=request.force)
    return {
        "parameter": parameter_fields(found),
    }


async def simulation_list_parts(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves ListSimulationParts."""
    found = await uav.simulation.parts()
    return {
        "parts": names_of(found),
    }


async def simulation_pilot_arm(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.simulation.pilot_arm()
    return {}


async def simulation_pilot_disarm(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.simulation.pilot_disarm()
    return {}


async def simulation_pilot_take_over(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.simulation.pilot_take_over()
    return {}


async def simulation_pilot_move_sticks(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves MoveSticks."""
    await uav.simulation.pilot_move_sticks(forward=request.forward, left=request.left, up=request.up, turn=request.turn)
    return {}


async def simulation_pilot_give_back(uav: ual.aio.Uav, _: Message) -> Fields:
    """Serves Trigger."""
    await uav.simulation.pilot_give_back()
    return {}


async def simulation_begin_fault(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves BeginFault."""
    found = await uav.simulation.begin_fault(fault=read_fault(request.fault), duration_s=request.duration)
    return {
        "fault_id": found,
    }


async def simulation_end_fault(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves EndFault."""
    await uav.simulation.end_fault(fault_id=request.fault_id)
    return {}


async def simulation_set_speed_factor(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetSpeedFactor."""
    await uav.simulation.set_speed_factor(speed_factor=request.speed_factor)
    return {}


async def simulation_step(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves StepTime."""
    await uav.simulation.step(duration_s=request.duration)
    return {}


async def simulation_set_noise(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetNoise."""
    await uav.simulation.set_noise(position_m=request.position, velocity_m_s=request.velocity)
    return {}


async def simulation_set_wind(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves SetWind."""
    await uav.simulation.set_wind(velocity_m_s=values.vector(request.velocity))
    return {}


async def simulation_place_on_ground(uav: ual.aio.Uav, request: Message) -> Fields:
    """Serves PlaceOnGround."""
    await uav.simulation.place_on_ground(position=values.vector(request.position), yaw_rad=request.yaw)
    return {}


def fly_take_off(flyer: Flyer, goal: Message) -> Awaitable[object]:
    """Flies TakeOff, or asks what it would be."""
    return flyer.take_off(height_m=goal.height, force=goal.force)


def fly_land(flyer: Flyer, _: Message) -> Awaitable[object]:
    """Flies Land, or asks what it would be."""
    return flyer.land()


def fly_go_to_waypoint(flyer: Flyer, goal: Message) -> Awaitable[object]:
    """Flies GoToWaypoint, or asks what it would be."""
    return flyer.go_to_waypoint(waypoint=values.pose_stamped(goal.waypoint), max_speed_m_s=goal.max_speed or None)


def fly_go_to_waypoint_geo(flyer: Flyer, goal: Message) -> Awaitable[object]:
    """Flies GoToWaypointGeo, or asks what it would be."""
    return flyer.go_to_waypoint_geo(
        latitude_deg=goal.waypoint.latitude,
        longitude_deg=goal.waypoint.longitude,
        altitude_m=goal.waypoint.altitude,
        altitude_reference=values.altitude_reference(goal.altitude_reference),
        yaw_rad=goal.yaw if goal.has_yaw else None,
        max_speed_m_s=goal.max_speed or None,
    )


def fly_follow_path(flyer: Flyer, goal: Message) -> Awaitable[object]:
    """Flies FollowPath, or asks what it would be."""
    return flyer.follow_path(
        waypoints=paths.waypoints(goal),
        corner_radius_m=goal.corner_radius,
        max_speed_m_s=goal.max_speed or None,
        leg_speeds_m_s=list(goal.leg_speeds),
        heading=values.path_heading(goal.heading),
        point_of_interest=paths.point_of_interest(goal),
        holds_s=list(goal.holds),
    )


def fly_return_to_launch(flyer: Flyer, goal: Message) -> Awaitable[object]:
    """Flies ReturnToLaunch, or asks what it would be."""
    return flyer.return_to_launch(height_m=goal.height or None)


CALLS: Final[Mapping[str, Serves]] = {
    "list_frames": list_frames,
    "add_frame": add_frame,
    "remove_frame": remove_frame,
    "arm": arm,
    "disarm": disarm,
    "take_off": take_off,
    "land": land,
    "go_to_waypoint": go_to_waypoint,
    "go_to_waypoint_geo": go_to_waypoint_geo,
    "return_to_launch": return_to_launch,
    "set_external_pose": set_external_pose,
    "set_home": set_home,
    "abort": abort,
    "pause": pause,
    "resume": resume,
    "list_cameras": list_cameras,
    "get_camera_status": get_camera_status,
    "start_photos": start_photos,
    "stop_photos": stop_photos,
    "start_video": start_video,
    "stop_video": stop_video,
    "set_camera_mode": set_camera_mode,
    "set_camera_zoom": set_camera_zoom,
    "set_camera_focus": set_camera_focus,
    "list_video_streams": list_video_streams,
    "get_fence": get_fence,
    "clear_fence": clear_fence,
    "list_gimbals": list_gimbals,
    "set_gimbal_angles": set_gimbal_angles,
    "set_gimbal_rates": set_gimbal_rates,
    "point_gimbal": point_gimbal,
    "move_gimbal_to_neutral": move_gimbal_to_neutral,
    "retract_gimbal": retract_gimbal,
    "take_gimbal_control": take_gimbal_control,
    "release_gimbal_control": release_gimbal_control,
    "grip": grip,
    "release": release,
    "set_servo": set_servo,
    "set_relay": set_relay,
    "list_logs": list_logs,
    "download_mission": download_mission,
    "clear_mission": clear_mission,
    "pause_mission": pause_mission,
    "resume_mission": resume_mission,
    "jump_to_item": jump_to_item,
    "get_mission_progress": get_mission_progress,
    "get_parachute_order": get_parachute_order,
    "enable_parachute": enable_parachute,
    "disable_parachute": disable_parachute,
    "release_parachute": release_parachute,
    "get_parameter": get_parameter,
    "list_parameters": list_parameters,
    "set_parameter": set_parameter,
    "simulation/list_parts": simulation_list_parts,
    "simulation/pilot_arm": simulation_pilot_arm,
    "simulation/pilot_disarm": simulation_pilot_disarm,
    "simulation/pilot_take_over": simulation_pilot_take_over,
    "simulation/pilot_move_sticks": simulation_pilot_move_sticks,
    "simulation/pilot_give_back": simulation_pilot_give_back,
    "simulation/begin_fault": simulation_begin_fault,
    "simulation/end_fault": simulation_end_fault,
    "simulation/set_speed_factor": simulation_set_speed_factor,
    "simulation/step": simulation_step,
    "simulation/set_noise": simulation_set_noise,
    "simulation/set_wind": simulation_set_wind,
    "simulation/place_on_ground": simulation_place_on_ground,
}
"""The calls that do no more than pass on what they are given, by the names of their services."""
FLIGHTS: Final[Mapping[str, Flies]] = {
    "take_off": fly_take_off,
    "land": fly_land,
    "go_to_waypoint": fly_go_to_waypoint,
    "go_to_waypoint_geo": fly_go_to_waypoint_geo,
    "follow_path": fly_follow_path,
    "return_to_launch": fly_return_to_launch,
}
"""The motions of actions, by their names."""
