"""Messages of ``ual_msgs`` and values of UAL, by the rules of the contract.

``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

import math

import ual
import ual.cameras
import ual.corrections
import ual.fences.values
import ual.gimbals
import ual.gripper
import ual.logs.values
import ual.missions.items
import ual.missions.plan
import ual.parameters.values
import ual.simulation
import ual.types
from ual_ros2 import pictures, values
from ual_ros2.messages import Message
from ual_ros2.services.fields import (
    Fields,
    angle_range,
    geo_point_fields,
    in_bytes,
    key_values,
    name_of,
    named,
    names_of,
    none_of,
    point_stamped,
    quaternion,
    ratio,
    read_all,
    read_geo_point,
    stamp,
    transform,
    vector,
)


def geo_position_fields(value: ual.types.Telemetry) -> Fields:
    """Returns the fields of a message `GeoPosition`."""
    return {
        "latitude": math.nan if value.position_geo is None else value.position_geo.latitude_deg,
        "longitude": math.nan if value.position_geo is None else value.position_geo.longitude_deg,
        "altitude_amsl": math.nan if value.position_geo is None else values.known(value.position_geo.altitude_amsl_m),
        "altitude_home": math.nan if value.position_geo is None else values.known(value.position_geo.altitude_home_m),
        "altitude_ellipsoid": math.nan
        if value.position_geo is None
        else values.known(value.position_geo.altitude_ellipsoid_m),
        "gps_fix": "" if value.gps is None else value.gps.fix.name,
        "satellites_count": 0 if value.gps is None else value.gps.satellites_count or 0,
        "horizontal_accuracy": math.nan if value.gps is None else values.known(value.gps.horizontal_accuracy_m),
        "vertical_accuracy": math.nan if value.gps is None else values.known(value.gps.vertical_accuracy_m),
        "corrections_age": math.nan if value.gps is None else values.known(value.gps.corrections_age_s),
        "baseline": math.nan if value.gps is None else values.known(value.gps.baseline_m),
    }


def task_fields(value: ual.types.TaskInfo) -> Fields:
    """Returns the fields of a message `Task`."""
    return {
        "task_id": value.id,
        "kind": value.kind.name,
        "status": value.status.name,
        "progress": values.known(value.progress),
        "distance_left": values.known(value.distance_left_m),
        "elapsed": value.elapsed_s,
        "waypoint_index": -1 if value.waypoint_index is None else value.waypoint_index,
        "is_paused": value.is_paused,
        "description": value.description,
        "reason": "" if value.error is None else value.error.reason,
        "message": "" if value.error is None else value.error.message,
        "metadata": [] if value.error is None else key_values(value.error.metadata),
    }


def plan_fields(value: ual.types.Plan) -> Fields:
    """Returns the fields of a message `Plan`."""
    return {
        "length": values.known(value.length_m),
        "duration": values.known(value.duration_s),
    }


def frame_fields(value: ual.types.Frame) -> Fields:
    """Returns the fields of a message `Frame`."""
    return {
        "frame_id": value.frame_id,
        "parent_frame_id": value.parent_frame_id,
        "is_known": value.transform is not None,
        "transform": transform(value.transform),
        "is_static": value.is_static,
    }


def geofence_fields(value: ual.types.Geofence) -> Fields:
    """Returns the fields of a message `Geofence`."""
    return {
        "corners": [vector(each) for each in value.corners],
        "has_circle": value.circle is not None,
        "center": {} if value.circle is None else vector(value.circle.center),
        "radius": 0.0 if value.circle is None else value.circle.radius_m,
        "min_z": -math.inf if value.min_z_m is None else value.min_z_m,
        "max_z": math.inf if value.max_z_m is None else value.max_z_m,
    }


def info_fields(value: ual.types.Info) -> Fields:
    """Returns the fields of a message `Info`."""
    return {
        "ns": value.namespace,
        "backend": value.backend,
        "autopilot": value.autopilot,
        "autopilot_version": value.autopilot_version,
        "url": value.url,
        "ual_version": value.ual_version,
        "is_simulation": value.is_simulation,
        "is_arming_allowed": value.is_arming_allowed,
        "has_safety_pilot": value.has_safety_pilot,
        "capabilities": sorted(each.name for each in value.capabilities),
        "horizontal_speed": value.limits.horizontal_speed_m_s,
        "climb_speed": value.limits.climb_speed_m_s,
        "descent_speed": value.limits.descent_speed_m_s,
        "horizontal_acceleration": value.limits.horizontal_acceleration_m_s2,
        "vertical_acceleration": value.limits.vertical_acceleration_m_s2,
        "yaw_rate": value.limits.yaw_rate_rad_s,
    }


def lease_fields(value: ual.types.LeaseInfo) -> Fields:
    """Returns the fields of a message `Lease`."""
    return {
        "holder": value.holder,
        "identity": value.identity,
        "since": stamp(value.since_s),
    }


def camera_fields(value: ual.cameras.CameraInfo) -> Fields:
    """Returns the fields of a message `Camera`."""
    return {
        "number": value.number,
        "name": value.name,
        "firmware_version": value.firmware_version,
        "abilities": names_of(value.abilities),
        "image_kinds": names_of(value.image_kinds),
        "is_connected": value.is_connected,
        "width": value.width_px,
        "height": value.height_px,
        "camera_info": pictures.camera_info(value),
        "note": value.note,
    }


def camera_status_fields(value: ual.cameras.CameraStatus) -> Fields:
    """Returns the fields of a message `CameraStatus`."""
    return {
        "mode": name_of(value.mode),
        "is_taking_photos": value.is_taking_photos,
        "interval": values.known(value.interval_s),
        "distance": values.known(value.distance_m),
        "is_recording": value.is_recording,
        "recording_time": value.recording_s,
        "photos_count": value.photos_count,
        "missed_count": value.missed_count,
        "storage": name_of(value.storage.state),
        "storage_total": in_bytes(value.storage.total_mib),
        "storage_available": in_bytes(value.storage.available_mib),
        "zoom": ratio(value.zoom_percent),
        "focus": ratio(value.focus_percent),
        "battery": ratio(value.battery_percent),
    }


def photo_fields(value: ual.cameras.Photo) -> Fields:
    """Returns the fields of a message `Photo`."""
    return {
        "number": value.number,
        "is_stored": value.is_stored,
        "viewpoint": pictures.viewpoint(value),
        "file_url": value.file_url,
    }


def video_stream_fields(value: ual.cameras.VideoStream) -> Fields:
    """Returns the fields of a message `VideoStream`."""
    return {
        "name": value.name,
        "url": value.url,
        "encoding": value.encoding,
        "width": value.width_px,
        "height": value.height_px,
        "rate": value.rate_hz,
        "is_running": value.is_running,
        "is_thermal": value.is_thermal,
    }


def corrections_status_fields(value: ual.corrections.CorrectionsStatus) -> Fields:
    """Returns the fields of a message `CorrectionsStatus`."""
    return {
        "sender": value.sender,
        "messages_count": value.messages_count,
        "bytes_count": value.bytes_count,
        "dropped_count": value.dropped_count,
        "too_long_count": value.too_long_count,
        "skipped_bytes_count": value.skipped_bytes_count,
        "age": values.known(value.age_s),
    }


def fence_zone_fields(value: ual.fences.values.FenceZone) -> Fields:
    """Returns the fields of a message `FenceZone`."""
    return {
        "is_inclusion": value.is_inclusion,
        "points": [geo_point_fields(each) for each in value.points],
        "radius": value.radius_m or 0.0,
    }


def rally_point_fields(value: ual.fences.values.RallyPoint) -> Fields:
    """Returns the fields of a message `RallyPoint`."""
    return {
        "place": geo_point_fields((value.latitude_deg, value.longitude_deg)),
        "height": value.height_m,
        "is_amsl": value.reference is ual.AltitudeReference.AMSL,
    }


def kept_fence_fields(value: ual.fences.values.KeptFence) -> Fields:
    """Returns the fields of a message `KeptFence`."""
    return {
        "zones": [fence_zone_fields(each) for each in value.zones],
        "rally_points": [rally_point_fields(each) for each in value.rally_points],
        "is_enabled": bool(value.is_enabled),
        "is_enabled_known": value.is_enabled is not None,
        "return_point": [] if value.return_point is None else [geo_point_fields(value.return_point)],
    }


def gimbal_fields(value: ual.gimbals.GimbalInfo) -> Fields:
    """Returns the fields of a message `Gimbal`."""
    return {
        "number": value.number,
        "name": value.name,
        "abilities": names_of(value.abilities),
        "is_connected": value.is_connected,
        "frame_id": value.frame_id,
        "roll": angle_range(value.roll),
        "pitch": angle_range(value.pitch),
        "yaw": angle_range(value.yaw),
        "note": value.note,
    }


def gimbal_status_fields(value: ual.gimbals.GimbalStatus) -> Fields:
    """Returns the fields of a message `GimbalStatus`."""
    return {
        "roll": math.nan if value.angles is None else value.angles.roll_rad,
        "pitch": math.nan if value.angles is None else value.angles.pitch_rad,
        "yaw": math.nan if value.angles is None else value.angles.yaw_rad,
        "in_body": quaternion(value.in_body),
        "in_odom": quaternion(value.in_odom),
        "activity": name_of(value.activity),
        "target": point_stamped(value.target),
        "off_target": values.known(value.off_target_rad),
        "control": name_of(value.control),
        "controller": value.controller,
        "problems": list(value.problems),
    }


def winch_status_fields(value: ual.gripper.WinchStatus) -> Fields:
    """Returns the fields of a message `WinchStatus`."""
    return {
        "length": values.known(value.length_m),
        "speed": values.known(value.speed_m_s),
        "tension": values.known(value.tension_n),
        "voltage": values.known(value.voltage_v),
        "current": values.known(value.current_a),
        "temperature": values.known(value.temperature_c),
        "is_healthy": value.is_healthy,
        "is_fully_retracted": value.is_fully_retracted,
        "is_moving": value.is_moving,
        "is_clutch_engaged": value.is_clutch_engaged,
    }


def log_fields(value: ual.logs.values.Log) -> Fields:
    """Returns the fields of a message `Log`."""
    return {
        "log_id": value.id,
        "size": value.size_bytes,
        "written": stamp(value.time_s),
        "is_missing": value.is_missing,
    }


def mission_item_fields(value: ual.missions.items.Item) -> Fields:
    """Returns the fields of a message `MissionItem`."""
    match value:
        case ual.missions.items.TakeOff():
            return {
                "number": value.number,
                "kind": "TAKE_OFF",
                "has_place": value.latitude_deg is not None,
                "place": geo_point_fields((value.latitude_deg, value.longitude_deg)),
                "altitude": value.altitude_m,
                "altitude_reference": value.altitude_reference.value,
            }
        case ual.missions.items.Waypoint():
            return {
                "number": value.number,
                "kind": "WAYPOINT",
                "place": geo_point_fields((value.latitude_deg, value.longitude_deg)),
                "altitude": value.altitude_m,
                "altitude_reference": value.altitude_reference.value,
                "hold": value.hold_s,
                "accept_radius": value.accept_radius_m or 0.0,
                "has_yaw": value.yaw_rad is not None,
                "yaw": 0.0 if value.yaw_rad is None else value.yaw_rad,
            }
        case ual.missions.items.HoldTime():
            return {
                "number": value.number,
                "kind": "HOLD",
                "hold": value.seconds,
            }
        case ual.missions.items.Speed():
            return {
                "number": value.number,
                "kind": "SPEED",
                "speed": value.speed_m_s,
            }
        case ual.missions.items.Heading():
            return {
                "number": value.number,
                "kind": "HEADING",
                "yaw": value.yaw_rad,
            }
        case ual.missions.items.RegionOfInterest():
            return {
                "number": value.number,
                "kind": "REGION_OF_INTEREST",
                "place": geo_point_fields((value.latitude_deg, value.longitude_deg)),
                "altitude": value.altitude_m,
                "altitude_reference": value.altitude_reference.value,
            }
        case ual.missions.items.RegionOfInterestEnd():
            return {
                "number": value.number,
                "kind": "REGION_OF_INTEREST_END",
            }
        case ual.missions.items.CameraTrigger():
            return {
                "number": value.number,
                "kind": "CAMERA_TRIGGER",
                "camera_action": value.action.name,
                "value": value.value,
            }
        case ual.missions.items.Land():
            return {
                "number": value.number,
                "kind": "LAND",
                "place": geo_point_fields((value.latitude_deg, value.longitude_deg)),
            }
        case ual.missions.items.ReturnToLaunch():
            return {
                "number": value.number,
                "kind": "RETURN_TO_LAUNCH",
            }
        case ual.missions.items.Jump():
            return {
                "number": value.number,
                "kind": "JUMP",
                "to": value.to,
                "times": value.times,
            }
        case ual.missions.items.OtherItem():
            return {
                "number": value.number,
                "kind": "OTHER",
                "command": value.command,
                "text": value.text,
            }
    raise TypeError(f"{value!r} is no MissionItem")


def mission_progress_fields(value: ual.missions.plan.MissionProgress) -> Fields:
    """Returns the fields of a message `MissionProgress`."""
    return {
        "stage": value.stage.name,
        "item": value.item or 0,
        "reached": value.reached or 0,
        "task_id": value.task_id,
    }


def parameter_fields(value: ual.parameters.values.Parameter) -> Fields:
    """Returns the fields of a message `Parameter`."""
    return {
        "name": value.name,
        "value": float(value.value),
        "type": value.type.name,
        "is_relied_on": value.is_relied_on,
        "minimum": values.known(value.minimum),
        "maximum": values.known(value.maximum),
        "unit": value.unit,
        "description": value.description,
        "needs_reboot": value.needs_reboot,
    }


def fault_fields(value: ual.simulation.Fault) -> Fields:
    """Returns the fields of a message `Fault`."""
    match value:
        case ual.simulation.LinkLost():
            return {
                "kind": "LINK_LOST",
            }
        case ual.simulation.PositionLost():
            return {
                "kind": "POSITION_LOST",
            }
        case ual.simulation.EstimatorJumps():
            return {
                "kind": "ESTIMATOR_JUMPS",
                "offset": vector(value.offset),
                "period": value.period_s,
            }
        case ual.simulation.MotorsWeak():
            return {
                "kind": "MOTORS_WEAK",
                "power": value.power_ratio,
            }
        case ual.simulation.BatteryLow():
            return {
                "kind": "BATTERY_LOW",
                "remaining": value.remaining_percent / 100.0,
            }
        case ual.simulation.CommandRefused():
            return {
                "kind": "COMMAND_REFUSED",
                "command": name_of(value.command),
                "text": value.text,
            }
        case ual.simulation.AckLost():
            return {
                "kind": "ACK_LOST",
                "command": name_of(value.command),
            }
        case ual.simulation.AckLate():
            return {
                "kind": "ACK_LATE",
                "command": name_of(value.command),
                "delay": value.delay_s,
            }
        case ual.simulation.FailsafeTriggered():
            return {
                "kind": "FAILSAFE_TRIGGERED",
                "cause": value.cause,
            }
    raise TypeError(f"{value!r} is no Fault")


def read_geo_waypoint(message: Message) -> ual.types.GeoWaypoint:
    """Reads a message `GeoWaypoint`."""
    return ual.types.GeoWaypoint(
        latitude_deg=message.waypoint.latitude,
        longitude_deg=message.waypoint.longitude,
        altitude_m=message.waypoint.altitude,
        altitude_reference=values.altitude_reference(message.altitude_reference),
        yaw_rad=message.yaw if message.has_yaw else None,
    )


def read_fence_zone(message: Message) -> ual.fences.values.FenceZone:
    """Reads a message `FenceZone`."""
    return ual.fences.values.FenceZone(
        is_inclusion=message.is_inclusion,
        points=tuple(read_all(read_geo_point, message.points, "points")),
        radius_m=message.radius or None,
    )


def read_rally_point(message: Message) -> ual.fences.values.RallyPoint:
    """Reads a message `RallyPoint`."""
    return ual.fences.values.RallyPoint(
        latitude_deg=message.place.latitude,
        longitude_deg=message.place.longitude,
        height_m=message.height,
        reference=ual.AltitudeReference.AMSL if message.is_amsl else ual.AltitudeReference.HOME,
    )


def read_mission_item(message: Message) -> ual.missions.items.Item:
    """Reads a message `MissionItem`."""
    match message.kind:
        case "TAKE_OFF":
            return ual.missions.items.TakeOff(
                altitude_m=message.altitude,
                altitude_reference=values.altitude_reference(message.altitude_reference),
                latitude_deg=message.place.latitude if message.has_place else None,
                longitude_deg=message.place.longitude if message.has_place else None,
                number=message.number,
            )
        case "WAYPOINT":
            return ual.missions.items.Waypoint(
                latitude_deg=message.place.latitude,
                longitude_deg=message.place.longitude,
                altitude_m=message.altitude,
                altitude_reference=values.altitude_reference(message.altitude_reference),
                hold_s=message.hold,
                accept_radius_m=message.accept_radius or None,
                yaw_rad=message.yaw if message.has_yaw else None,
                number=message.number,
            )
        case "HOLD":
            return ual.missions.items.HoldTime(seconds=message.hold, number=message.number)
        case "SPEED":
            return ual.missions.items.Speed(speed_m_s=message.speed, number=message.number)
        case "HEADING":
            return ual.missions.items.Heading(yaw_rad=message.yaw, number=message.number)
        case "REGION_OF_INTEREST":
            return ual.missions.items.RegionOfInterest(
                latitude_deg=message.place.latitude,
                longitude_deg=message.place.longitude,
                altitude_m=message.altitude,
                altitude_reference=values.altitude_reference(message.altitude_reference),
                number=message.number,
            )
        case "REGION_OF_INTEREST_END":
            return ual.missions.items.RegionOfInterestEnd(number=message.number)
        case "CAMERA_TRIGGER":
            return ual.missions.items.CameraTrigger(
                action=named(ual.missions.items.CameraAction, message.camera_action, "camera_action"),
                value=message.value,
                number=message.number,
            )
        case "LAND":
            return ual.missions.items.Land(
                latitude_deg=message.place.latitude, longitude_deg=message.place.longitude, number=message.number
            )
        case "RETURN_TO_LAUNCH":
            return ual.missions.items.ReturnToLaunch(number=message.number)
        case "JUMP":
            return ual.missions.items.Jump(to=message.to, times=message.times, number=message.number)
        case "OTHER":
            return ual.missions.items.OtherItem(command=message.command, text=message.text, number=message.number)
    raise none_of(
        "kind",
        message.kind,
        (
            "TAKE_OFF",
            "WAYPOINT",
            "HOLD",
            "SPEED",
            "HEADING",
            "REGION_OF_INTEREST",
            "REGION_OF_INTEREST_END",
            "CAMERA_TRIGGER",
            "LAND",
            "RETURN_TO_LAUNCH",
            "JUMP",
            "OTHER",
        ),
    )


def read_fault(message: Message) -> ual.simulation.Fault:
    """Reads a message `Fault`."""
    match message.kind:
        case "LINK_LOST":
            return ual.simulation.LinkLost()
        case "POSITION_LOST":
            return ual.simulation.PositionLost()
        case "ESTIMATOR_JUMPS":
            return ual.simulation.EstimatorJumps(offset=values.vector(message.offset), period_s=message.period)
        case "MOTORS_WEAK":
            return ual.simulation.MotorsWeak(power_ratio=message.power)
        case "BATTERY_LOW":
            return ual.simulation.BatteryLow(remaining_percent=100.0 * message.remaining)
        case "COMMAND_REFUSED":
            return ual.simulation.CommandRefused(
                command=named(ual.simulation.Command, message.command, "command")
                if message.command
                else ual.simulation.Command.ANY,
                text=message.text,
            )
        case "ACK_LOST":
            return ual.simulation.AckLost(
                command=named(ual.simulation.Command, message.command, "command")
                if message.command
                else ual.simulation.Command.ANY
            )
        case "ACK_LATE":
            return ual.simulation.AckLate(
                command=named(ual.simulation.Command, message.command, "command")
                if message.command
                else ual.simulation.Command.ANY,
                delay_s=message.delay,
            )
        case "FAILSAFE_TRIGGERED":
            return ual.simulation.FailsafeTriggered(cause=message.cause)
    raise none_of(
        "kind",
        message.kind,
        (
            "LINK_LOST",
            "POSITION_LOST",
            "ESTIMATOR_JUMPS",
            "MOTORS_WEAK",
            "BATTERY_LOW",
            "COMMAND_REFUSED",
            "ACK_LOST",
            "ACK_LATE",
            "FAILSAFE_TRIGGERED",
        ),
    )
