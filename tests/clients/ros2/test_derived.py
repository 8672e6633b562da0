"""Values come back from messages of ROS as they went: what the node tells and reads, and the tests' own program."""

from __future__ import annotations

import importlib
import math
import re
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import ual
import ual.missions.items as mission
from tests.clients.ros2 import messages
from ual.cameras import (
    CameraAbility,
    CameraInfo,
    CameraIntrinsics,
    CameraMode,
    CameraStatus,
    CameraStorage,
    ImageKind,
    Photo,
    StorageState,
    VideoStream,
)
from ual.corrections import CorrectionsStatus
from ual.fences.values import FenceZone, KeptFence, RallyPoint
from ual.gimbals import (
    AngleRange,
    GimbalAbility,
    GimbalActivity,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalStatus,
)
from ual.gripper import WinchStatus
from ual.logs.values import Log
from ual.missions.plan import MissionProgress, MissionStage
from ual.parameters.values import Parameter, ParameterType
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual.types import Capability, Circle, Geofence, LeaseInfo, Limits, Plan
from ual_ros2.derived import values as of_node
from ual_ros2.services import cameras, gimbals
from ual_ros2.services.fields import Stamp

ROOT = Path(__file__).parents[3] / "clients" / "ros2"
POSE = ual.PoseStamped(ual.Pose(ual.Vector3(1.0, 2.0, 3.0), ual.Quaternion(0.0, 0.0, 0.0, 1.0)), "uav_1/odom")
PLACE = ual.GeoPoint(47.0, 8.0, 500.0, None, 550.0)
AMSL = ual.AltitudeReference.AMSL
VALUES: tuple[object, ...] = (
    GimbalInfo(1, "g", frozenset({GimbalAbility.YAW}), False, "uav_1/gimbal_1", AngleRange(-0.5, 0.25), note="odd"),
    GimbalStatus(),
    GimbalStatus(
        5.0,
        GimbalAngles(0.1, 0.2, 0.3),
        ual.Quaternion(0.0, 0.0, 0.0, 1.0),
        ual.Quaternion(0.0, 0.0, 1.0, 0.0),
        GimbalActivity.POINT,
        ual.PointStamped(ual.Vector3(1.0, 2.0, 3.0), "map"),
        0.5,
        GimbalControl.OTHER,
        "a program",
        ("hot",),
    ),
    CameraInfo(0, "c", frozenset({CameraAbility.ZOOM, CameraAbility.PHOTO}), image_kinds=frozenset({ImageKind.DEPTH})),
    CameraInfo(
        1, "c", frozenset(), False, "1.0", 64, 48, CameraIntrinsics(64, 48, 50.0, 51.0, 31.5, 23.5), "odd"
    ),
    CameraStatus(),
    CameraStatus(
        CameraMode.VIDEO, True, 2.0, 3.0, True, 4.0, 5, 6, CameraStorage(StorageState.FULL, 8.0, 2.0), 25.0, 50.0, 75.0
    ),
    Photo(0, 5.0, False, file_url="http://camera/0.jpg"),
    Photo(1, 5.0, body=POSE, camera=POSE, position_geo=PLACE),
    VideoStream("v", "rtsp://v", "H264", 64, 48, 30.0, True, True),
    CorrectionsStatus("caster", 1, 2, 3, 4, 5),
    CorrectionsStatus(age_s=0.5),
    FenceZone(True, ((47.0, 8.0), (47.1, 8.0), (47.0, 8.1))),
    FenceZone(False, ((47.0, 8.0),), 25.0),
    RallyPoint(47.0, 8.0, 30, AMSL),
    KeptFence(()),
    KeptFence((FenceZone(False, ((47.0, 8.0),), 25.0),), (RallyPoint(47.0, 8.0, 10),), False, (47.5, 8.5)),
    WinchStatus(),
    WinchStatus(2.5, -1.0, 3.0, 12.0, 1.5, 20.0, True, True, True, True),
    Log("1", 2),
    Log("2", 3, 5.0, True),
    Parameter("WHOLE", 3, ParameterType.INT32, True),
    Parameter("REAL", 2.5, ParameterType.REAL32, False, 1.0, 4.0, "m/s", "a speed", True),
    MissionProgress(MissionStage.UNKNOWN),
    MissionProgress(MissionStage.ACTIVE, 2, 1, "mission-1"),
    mission.TakeOff(10.0, number="1"),
    mission.TakeOff(10.0, AMSL, 47.0, 8.0),
    mission.Waypoint(47.0, 8.0, 20.0),
    mission.Waypoint(47.0, 8.0, 20.0, AMSL, 3.0, 2.0, 1.5),
    mission.Waypoint(47.0, 8.0, 20.0, yaw_rad=0.0),
    mission.HoldTime(4.0),
    mission.Speed(3.0),
    mission.Heading(1.0),
    mission.RegionOfInterest(47.0, 8.0, 5.0),
    mission.RegionOfInterestEnd(),
    mission.CameraTrigger(mission.CameraAction.BY_DISTANCE, 10.0),
    mission.Land(47.0, 8.0),
    mission.ReturnToLaunch(),
    mission.Jump(2, 3),
    mission.OtherItem(183, "a servo"),
    LinkLost(),
    PositionLost(),
    EstimatorJumps(ual.Vector3(1.0, 2.0, 3.0), 4.0),
    MotorsWeak(0.25),
    BatteryLow(50.0),
    CommandRefused(Command.TAKE_OFF, "no"),
    AckLost(),
    AckLate(Command.ARM, 2.0),
    FailsafeTriggered("fence"),
    ual.GeoWaypoint(47.0, 8.0, 5.0),
    ual.GeoWaypoint(47.0, 8.0, 5.0, AMSL, 0.0),
    ual.Frame("map", "", None, True),
    ual.Frame("deck", "map", ual.Transform(ual.Vector3(1.0, 2.0, 3.0), ual.Quaternion(), "map", "deck"), False),
    Geofence(),
    Geofence("map", (ual.Vector3(1.0, 2.0, 0.0),), Circle(ual.Vector3(3.0, 4.0, 0.0), 5.0), 0.0, 120.0),
    ual.Info("uav_1", "light"),
    ual.Info(
        "uav_1", "light", "a", "1", True, frozenset({Capability.LAND}), Limits(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), "2", True
    ),
    LeaseInfo("program", "local", 5.0),
    Plan(),
    Plan(3.0, 4.0),
    ual.TaskInfo("t", ual.TaskKind.LAND, ual.TaskStatus.RUNNING),
    ual.TaskInfo("t", ual.TaskKind.FOLLOW_PATH, ual.TaskStatus.SUCCEEDED, 1.0, 0.0, 3.0, 2, None, "a path", True),
)  # fmt: skip
NODE: Mapping[str, Callable[[Any], Any]] = {
    "GimbalStatus": lambda value: gimbals.status_fields("uav_1", 1, value),
    "Photo": lambda value: cameras.photo_of(0, value),
}
"""Messages to which the node adds of what they are."""
PARTS = {"GeoPosition"}
"""Messages with a part of the attributes of their values."""


