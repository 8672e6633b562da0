"""Whatever the contract of flying and telling has, ROS has, too, or a reason stands here why not.

A new method, message or field of `ual/v1/ual.proto` fails these tests until it stands in one of the tables.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from google.protobuf.descriptor import Descriptor

from ual.v1 import ual_pb2

PACKAGES = Path(__file__).parents[3] / "clients" / "ros2"
MESSAGES, NODE = PACKAGES / "ual_msgs", PACKAGES / "ual_ros2" / "ual_ros2"
SERVICE = ual_pb2.DESCRIPTOR.services_by_name["UalService"]

METHODS = {
    "GetInfo": "topic info",
    "GetTelemetry": "topic state",
    "StreamTelemetry": "topic pose",
    "GetTransform": "topic /tf",
    "ListFrames": "list_frames",
    "AddFrame": "add_frame",
    "RemoveFrame": "remove_frame",
    "GetGeofence": "topic geofence",
    "GetRoute": "get_route",
    "Arm": "arm",
    "Disarm": "disarm",
    "TakeOff": "take_off",
    "Land": "land",
    "GoToWaypoint": "go_to_waypoint",
    "GoToWaypointGeo": "go_to_waypoint_geo",
    "FollowPath": "follow_path",
    "ReturnToLaunch": "return_to_launch",
    "SetPose": "set_pose",
    "SetVelocity": "set_velocity",
    "StreamSetpoints": "topic set_velocity",
    "SetExternalPose": "set_external_pose",
    "StreamExternalPoses": "topic external_pose",
    "RecoverFromManual": "take_control",
    "SetHome": "set_home",
    "Abort": "abort",
    "Pause": "pause",
    "Resume": "resume",
    "AcquireLease": "parameter lease",
    "KeepLease": "parameter lease",
    "ReleaseLease": "parameter lease",
    "GetLease": "topic lease",
    "GetTask": "get_task",
    "WatchTask": "get_task",
}
"""The command (a service or an action), topic or parameter of each method."""


class Left(str):
    """Why ROS does not have it."""

    __slots__ = ()


BY_SERVICE = Left("a service that does not block; an action always waits")
KEEPS_LEASE = Left("the node keeps the lease, whose secret is no part of ROS")
NO_MORE = Left("it never says more than that it would be taken")
STREAMS = Left("a topic has no end that could be answered; refusals are told with their counts")

TASK_ANSWER = {"task": "task_id", "plan": "plan"}
FIELDS: dict[str, dict[str, str]] = {
    # --- Requests and answers
    "GetInfoResponse": {
        "namespace": "msg/Info.msg ns",
        "backend": "msg/Info.msg backend",
        "autopilot": "msg/Info.msg autopilot",
        "autopilot_version": "msg/Info.msg autopilot_version",
        "is_simulation": "msg/Info.msg is_simulation",
        "capabilities": "msg/Info.msg capabilities",
        "limits": "msg/Info.msg horizontal_speed",
        "ual_version": "msg/Info.msg ual_version",
        "is_arming_allowed": "msg/Info.msg is_arming_allowed",
        "url": "msg/Info.msg url",
        "has_safety_pilot": "msg/Info.msg has_safety_pilot",
    },
    "GetTelemetryResponse": {"telemetry": "topic state"},
    "StreamTelemetryRequest": {"rate_hz": "parameter rate_hz"},
    "StreamTelemetryResponse": {"telemetry": "topic state", "missed_count": Left("DDS tells a subscriber its losses")},
    "GetTransformRequest": dict.fromkeys(("target_frame_id", "source_frame_id"), "topic /tf"),
    "GetTransformResponse": {"transform": "topic /tf"},
    "ListFramesResponse": {"frames": "srv/ListFrames.srv frames"},
    "GetGeofenceResponse": {"geofence": "topic geofence"},
    "GetRouteResponse": {"route": "srv/GetRoute.srv is_flown"},
    "AddFrameRequest": {"transform": "srv/AddFrame.srv transform"},
    "RemoveFrameRequest": {"frame_id": "srv/RemoveFrame.srv frame_id"},
    "TakeOffRequest": {
        "height_m": "action/TakeOff.action height",
        "non_blocking": BY_SERVICE,
        "dry_run": "action/TakeOff.action dry_run",
        "force": "action/TakeOff.action force",
    },
    "LandRequest": {"non_blocking": BY_SERVICE, "dry_run": "action/Land.action dry_run"},
    "GoToWaypointRequest": {
        "waypoint": "action/GoToWaypoint.action waypoint",
        "non_blocking": BY_SERVICE,
        "max_speed_m_s": "action/GoToWaypoint.action max_speed",
        "dry_run": "action/GoToWaypoint.action dry_run",
    },
    "GoToWaypointGeoRequest": {
        "latitude_deg": "action/GoToWaypointGeo.action waypoint",
        "longitude_deg": "action/GoToWaypointGeo.action waypoint",
        "altitude_m": "action/GoToWaypointGeo.action waypoint",
        "altitude_reference": "action/GoToWaypointGeo.action altitude_reference",
        "yaw_rad": "action/GoToWaypointGeo.action yaw",
        "non_blocking": BY_SERVICE,
        "max_speed_m_s": "action/GoToWaypointGeo.action max_speed",
        "dry_run": "action/GoToWaypointGeo.action dry_run",
    },
    "GeoWaypoint": {
        "latitude_deg": "msg/GeoWaypoint.msg waypoint",
        "longitude_deg": "msg/GeoWaypoint.msg waypoint",
        "altitude_m": "msg/GeoWaypoint.msg waypoint",
        "altitude_reference": "msg/GeoWaypoint.msg altitude_reference",
        "yaw_rad": "msg/GeoWaypoint.msg yaw",
    },
    "FollowPathRequest": {
        "waypoints": "action/FollowPath.action path",
        "corner_radius_m": "action/FollowPath.action corner_radius",
        "non_blocking": Left("only the action has paths, as in UAL for ROS 1, which had none"),
        "max_speed_m_s": "action/FollowPath.action max_speed",
        "leg_speeds_m_s": "action/FollowPath.action leg_speeds",
        "heading": "action/FollowPath.action heading",
        "point_of_interest": "action/FollowPath.action point_of_interest",
        "dry_run": "action/FollowPath.action dry_run",
        "geo_waypoints": "action/FollowPath.action geo_waypoints",
        "holds_s": "action/FollowPath.action holds",
    },
    "ReturnToLaunchRequest": {
        "height_m": "action/ReturnToLaunch.action height",
        "non_blocking": BY_SERVICE,
        "dry_run": "action/ReturnToLaunch.action dry_run",
    },
    **{
        f"{name}Response": {field: f"action/{name}.action {told}" for field, told in TASK_ANSWER.items()}
        for name in ("TakeOff", "Land", "GoToWaypoint", "GoToWaypointGeo", "FollowPath", "ReturnToLaunch")
    },
    "SetPoseRequest": {"pose": "srv/SetPose.srv pose", "dry_run": "srv/SetPose.srv dry_run"},
    "SetPoseResponse": {"plan": NO_MORE},
    "SetVelocityRequest": {"velocity": "srv/SetVelocity.srv velocity", "dry_run": "srv/SetVelocity.srv dry_run"},
    "SetVelocityResponse": {"plan": NO_MORE},
    "StreamSetpointsRequest": {"velocity": "topic set_velocity", "pose": "topic set_pose"},
    "StreamSetpointsResponse": {"accepted_count": STREAMS},
    "SetExternalPoseRequest": {"external_pose": "srv/SetExternalPose.srv pose"},
    "SetExternalPoseResponse": {"dropped": Left("no client of UAL returns it; the log of the daemon says it")},
    "StreamExternalPosesRequest": {"external_pose": "topic external_pose_cov"},
    "StreamExternalPosesResponse": {"accepted_count": STREAMS, "dropped_count": STREAMS},
    "RecoverFromManualRequest": {"dry_run": "srv/TakeControl.srv dry_run", "force": "srv/TakeControl.srv force"},
    "RecoverFromManualResponse": {"plan": NO_MORE},
    "SetHomeRequest": {"set_z": "srv/SetHome.srv set_z"},
    "AbortRequest": {"freeze": "srv/Abort.srv freeze", "task_id": "command cancel_task"},
    "PauseRequest": {"task_id": "command pause_task"},
    "ResumeRequest": {"task_id": "command resume_task"},
    "GetTaskRequest": {"task_id": "srv/GetTask.srv task_id"},
    "GetTaskResponse": {"task": "srv/GetTask.srv task"},
    "WatchTaskRequest": {"task_id": "srv/GetTask.srv task_id", "rate_hz": "parameter feedback_rate_hz"},
    "WatchTaskResponse": {"task": "srv/GetTask.srv task"},
    "AcquireLeaseRequest": {"holder": "parameter lease_holder", "take": "parameter lease_take"},
    "AcquireLeaseResponse": {"lease_id": KEEPS_LEASE, "lease": "topic lease", "expires_after_s": KEEPS_LEASE},
    "KeepLeaseRequest": {"lease_id": KEEPS_LEASE},
    "ReleaseLeaseRequest": {"lease_id": KEEPS_LEASE},
    "GetLeaseResponse": {"lease": "topic lease"},
    # --- What is told
    "Telemetry": {
        "header": "topic pose",
        "state": "msg/State.msg state",
        "pose": "topic pose",
        "velocity": "topic velocity",
        "odometry": "topic odom",
        "transform": "topic /tf",
        "reference_pose": "topic ref_pose",
        "position_geo": "topic position_geo",
        "battery": "topic battery",
        "gps": "topic position_geo",
        "flight_mode": "msg/State.msg flight_mode",
        "armed": "msg/State.msg armed",
        "state_reason": "msg/State.msg reason",
        "task": "msg/State.msg task",
        "sequence": Left("messages have a stamp, and DDS counts them"),
        "status_text": "diagnostics status_text",
        "frame_lost": "msg/State.msg frame_lost",
        "batteries": "topic batteries",
        "health": "topic health",
    },
    "Health": {
        "is_ready_to_arm": "diagnostics ready_to_arm",
        "failing_checks": "diagnostics failing_checks",
        "link_quality": "diagnostics link_quality",
        "failsafe": "msg/State.msg failsafe",
        "held_by": "msg/State.msg held_by",
    },
    "GeoPoint": {
        "latitude_deg": "msg/GeoPosition.msg latitude",
        "longitude_deg": "msg/GeoPosition.msg longitude",
        "altitude_amsl_m": "msg/GeoPosition.msg altitude_amsl",
        "altitude_home_m": "msg/GeoPosition.msg altitude_home",
        "altitude_ellipsoid_m": "msg/GeoPosition.msg altitude_ellipsoid",
    },
    "GpsInfo": {
        "fix": "msg/GeoPosition.msg gps_fix",
        "satellites_count": "msg/GeoPosition.msg satellites_count",
        "horizontal_accuracy_m": "msg/GeoPosition.msg horizontal_accuracy",
        "vertical_accuracy_m": "msg/GeoPosition.msg vertical_accuracy",
        "corrections_age_s": "msg/GeoPosition.msg corrections_age",
        "baseline_m": "msg/GeoPosition.msg baseline",
    },
    "Battery": dict.fromkeys(("remaining_percent", "voltage_v", "current_a", "id", "function"), "topic battery"),
    "Task": {
        "id": "msg/Task.msg task_id",
        "kind": "msg/Task.msg kind",
        "status": "msg/Task.msg status",
        "progress": "msg/Task.msg progress",
        "distance_left_m": "msg/Task.msg distance_left",
        "elapsed": "msg/Task.msg elapsed",
        "waypoint_index": "msg/Task.msg waypoint_index",
        "error": "msg/Task.msg reason",
        "description": "msg/Task.msg description",
        "is_paused": "msg/Task.msg is_paused",
    },
    "TaskError": {
        "reason": "msg/Task.msg reason",
        "message": "msg/Task.msg message",
        "metadata": "msg/Task.msg metadata",
    },
    "Plan": {"length_m": "msg/Plan.msg length", "duration": "msg/Plan.msg duration"},
    "Frame": {
        "frame_id": "msg/Frame.msg frame_id",
        "parent_frame_id": "msg/Frame.msg parent_frame_id",
        "transform": "msg/Frame.msg transform",
        "is_static": "msg/Frame.msg is_static",
    },
    "Limits": {
        "horizontal_speed_m_s": "msg/Info.msg horizontal_speed",
        "climb_speed_m_s": "msg/Info.msg climb_speed",
        "descent_speed_m_s": "msg/Info.msg descent_speed",
        "horizontal_acceleration_m_s2": "msg/Info.msg horizontal_acceleration",
        "vertical_acceleration_m_s2": "msg/Info.msg vertical_acceleration",
        "yaw_rate_rad_s": "msg/Info.msg yaw_rate",
    },
    "Geofence": {
        "header": "msg/Geofence.msg header",
        "corners": "msg/Geofence.msg corners",
        "circle": "msg/Geofence.msg has_circle",
        "min_z_m": "msg/Geofence.msg min_z",
        "max_z_m": "msg/Geofence.msg max_z",
    },
    "Circle": {"center": "msg/Geofence.msg center", "radius_m": "msg/Geofence.msg radius"},
    "Route": {
        "header": "srv/GetRoute.srv route",
        "points": "srv/GetRoute.srv route",
        "task_id": "srv/GetRoute.srv task_id",
        "is_goal_moving": "srv/GetRoute.srv is_goal_moving",
    },
    "Lease": {
        "holder": "msg/Lease.msg holder",
        "identity": "msg/Lease.msg identity",
        "since": "msg/Lease.msg since",
    },
    "ExternalPose": {
        "pose": "srv/SetExternalPose.srv pose",
        "position_std_dev_m": "srv/SetExternalPose.srv position_std_dev",
        "orientation_std_dev_rad": "srv/SetExternalPose.srv orientation_std_dev",
    },
    # --- As ROS' own messages
    **{
        name: dict.fromkeys(fields.split(), f"ros {name}")
        for name, fields in {
            "Header": "stamp frame_id",
            "Vector3": "x y z",
            "Quaternion": "x y z w",
            "Pose": "position orientation",
            "PoseStamped": "header pose",
            "PointStamped": "header point",
            "Twist": "linear angular",
            "TwistStamped": "header twist",
            "Transform": "header child_frame_id translation rotation",
            "Odometry": "header child_frame_id pose twist",
        }.items()
    },
}
"""Where each field of the contract is in ROS: in a file, on a topic, in the diagnostics; or why it is not."""


def reached() -> dict[str, Descriptor]:
    """Returns the messages of the service, with all that they have, by their names."""
    found: dict[str, Descriptor] = {}

    def reach(message: Descriptor) -> None:
        if message.file is not ual_pb2.DESCRIPTOR or message.full_name in found or message.GetOptions().map_entry:
            return
        found[message.full_name] = message
        for field in message.fields:
            if field.message_type is not None:
                reach(field.message_type)

    for method in SERVICE.methods:
        reach(method.input_type)
        reach(method.output_type)
    return {message.name: message for message in found.values() if message.fields}


def test_each_method_is_there_or_a_reason_is() -> None:
    assert set(METHODS) == {method.name for method in SERVICE.methods}


def test_each_field_is_there_or_a_reason_is() -> None:
    contract = {name: [field.name for field in message.fields] for name, message in reached().items()}
    assert {name: list(fields) for name, fields in FIELDS.items()} == contract


def places() -> Iterator[str]:
    yield from (place if " " in place else f"command {place}" for place in METHODS.values())
    yield from (place for fields in FIELDS.values() for place in fields.values() if not isinstance(place, Left))


@pytest.mark.parametrize("place", sorted(set(places())))
def test_each_place_is_there(place: str) -> None:
    kind, name = place.split()
    if kind == "ros":
        return
    if "/" in kind:
        assert re.search(rf"^\S+ {name}( |$)", (MESSAGES / kind).read_text(encoding="utf-8"), re.MULTILINE)
        return
    file, is_told = {
        "command": ("flights.py", rf'\(\s*"{name}",'),
        "parameter": ("settings.py", rf'^    "{name}": \('),
        "diagnostics": ("health.py", rf'^        "{name}": '),
        "topic": ("*.py", rf'_(publisher|subscribe|Asked)\([^()]*"{name}"|create_publisher\([^()]*"{name}"'),
    }[kind]
    text = "\n".join(path.read_text(encoding="utf-8") for path in sorted(NODE.glob(file)))
    assert re.search(is_told, text, re.MULTILINE), f"{file} has no {place}"
