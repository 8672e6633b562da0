"""Whatever the contract's services beside flying ask for and tell, ROS can ask for and tell."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from google.protobuf.descriptor import Descriptor, FieldDescriptor, ServiceDescriptor

from ual.v1 import (
    camera_pb2,
    corrections_pb2,
    fence_pb2,
    gimbal_pb2,
    gripper_pb2,
    logs_pb2,
    mission_pb2,
    simulation_pb2,
)

PACKAGE = Path(__file__).parents[3] / "clients" / "ros2" / "ual_msgs"
MODULES = (
    camera_pb2,
    corrections_pb2,
    fence_pb2,
    gimbal_pb2,
    gripper_pb2,
    logs_pb2,
    mission_pb2,
    simulation_pb2,
)
ASKED_BY = {
    "ClearMission": "Trigger",
    "DownloadLog": "DownloadLog.action",
    "GetCameraStatus": "GetCameraStatus.srv",
    "GetEquipment": "ListEquipment.srv",
    "Grip": "MoveGripper.srv",
    "ListParts": "ListSimulationParts.srv",
    "MoveGimbalToNeutral": "OrderGimbal.srv",
    "PauseMission": "Trigger",
    "PilotArm": "Trigger",
    "PilotDisarm": "Trigger",
    "PilotGiveBack": "Trigger",
    "PilotMoveSticks": "MoveSticks.srv",
    "PilotTakeOver": "Trigger",
    "Release": "MoveGripper.srv",
    "ReleaseGimbalControl": "OrderGimbal.srv",
    "ResumeMission": "Trigger",
    "RetractGimbal": "OrderGimbal.srv",
    "StartMission": "FlyMission.action",
    "StartVideo": "OrderCamera.srv",
    "Step": "StepTime.srv",
    "StopPhotos": "OrderCamera.srv",
    "StopVideo": "OrderCamera.srv",
    "StreamCorrections": "",
    "TakeGimbalControl": "OrderGimbal.srv",
    "WatchGimbal": "",
    "WatchMission": "",
}
"""Where the name is another one; a topic where it is empty."""
CALLED = {
    "percent": ("zoom", "focus", "is_automatic"),
    "angles": ("roll", "pitch", "yaw"),
    "photo": ("photo", "is_photo"),
    "total_mib": ("storage_total",),
    "available_mib": ("storage_available",),
    "state": ("state", "storage"),
    "zoom_percent": ("zoom",),
    "focus_percent": ("focus",),
    "battery_percent": ("battery",),
    "recording_s": ("recording_time",),
    "intrinsics": ("camera_info",),
    "camera": ("camera", "optical"),
    "position_geo": ("position", "altitude_amsl", "altitude_home"),
    "latitude_deg": ("latitude", "place"),
    "longitude_deg": ("longitude", "place"),
    "seconds": ("hold",),
    "action": ("action", "camera_action"),
    "min_pwm_us": ("min_pulse",),
    "max_pwm_us": ("max_pulse",),
    "pwm_us": ("pwm_us", "pulses", "value"),
    "on_name": ("positions",),
    "off_name": ("positions",),
    "is_on": ("state",),
    "status": ("winch",),
    "position": ("position", "state"),
    "power_ratio": ("power",),
    "remaining_percent": ("remaining",),
    "size_bytes": ("size",),
    "stamp": ("stamp", "header"),
    "number": ("number", "gimbal"),
    "storage": ("storage",),
    "name": ("name", "positions"),
    "is_amsl": ("is_amsl",),
}
"""Fields whose names differ by more than a unit. One of them is enough, all of them where it has several."""
TOLD_BY = {
    "Camera": "Camera",
    "CameraStatus": "CameraStatus",
    "CameraStorage": "CameraStatus",
    "Photo": ("Photo", "Viewpoint"),
    "VideoStream": "VideoStream",
    "CorrectionsStatus": "CorrectionsStatus",
    "FenceZone": "FenceZone",
    "RallyPoint": ("RallyPoint", "GeoPoint"),
    "KeptFence": "KeptFence",
    "Gimbal": "Gimbal",
    "GimbalStatus": "GimbalStatus",
    "Gripper": "Device",
    "Winch": "Device",
    "WinchStatus": "WinchStatus",
    "Servo": "Device",
    "ServoPosition": "Device",
    "Relay": "Device",
    "Log": "Log",
    "TakeOffItem": "MissionItem",
    "WaypointItem": "MissionItem",
    "HoldItem": "MissionItem",
    "SpeedItem": "MissionItem",
    "HeadingItem": "MissionItem",
    "RegionOfInterestItem": "MissionItem",
    "CameraTriggerItem": "MissionItem",
    "LandItem": "MissionItem",
    "JumpItem": "MissionItem",
    "OtherItem": "MissionItem",
    "MissionProgress": "MissionProgress",
    "EstimatorJumps": "Fault",
    "MotorsWeak": "Fault",
    "BatteryLow": "Fault",
    "CommandRefused": "Fault",
    "AckLost": "Fault",
    "AckLate": "Fault",
    "FailsafeTriggered": "Fault",
}
NOT_ASKED = {("DownloadLog", "offset")}
"""A log is downloaded into a file, which goes on by itself."""
_UNIT = re.compile(r"_(m|s|rad|rad_s|m_s|n|v|a|c|px|hz)$")


def services() -> Iterator[ServiceDescriptor]:
    for module in MODULES:
        yield from module.DESCRIPTOR.services_by_name.values()


METHODS = [method for service in services() for method in service.methods]
MESSAGES = {name: found for module in MODULES for name, found in module.DESCRIPTOR.message_types_by_name.items()}


def fields_of(path: Path, part: int = 0) -> set[str]:
    """The fields of a part of an interface."""
    lines = [re.sub(r"\s*#.*", "", line) for line in path.read_text(encoding="utf-8").splitlines()]
    text = "\n".join(line for line in "\n".join(lines).split("---")[part].splitlines() if " = " not in line)
    return set(re.findall(r"^\S+ (\w+)$", text, re.MULTILINE))


def is_there(field: FieldDescriptor, fields: set[str]) -> bool:
    named = {field.name, _UNIT.sub("", field.name), *CALLED.get(field.name, ())}
    return bool(named & fields)


def path_of(rpc: str) -> Path | None:
    """The interface that asks what a method asks; None where ROS has a topic or a Trigger."""
    name = ASKED_BY.get(rpc, f"{rpc}.srv")
    return PACKAGE / Path(name).suffix[1:] / name if "." in name else None


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_each_request_can_be_made(method: object) -> None:
    name, request = method.name, method.input_type  # type: ignore[attr-defined]
    path = path_of(name)
    if path is None:
        assert name in ASKED_BY
        if ASKED_BY[name] == "Trigger":
            assert not request.fields
        return
    there = fields_of(path)
    wanted = [field for field in request.fields if (name, field.name) not in NOT_ASKED]
    missing = [field.name for field in wanted if not is_there(field, there)]
    assert not missing, f"{path.name} has no {', '.join(missing)}"


@pytest.mark.parametrize("name", TOLD_BY)
def test_each_message_can_be_told(name: str) -> None:
    told_by = TOLD_BY[name]
    files = (told_by,) if isinstance(told_by, str) else told_by
    there = {field for file in files for field in fields_of(PACKAGE / "msg" / f"{file}.msg")}
    message: Descriptor = MESSAGES[name]
    assert not [field.name for field in message.fields if not is_there(field, there)]


def test_no_message_is_forgotten() -> None:
    """What is neither a request nor a response, nor made of nothing but one of the others."""
    told_elsewhere = {
        "ActiveFault",  # Fault.fault_id
        "AngleRange",  # two numbers
        "CameraIntrinsics",  # sensor_msgs/CameraInfo
        "Fault",
        "FencePoint",  # GeoPoint
        "GimbalAngles",  # three numbers
        "ImageInfo",  # sensor_msgs/CompressedImage or Image, and Viewpoint
        "MissionItem",
        "MissionPlace",  # GeoPoint
        "MissionPlan",  # PlanMission.srv
        "StoredMission",  # DownloadMission.srv
    }
    own = {name for name in MESSAGES if not name.endswith(("Request", "Response")) and MESSAGES[name].fields}
    assert own - TOLD_BY.keys() == told_elsewhere