@pytest.fixture(scope="module")
def of_tests() -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "ual_ros2" / "test"))
        yield importlib.import_module("derived_values")


def declared(name: str) -> dict[str, str]:
    """The fields of a message, and their types."""
    text = re.sub(r"\s*#.*", "", (ROOT / "ual_msgs" / "msg" / f"{name}.msg").read_text(encoding="utf-8"))
    return {name: kind for kind, name in re.findall(r"^(\S+) (\w+)$", text, re.MULTILINE)}


def message(kind: str, fields: Mapping[str, Any]) -> Any:
    """A message of ROS with what it has where nothing is put in."""
    if not (ROOT / "ual_msgs" / "msg" / f"{kind}.msg").exists():
        return of_ros(kind, fields)
    there = declared(kind)
    assert fields.keys() <= there.keys(), f"{kind} has no {fields.keys() - there.keys()}"
    return SimpleNamespace(**{name: content(each, fields.get(name)) for name, each in there.items()})


def content(kind: str, told: Any) -> Any:
    """Returns the content of a field: the reported value, or ROS' default."""
    if kind.endswith("]"):
        element = kind.partition("[")[0]
        is_message = element[0].isupper() or "/" in element
        return [message(element, each) if is_message else each for each in told or []]
    if kind == "builtin_interfaces/Time":
        return messages.stamp(*(divmod(round(told.utc_s * 1e9), 10**9) if told else (0, 0)))
    if kind[0].isupper() or "/" in kind:
        return message(kind, told or {})
    if told is None:
        return {"string": "", "bool": False}.get(kind, 0.0 if kind.startswith("float") else 0)
    wanted = {"string": str, "bool": bool}.get(kind, float if kind.startswith("float") else int)
    assert type(told) is wanted, f"ROS takes a {wanted.__name__}: {told!r}"
    return told


def of_ros(kind: str, fields: Mapping[str, Any]) -> Any:
    """A message of another package, as far as values are in it."""
    empty: Any = {
        "geometry_msgs/Quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "geometry_msgs/Transform": {"translation": messages.vector(), "rotation": messages.quaternion()},
        "sensor_msgs/CameraInfo": {"k": [0.0] * 9},
        "sensor_msgs/NavSatFix": {"latitude": 0.0, "longitude": 0.0, "altitude": 0.0},
        "std_msgs/Header": vars(messages.header()),
        "geometry_msgs/PoseStamped": {"header": messages.header(), "pose": messages.pose()},
        "geometry_msgs/PointStamped": {"header": messages.header(), "point": messages.vector()},
    }.get(kind, vars(messages.vector()))
    return SimpleNamespace(**{**empty, **{name: inside(each) for name, each in fields.items()}})


