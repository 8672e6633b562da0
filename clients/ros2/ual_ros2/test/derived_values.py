"""Requests and answers of the tests' program in ROS.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

import math
from typing import Any

from reading import (
    error_of,
    finite,
    fix,
    in_mib,
    intrinsics,
    link_of,
    number,
    orientation,
    parameter_value,
    path,
    percent,
    point_of,
    pose_stamped,
    read_angle_range,
    read_viewpoint,
    transform_stamped,
)

import ual
import ual.cameras
import ual.corrections
import ual.fences.values
import ual.gimbals
import ual.gripper
import ual.logs.values
import ual.missions.plan
import ual.parameters.values
import ual.types
from ual_ros2 import values
from ual_ros2.derived.values import fault_fields, mission_item_fields, read_fence_zone, read_rally_point
from ual_ros2.messages import Message
from ual_ros2.services.fields import Fields, name_of, point_stamped, read_geo_point, vector


def geo_waypoint_fields(value: ual.types.GeoWaypoint) -> Fields:
    """Returns the fields of a message `GeoWaypoint`."""
    return {
        "waypoint": fix(value.latitude_deg, value.longitude_deg, value.altitude_m),
        "altitude_reference": value.altitude_reference.value,
        "has_yaw": value.yaw_rad is not None,
        "yaw": 0.0 if value.yaw_rad is None else value.yaw_rad,
    }


def read_geo_position(message: Message) -> dict[str, Any]:
    """Reads attributes out of a message `GeoPosition`."""
    return {
        "position_geo": None
        if math.isnan(message.latitude)
        else ual.types.GeoPoint(
            latitude_deg=message.latitude,
            longitude_deg=message.longitude,
            altitude_amsl_m=number(message.altitude_amsl),
            altitude_home_m=number(message.altitude_home),
            altitude_ellipsoid_m=number(message.altitude_ellipsoid),
        ),
        "gps": None
        if not message.gps_fix
        else ual.types.GpsInfo(
            fix=ual.types.GpsFix[message.gps_fix],
            satellites_count=message.satellites_count or None,
            horizontal_accuracy_m=number(message.horizontal_accuracy),
            vertical_accuracy_m=number(message.vertical_accuracy),
            corrections_age_s=number(message.corrections_age),
            baseline_m=number(message.baseline),
        ),
    }


def read_task(message: Message) -> ual.types.TaskInfo:
    """Reads a message `Task`."""
    return ual.types.TaskInfo(
        id=message.task_id,
        kind=ual.types.TaskKind[message.kind],
        status=ual.types.TaskStatus[message.status],
        progress=number(message.progress),
        distance_left_m=number(message.distance_left),
        elapsed_s=message.elapsed,
        waypoint_index=None if message.waypoint_index < 0 else message.waypoint_index,
        error=error_of(message) if message.reason else None,
        description=message.description,
        is_paused=message.is_paused,
    )


def read_plan(message: Message) -> ual.types.Plan:
    """Reads a message `Plan`."""
    return ual.types.Plan(length_m=number(message.length), duration_s=number(message.duration))


def read_frame(message: Message) -> ual.types.Frame:
    """Reads a message `Frame`."""
    return ual.types.Frame(
        frame_id=message.frame_id,
        parent_frame_id=message.parent_frame_id,
        transform=link_of(message),
        is_static=message.is_static,
    )


def read_geofence(message: Message) -> ual.types.Geofence:
    """Reads a message `Geofence`."""
    return ual.types.Geofence(
        corners=tuple(map(values.vector, message.corners)),
        circle=ual.types.Circle(values.vector(message.center), message.radius) if message.has_circle else None,
        min_z_m=finite(message.min_z),
        max_z_m=finite(message.max_z),
    )


def read_info(message: Message) -> ual.types.Info:
    """Reads a message `Info`."""
    return ual.types.Info(
        namespace=message.ns,
        backend=message.backend,
        autopilot=message.autopilot,
        autopilot_version=message.autopilot_version,
        is_simulation=message.is_simulation,
        capabilities=frozenset(ual.types.Capability[each] for each in message.capabilities),
        limits=ual.types.Limits(
            horizontal_speed_m_s=message.horizontal_speed,
            climb_speed_m_s=message.climb_speed,
            descent_speed_m_s=message.descent_speed,
            horizontal_acceleration_m_s2=message.horizontal_acceleration,
            vertical_acceleration_m_s2=message.vertical_acceleration,
            yaw_rate_rad_s=message.yaw_rate,
        ),
        ual_version=message.ual_version,
        is_arming_allowed=message.is_arming_allowed,
        url=message.url,
        has_safety_pilot=message.has_safety_pilot,
    )


def read_lease(message: Message) -> ual.types.LeaseInfo:
    """Reads a message `Lease`."""
    return ual.types.LeaseInfo(holder=message.holder, identity=message.identity, since_s=values.stamp_s(message.since))


def read_camera(message: Message) -> ual.cameras.CameraInfo:
    """Reads a message `Camera`."""
    return ual.cameras.CameraInfo(
        number=message.number,
        name=message.name,
        abilities=frozenset(ual.cameras.CameraAbility[each] for each in message.abilities),
        is_connected=message.is_connected,
        firmware_version=message.firmware_version,
        width_px=message.width,
        height_px=message.height,
        intrinsics=intrinsics(message.camera_info),
        note=message.note,
        image_kinds=frozenset(ual.cameras.ImageKind[each] for each in message.image_kinds),
    )


def read_camera_status(message: Message) -> ual.cameras.CameraStatus:
    """Reads a message `CameraStatus`."""
    return ual.cameras.CameraStatus(
        mode=ual.cameras.CameraMode[message.mode] if message.mode else None,
        is_taking_photos=message.is_taking_photos,
        interval_s=number(message.interval),
        distance_m=number(message.distance),
        is_recording=message.is_recording,
        recording_s=message.recording_time,
        photos_count=message.photos_count,
        missed_count=message.missed_count,
        storage=ual.cameras.CameraStorage(
            state=ual.cameras.StorageState[message.storage] if message.storage else None,
            total_mib=in_mib(message.storage_total),
            available_mib=in_mib(message.storage_available),
        ),
        zoom_percent=percent(message.zoom),
        focus_percent=percent(message.focus),
        battery_percent=percent(message.battery),
    )


def read_photo(message: Message) -> ual.cameras.Photo:
    """Reads a message `Photo`."""
    return ual.cameras.Photo(
        number=message.number,
        **read_viewpoint(message.viewpoint),
        is_stored=message.is_stored,
        file_url=message.file_url,
    )


def read_video_stream(message: Message) -> ual.cameras.VideoStream:
    """Reads a message `VideoStream`."""
    return ual.cameras.VideoStream(
        name=message.name,
        url=message.url,
        encoding=message.encoding,
        width_px=message.width,
        height_px=message.height,
        rate_hz=message.rate,
        is_running=message.is_running,
        is_thermal=message.is_thermal,
    )


def read_corrections_status(message: Message) -> ual.corrections.CorrectionsStatus:
    """Reads a message `CorrectionsStatus`."""
    return ual.corrections.CorrectionsStatus(
        sender=message.sender,
        messages_count=message.messages_count,
        bytes_count=message.bytes_count,
        dropped_count=message.dropped_count,
        too_long_count=message.too_long_count,
        skipped_bytes_count=message.skipped_bytes_count,
        age_s=number(message.age),
    )


def read_kept_fence(message: Message) -> ual.fences.values.KeptFence:
    """Reads a message `KeptFence`."""
    return ual.fences.values.KeptFence(
        zones=tuple(map(read_fence_zone, message.zones)),
        rally_points=tuple(map(read_rally_point, message.rally_points)),
        is_enabled=message.is_enabled if message.is_enabled_known else None,
        return_point=next(map(read_geo_point, message.return_point), None),
    )


def read_gimbal(message: Message) -> ual.gimbals.GimbalInfo:
    """Reads a message `Gimbal`."""
    return ual.gimbals.GimbalInfo(
        number=message.number,
        name=message.name,
        abilities=frozenset(ual.gimbals.GimbalAbility[each] for each in message.abilities),
        is_connected=message.is_connected,
        frame_id=message.frame_id,
        roll=read_angle_range(message.roll),
        pitch=read_angle_range(message.pitch),
        yaw=read_angle_range(message.yaw),
        note=message.note,
    )


def read_gimbal_status(message: Message) -> ual.gimbals.GimbalStatus:
    """Reads a message `GimbalStatus`."""
    return ual.gimbals.GimbalStatus(
        stamp_s=values.stamp_s(message.header.stamp) or None,
        angles=None
        if math.isnan(message.roll)
        else ual.gimbals.GimbalAngles(roll_rad=message.roll, pitch_rad=message.pitch, yaw_rad=message.yaw),
        in_body=orientation(message.in_body),
        in_odom=orientation(message.in_odom),
        activity=ual.gimbals.GimbalActivity[message.activity] if message.activity else None,
        target=point_of(message.target),
        off_target_rad=number(message.off_target),
        control=ual.gimbals.GimbalControl[message.control] if message.control else None,
        controller=message.controller,
        problems=tuple(message.problems),
    )


def read_winch_status(message: Message) -> ual.gripper.WinchStatus:
    """Reads a message `WinchStatus`."""
    return ual.gripper.WinchStatus(
        length_m=number(message.length),
        speed_m_s=number(message.speed),
        tension_n=number(message.tension),
        voltage_v=number(message.voltage),
        current_a=number(message.current),
        temperature_c=number(message.temperature),
        is_healthy=message.is_healthy,
        is_fully_retracted=message.is_fully_retracted,
        is_moving=message.is_moving,
        is_clutch_engaged=message.is_clutch_engaged,
    )


def read_log(message: Message) -> ual.logs.values.Log:
    """Reads a message `Log`."""
    return ual.logs.values.Log(
        id=message.log_id,
        size_bytes=message.size,
        time_s=values.stamp_s(message.written) or None,
        is_missing=message.is_missing,
    )


def read_mission_progress(message: Message) -> ual.missions.plan.MissionProgress:
    """Reads a message `MissionProgress`."""
    return ual.missions.plan.MissionProgress(
        stage=ual.missions.plan.MissionStage[message.stage],
        item=message.item or None,
        reached=message.reached or None,
        task_id=message.task_id,
    )


def read_parameter(message: Message) -> ual.parameters.values.Parameter:
    """Reads a message `Parameter`."""
    return ual.parameters.values.Parameter(
        name=message.name,
        value=parameter_value(message),
        type=ual.parameters.values.ParameterType[message.type],
        is_relied_on=message.is_relied_on,
        minimum=number(message.minimum),
        maximum=number(message.maximum),
        unit=message.unit,
        description=message.description,
        needs_reboot=message.needs_reboot,
    )


def ask_add_frame(*, transform: Any) -> Fields:
    """Returns the request of add_frame."""
    return {
        "transform": transform_stamped(transform),
    }


def ask_take_off(*, height_m: Any, force: Any) -> Fields:
    """Returns the request of take_off."""
    return {
        "height": height_m,
        "force": force,
    }


def ask_land() -> Fields:
    """Returns the request of land."""
    return {}


def ask_go_to_waypoint(*, waypoint: Any, max_speed_m_s: Any) -> Fields:
    """Returns the request of go_to_waypoint."""
    return {
        "waypoint": pose_stamped(waypoint),
        "max_speed": max_speed_m_s or 0.0,
    }


def ask_go_to_waypoint_geo(
    *, latitude_deg: Any, longitude_deg: Any, altitude_m: Any, altitude_reference: Any, yaw_rad: Any, max_speed_m_s: Any
) -> Fields:
    """Returns the request of go_to_waypoint_geo."""
    return {
        "waypoint": fix(latitude_deg, longitude_deg, altitude_m),
        "altitude_reference": altitude_reference.value,
        "has_yaw": yaw_rad is not None,
        "yaw": 0.0 if yaw_rad is None else yaw_rad,
        "max_speed": max_speed_m_s or 0.0,
    }


def ask_follow_path(
    *,
    waypoints: Any,
    corner_radius_m: Any,
    max_speed_m_s: Any,
    leg_speeds_m_s: Any,
    heading: Any,
    point_of_interest: Any,
    holds_s: Any,
) -> Fields:
    """Returns the request of follow_path."""
    return {
        "path": path(waypoints),
        "geo_waypoints": [geo_waypoint_fields(each) for each in waypoints if isinstance(each, ual.GeoWaypoint)],
        "corner_radius": corner_radius_m,
        "max_speed": max_speed_m_s or 0.0,
        "leg_speeds": list(leg_speeds_m_s),
        "heading": heading.value,
        "point_of_interest": point_stamped(point_of_interest),
        "holds": list(holds_s),
    }


def ask_return_to_launch(*, height_m: Any) -> Fields:
    """Returns the request of return_to_launch."""
    return {
        "height": height_m or 0.0,
    }


def ask_list_cameras() -> Fields:
    """Returns the request of list_cameras."""
    return {}


def ask_get_camera_status() -> Fields:
    """Returns the request of get_camera_status."""
    return {}


def ask_take_photo() -> Fields:
    """Returns the request of take_photo."""
    return {}


def ask_start_photos(*, interval_s: Any, distance_m: Any, count: Any) -> Fields:
    """Returns the request of start_photos."""
    return {
        "interval": interval_s or 0.0,
        "distance": distance_m or 0.0,
        "count": count,
    }


def ask_stop_photos() -> Fields:
    """Returns the request of stop_photos."""
    return {}


def ask_start_video() -> Fields:
    """Returns the request of start_video."""
    return {}


def ask_stop_video() -> Fields:
    """Returns the request of stop_video."""
    return {}


def ask_set_camera_mode(*, mode: Any) -> Fields:
    """Returns the request of set_camera_mode."""
    return {
        "mode": mode.name,
    }


def ask_set_camera_zoom(*, percent: Any) -> Fields:
    """Returns the request of set_camera_zoom."""
    return {
        "zoom": percent / 100.0,
    }


def ask_set_camera_focus(*, percent: Any) -> Fields:
    """Returns the request of set_camera_focus."""
    return {
        "is_automatic": percent is None,
        "focus": 0.0 if percent is None else percent / 100.0,
    }


def ask_list_photos(*, first: Any) -> Fields:
    """Returns the request of list_photos."""
    return {
        "first": first,
    }


def ask_list_video_streams() -> Fields:
    """Returns the request of list_video_streams."""
    return {}


def ask_get_image(*, photo: Any, kind: Any, max_age_s: Any) -> Fields:
    """Returns the request of get_image."""
    return {
        "is_photo": photo is not None,
        "photo": 0 if photo is None else photo,
        "kind": kind.name,
        "max_age": max_age_s,
    }


def ask_get_corrections_status() -> Fields:
    """Returns the request of get_corrections_status."""
    return {}


def ask_get_fence() -> Fields:
    """Returns the request of get_fence."""
    return {}


def ask_clear_fence(*, with_rally_points: Any, force: Any) -> Fields:
    """Returns the request of clear_fence."""
    return {
        "with_rally_points": with_rally_points,
        "force": force,
    }


def ask_list_gimbals() -> Fields:
    """Returns the request of list_gimbals."""
    return {}


def ask_get_gimbal_status() -> Fields:
    """Returns the request of get_gimbal_status."""
    return {}


def ask_set_gimbal_angles(*, pitch_rad: Any, yaw_rad: Any, roll_rad: Any, reference: Any, frame_id: Any) -> Fields:
    """Returns the request of set_gimbal_angles."""
    return {
        "roll": roll_rad,
        "pitch": pitch_rad,
        "yaw": yaw_rad,
        "reference": reference.name,
        "frame_id": frame_id,
    }


def ask_set_gimbal_rates(*, pitch_rad_s: Any, yaw_rad_s: Any) -> Fields:
    """Returns the request of set_gimbal_rates."""
    return {
        "pitch": pitch_rad_s,
        "yaw": yaw_rad_s,
    }


def ask_point_gimbal(*, point: Any) -> Fields:
    """Returns the request of point_gimbal."""
    return {
        "point": point_stamped(point),
    }


def ask_move_gimbal_to_neutral() -> Fields:
    """Returns the request of move_gimbal_to_neutral."""
    return {}


def ask_retract_gimbal() -> Fields:
    """Returns the request of retract_gimbal."""
    return {}


def ask_take_gimbal_control() -> Fields:
    """Returns the request of take_gimbal_control."""
    return {}


def ask_release_gimbal_control() -> Fields:
    """Returns the request of release_gimbal_control."""
    return {}


def ask_list_equipment() -> Fields:
    """Returns the request of list_equipment."""
    return {}


def ask_grip(*, gripper: Any) -> Fields:
    """Returns the request of grip."""
    return {
        "gripper": gripper,
    }


def ask_release(*, gripper: Any) -> Fields:
    """Returns the request of release."""
    return {
        "gripper": gripper,
    }


def ask_order_winch(*, action: Any, winch: Any, length_m: Any, rate_m_s: Any) -> Fields:
    """Returns the request of order_winch."""
    return {
        "winch": winch,
        "action": action.name,
        "length": length_m or 0.0,
        "rate": rate_m_s or 0.0,
    }


def ask_set_servo(*, position: Any, servo: Any, pwm_us: Any) -> Fields:
    """Returns the request of set_servo."""
    return {
        "servo": servo,
        "position": position,
        "pwm_us": pwm_us or 0,
    }


def ask_set_relay(*, state: Any, relay: Any) -> Fields:
    """Returns the request of set_relay."""
    return {
        "relay": relay,
        "state": state,
    }


def ask_list_logs() -> Fields:
    """Returns the request of list_logs."""
    return {}


def ask_plan_mission(*, items: Any) -> Fields:
    """Returns the request of plan_mission."""
    return {
        "items": [mission_item_fields(each) for each in items],
    }


def ask_upload_mission(*, items: Any) -> Fields:
    """Returns the request of upload_mission."""
    return {
        "items": [mission_item_fields(each) for each in items],
    }


def ask_download_mission() -> Fields:
    """Returns the request of download_mission."""
    return {}


def ask_clear_mission() -> Fields:
    """Returns the request of clear_mission."""
    return {}


def ask_fly_mission(*, first_item: Any, on_link_loss: Any) -> Fields:
    """Returns the request of fly_mission."""
    return {
        "first_item": first_item,
        "on_link_loss": name_of(on_link_loss),
    }


def ask_pause_mission() -> Fields:
    """Returns the request of pause_mission."""
    return {}


def ask_resume_mission() -> Fields:
    """Returns the request of resume_mission."""
    return {}


def ask_jump_to_item(*, item: Any) -> Fields:
    """Returns the request of jump_to_item."""
    return {
        "item": item,
    }


def ask_get_mission_progress() -> Fields:
    """Returns the request of get_mission_progress."""
    return {}


def ask_get_parachute_order() -> Fields:
    """Returns the request of get_parachute_order."""
    return {}


def ask_enable_parachute() -> Fields:
    """Returns the request of enable_parachute."""
    return {}


def ask_disable_parachute() -> Fields:
    """Returns the request of disable_parachute."""
    return {}


def ask_release_parachute() -> Fields:
    """Returns the request of release_parachute."""
    return {}


def ask_get_parameter(*, name: Any) -> Fields:
    """Returns the request of get_parameter."""
    return {
        "name": name,
    }


def ask_list_parameters() -> Fields:
    """Returns the request of list_parameters."""
    return {}


def ask_set_parameter(*, name: Any, value: Any, force: Any) -> Fields:
    """Returns the request of set_parameter."""
    return {
        "name": name,
        "value": float(value),
        "force": force,
    }


def ask_simulation_list_parts() -> Fields:
    """Returns the request of simulation/list_parts."""
    return {}


def ask_simulation_pilot_arm() -> Fields:
    """Returns the request of simulation/pilot_arm."""
    return {}


def ask_simulation_pilot_disarm() -> Fields:
    """Returns the request of simulation/pilot_disarm."""
    return {}


def ask_simulation_pilot_take_over() -> Fields:
    """Returns the request of simulation/pilot_take_over."""
    return {}


def ask_simulation_pilot_move_sticks(*, forward: Any, left: Any, up: Any, turn: Any) -> Fields:
    """Returns the request of simulation/pilot_move_sticks."""
    return {
        "forward": forward,
        "left": left,
        "up": up,
        "turn": turn,
    }


def ask_simulation_pilot_give_back() -> Fields:
    """Returns the request of simulation/pilot_give_back."""
    return {}


def ask_simulation_begin_fault(*, fault: Any, duration_s: Any) -> Fields:
    """Returns the request of simulation/begin_fault."""
    return {
        "fault": fault_fields(fault),
        "duration": duration_s,
    }


def ask_simulation_end_fault(*, fault_id: Any) -> Fields:
    """Returns the request of simulation/end_fault."""
    return {
        "fault_id": fault_id,
    }


def ask_simulation_list_faults() -> Fields:
    """Returns the request of simulation/list_faults."""
    return {}


def ask_simulation_set_speed_factor(*, speed_factor: Any) -> Fields:
    """Returns the request of simulation/set_speed_factor."""
    return {
        "speed_factor": speed_factor,
    }


def ask_simulation_step(*, duration_s: Any) -> Fields:
    """Returns the request of simulation/step."""
    return {
        "duration": duration_s,
    }


def ask_simulation_set_noise(*, position_m: Any, velocity_m_s: Any) -> Fields:
    """Returns the request of simulation/set_noise."""
    return {
        "position": position_m,
        "velocity": velocity_m_s,
    }


def ask_simulation_set_wind(*, velocity_m_s: Any) -> Fields:
    """Returns the request of simulation/set_wind."""
    return {
        "velocity": vector(velocity_m_s),
    }


def ask_simulation_place_on_ground(*, position: Any, yaw_rad: Any) -> Fields:
    """Returns the request of simulation/place_on_ground."""
    return {
        "position": vector(position),
        "yaw": yaw_rad,
    }