def inside(told: Any) -> Any:
    if isinstance(told, Stamp):
        return messages.stamp(*divmod(round(told.utc_s * 1e9), 10**9))
    if isinstance(told, Mapping):
        fields = {name: inside(each) for name, each in told.items()}
        return SimpleNamespace(**({"stamp": messages.stamp(), **fields} if "frame_id" in fields else fields))
    return told


def functions(modules: tuple[ModuleType, ...], *, is_reading: bool) -> dict[str, Callable[[Any], Any]]:
    """The functions that tell, or those that read, by the names of their messages."""
    found = [(name, each) for module in modules for name, each in vars(module).items() if callable(each)]
    ours = [(n, each) for n, each in found if getattr(each, "__doc__", None) and "message `" in each.__doc__]
    return {
        re.findall(r"message `(\w+)`", str(each.__doc__))[0]: each
        for name, each in ours
        if name.startswith("read_") is is_reading
    }


def name_of(value: object, told: Mapping[str, Callable[[Any], Any]]) -> str:
    """The message that tells a value."""
    for name, function in told.items():
        kind = typing.get_type_hints(function)["value"]
        if isinstance(value, typing.get_args(kind) or kind) and name not in PARTS:
            return name
    raise AssertionError(f"no message tells {value!r}")


@pytest.mark.parametrize("value", VALUES, ids=lambda value: type(value).__name__)
def test_a_value_comes_back_as_it_went(value: object, of_tests: ModuleType) -> None:
    told, read = (functions((of_node, of_tests), is_reading=each) for each in (False, True))
    name = name_of(value, told)
    fields = NODE.get(name, told[name])(value)
    assert read[name](message(name, fields)) == value


def test_no_message_is_left_out(of_tests: ModuleType) -> None:
    told = functions((of_node, of_tests), is_reading=False)
    assert {name_of(value, told) for value in VALUES} == told.keys() - PARTS


def test_a_position_on_earth_is_reported_with_its_receiver(of_tests: ModuleType) -> None:
    gps = ual.GpsInfo(ual.GpsFix.RTK_FIXED, 20, 0.5, 2.0, 1.0)
    for sample in (
        ual.Telemetry(ual.State.LANDED_ARMED),
        ual.Telemetry(ual.State.LANDED_ARMED, position_geo=PLACE, gps=gps),
    ):
        read = of_tests.read_geo_position(message("GeoPosition", of_node.geo_position_fields(sample)))
        assert read == {"position_geo": sample.position_geo, "gps": sample.gps}


def test_an_error_of_a_task_is_reported_with_its_metadata(of_tests: ModuleType) -> None:
    error = ual.TaskAbortedError("the pilot flies", {"by": "safety pilot"})
    info = ual.TaskInfo("t", ual.TaskKind.LAND, ual.TaskStatus.ABORTED, error=error)
    read = of_tests.read_task(message("Task", of_node.task_fields(info))).error
    assert (read.reason, read.message, read.metadata) == (error.reason, error.message, error.metadata)


def test_what_is_not_known_is_nan() -> None:
    assert all(
        math.isnan(of_node.winch_status_fields(WinchStatus())[name]) for name in ("length", "tension", "temperature")
    )
    assert all(math.isnan(of_node.gimbal_status_fields(GimbalStatus())[name]) for name in ("roll", "off_target"))


def test_shares_are_of_1_and_sizes_in_bytes_and_bounds_that_are_none_are_infinite() -> None:
    camera = of_node.camera_status_fields(CameraStatus(zoom_percent=25.0, storage=CameraStorage(available_mib=2.0)))
    assert (camera["zoom"], camera["storage_available"]) == (0.25, 2.0 * 1024 * 1024)
    assert of_node.fault_fields(BatteryLow(50.0))["remaining"] == 0.5
    fence = of_node.geofence_fields(Geofence())
    assert (fence["min_z"], fence["max_z"], fence["has_circle"]) == (-math.inf, math.inf, False)


@pytest.mark.parametrize("kind", ["MissionItem", "Fault"])
def test_a_kind_that_is_none_is_refused_with_those_that_are(kind: str) -> None:
    read = functions((of_node,), is_reading=True)[kind]
    with pytest.raises(ual.InvalidArgumentError, match=r"kind: 'FLIP' is none of (TAKE_OFF, WAYPOINT|LINK_LOST)"):
        read(message(kind, {"kind": "FLIP"}))
