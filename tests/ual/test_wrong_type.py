"""An argument of the wrong type gets one clear error: the same from the class and from both clients."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

import ual
from ual.shared.flags import flag
from ual.types import PathHeading
from ual_daemon import UAL
from ual_daemon.settings import ConfigError

P = ual.Pose.at(1.0, 2.0, 3.0)
Refuse = Callable[..., ual.InvalidArgumentError]


def refused_by_client(member: str, *args: object, **kwargs: object) -> ual.InvalidArgumentError:
    with ual.Uav("uav_1", address="127.0.0.1:1") as uav, pytest.raises(ual.InvalidArgumentError) as caught:
        getattr(uav, member)(*args, **kwargs)
    return caught.value


def refused_by_dry_run(member: str, *args: object, **kwargs: object) -> ual.InvalidArgumentError:
    with ual.Uav("uav_1", address="127.0.0.1:1") as uav, pytest.raises(ual.InvalidArgumentError) as caught:
        getattr(uav.dry_run, member)(*args, **kwargs)
    return caught.value


def refused_by_aio(member: str, *args: object, **kwargs: object) -> ual.InvalidArgumentError:
    async def main() -> ual.InvalidArgumentError:
        async with ual.aio.Uav("uav_1", address="127.0.0.1:1") as uav:
            with pytest.raises(ual.InvalidArgumentError) as caught:
                await getattr(uav, member)(*args, **kwargs)
        return caught.value

    return asyncio.run(main())


@pytest.fixture(scope="module")
def refused_by_class() -> Iterator[Refuse]:
    with UAL(backend="light") as uav:

        def refuse(member: str, *args: object, **kwargs: object) -> ual.InvalidArgumentError:
            with pytest.raises(ual.InvalidArgumentError) as caught:
                getattr(uav, member)(*args, **kwargs)
            return caught.value

        yield refuse


# Member, arguments, field, and what the message says of it.
STRUCTURE: list[tuple[str, tuple[Any, ...], str, str]] = [
    ("go_to_waypoint", ((1, 2, 3),), "waypoint", "(1, 2, 3) is of type tuple; pass ual.Pose.at(x, y, z)"),
    ("go_to_waypoint", (5,), "waypoint", "5 is of type int; pass ual.Pose.at(x, y, z)"),
    ("go_to_waypoint", (None,), "waypoint", "None is of type NoneType; pass ual.Pose.at(x, y, z)"),
    ("go_to_waypoint", (ual.Vector3(1, 2, 3),), "waypoint", "is of type Vector3; pass ual.Pose.at(x, y, z)"),
    ("go_to_waypoint", (ual.GeoWaypoint(1, 2, 3),), "waypoint", "is of type GeoWaypoint; pass ual.Pose.at(x, y, z)"),
    ("go_to_waypoint", (ual.Pose((1, 2, 3)),), "waypoint.pose.position", "pass ual.Vector3(x, y, z)"),  # type: ignore[arg-type]
    ("go_to_waypoint", (ual.Pose(P.position, 0.5),), "waypoint.pose.orientation", "Quaternion.from_yaw(yaw_rad)"),  # type: ignore[arg-type]
    ("go_to_waypoint", (ual.PoseStamped((1, 2, 3), "map"),), "waypoint.pose", "pass ual.Pose.at(x, y, z)"),  # type: ignore[arg-type]
    ("set_pose", ((1, 2, 3),), "pose", "(1, 2, 3) is of type tuple; pass ual.Pose.at(x, y, z)"),
    ("set_pose", (ual.Twist(),), "pose", "is of type Twist; pass ual.Pose.at(x, y, z)"),
    ("set_velocity", ((1, 0, 0),), "velocity", "(1, 0, 0) is of type tuple; pass ual.Twist(ual.Vector3(x, y, z))"),
    ("set_velocity", (ual.Vector3(1, 0, 0),), "velocity", "is of type Vector3; pass ual.Twist(ual.Vector3(x, y, z))"),
    ("set_velocity", (ual.Twist((1, 0, 0)),), "velocity.twist.linear", "pass ual.Vector3(x, y, z)"),  # type: ignore[arg-type]
    ("set_velocity", (ual.Twist(angular=0.5),), "velocity.twist.angular", "0.5 is of type float"),  # type: ignore[arg-type]
    ("follow_path", ([P, (1, 2, 3)],), "waypoints[1]", "(1, 2, 3) is of type tuple; pass ual.Pose.at(x, y, z)"),
    ("follow_path", (P,), "waypoints", "is not a list of waypoints; pass [ual.Pose.at(x, y, z), ...]"),
]
NO_DRY_RUN: list[tuple[str, tuple[Any, ...], str, str]] = [
    ("add_frame", ((1, 2, 3),), "transform", "pass ual.Transform(ual.Vector3(x, y, z), child_frame_id=name)"),
    ("add_frame", (ual.Transform((1, 2, 3)),), "transform.translation", "pass ual.Vector3(x, y, z)"),  # type: ignore[arg-type]
]
PARTS: list[tuple[str, tuple[Any, ...], Mapping[str, Any], str, str]] = [
    ("take_off", ("3",), {}, "height_m", "'3' is not a number"),
    ("take_off", ((3,),), {}, "height_m", "(3,) is not a number"),
    ("take_off", (None,), {}, "height_m", "None is not a number"),
    ("take_off", (True,), {}, "height_m", "True is not a number"),
    ("take_off", (3.0,), {"force": "no"}, "force", "'no' is not True or False"),
    ("return_to_launch", (True,), {}, "height_m", "True is not a number"),
    ("go_to_waypoint", (P,), {"max_speed_m_s": True}, "max_speed_m_s", "True is not a number"),
    ("go_to_waypoint_geo", (True, 2, 3), {}, "latitude_deg", "True is not a number"),
    ("follow_path", ([P],), {"leg_speeds_m_s": [True]}, "leg_speeds_m_s[0]", "True is not a number"),
    ("recover_from_manual", (), {"force": "no"}, "force", "'no' is not True or False"),
    ("take_off", (10**400,), {}, "height_m", "inf is not a finite number"),
    ("take_off", (np.zeros(2),), {}, "height_m", "array([0., 0.]) is not a number"),
    ("go_to_waypoint_geo", (37.4, None, 20), {}, "longitude_deg", "None is not a number"),
    ("set_velocity", (ual.Twist(ual.Vector3(10**400)),), {}, "velocity.twist.linear.x", "inf is not a finite number"),
    ("go_to_waypoint", (ual.Pose.at("1", 2, 3),), {}, "waypoint.pose.position.x", "'1' is not a number"),  # type: ignore[arg-type]
    ("go_to_waypoint", (P,), {"max_speed_m_s": "2"}, "max_speed_m_s", "'2' is not a number"),
    ("go_to_waypoint_geo", ("a", 2, 3), {}, "latitude_deg", "'a' is not a number"),
    ("go_to_waypoint_geo", (1, 2, 3, "home"), {}, "altitude_reference", "'home' is not an AltitudeReference"),
    ("follow_path", ([P],), {"heading": "along"}, "heading", "'along' is not a PathHeading"),
    ("follow_path", ([P],), {"leg_speeds_m_s": ["1"]}, "leg_speeds_m_s[0]", "'1' is not a number"),
    *(
        ("set_velocity", (ual.Twist(each, turn),), {}, f"velocity.twist.{name}", f"{said} is not a number")
        for each, turn, name, said in (
            (ual.Vector3(True), ual.Vector3(), "linear.x", True),
            (ual.Vector3(0.0, False), ual.Vector3(), "linear.y", False),
            (ual.Vector3(), ual.Vector3(0.0, 0.0, True), "angular.z", True),
        )
    ),
    *(
        ("set_pose", (ual.PoseStamped(pose, "map"),), {}, f"pose.pose.{name}", "True is not a number")
        for pose, name in (
            (ual.Pose.at(True, 2.0, 3.0), "position.x"),
            (ual.Pose.at(1.0, 2.0, True), "position.z"),
            (ual.Pose(ual.Vector3(1.0, 2.0, 3.0), ual.Quaternion(0.0, 0.0, 0.0, True)), "orientation.w"),
        )
    ),
    ("set_velocity", (ual.Twist(ual.Vector3("x")),), {}, "velocity.twist.linear.x", "'x' is not a number"),  # type: ignore[arg-type]
]


def test_a_wrong_type_is_refused_alike_by_all(refused_by_class: Refuse) -> None:
    for member, args, field, said in STRUCTURE + NO_DRY_RUN:
        refusals = [refuse(member, *args) for refuse in (refused_by_class, refused_by_client, refused_by_aio)]
        if member != "add_frame":
            refusals.append(refused_by_dry_run(member, *args))
        assert {error.message for error in refusals} == {refusals[0].message}
        assert refusals[0].message.startswith(f"{field}: ")
        assert said in refusals[0].message
        assert refusals[0].metadata["field"] == field


@pytest.mark.parametrize(("member", "args", "kwargs", "field", "said"), PARTS)
def test_a_part_that_is_no_number_is_named_alike_by_all(
    member: str, args: tuple[Any, ...], kwargs: Mapping[str, Any], field: str, said: str, refused_by_class: Refuse
) -> None:
    for refuse in (refused_by_class, refused_by_client, refused_by_aio, refused_by_dry_run):
        error = refuse(member, *args, **kwargs)
        assert error.message.startswith(f"{field}: {said}")
        assert error.metadata["field"] == field


@pytest.mark.parametrize(
    ("pose", "std_dev_m", "field"),
    [
        (ual.Pose.at(1.0, True, 3.0), None, "pose.pose.position.y"),
        (P, True, "position_std_dev_m"),
    ],
)
def test_a_bool_is_no_part_of_a_pose_from_outside(pose: ual.Pose, std_dev_m: float | None, field: str) -> None:
    for refuse in (refused_by_client, refused_by_aio):
        error = refuse("set_external_pose", pose, position_std_dev_m=std_dev_m)
        assert error.message == f"{field}: True is not a number"


@pytest.mark.parametrize(
    ("member", "args", "kwargs", "field"),
    [
        ("set_home", ("no",), {}, "set_z"),
        ("abort", ("no",), {}, "freeze"),
        ("take_off", (3.0,), {"blocking": "no"}, "blocking"),
        ("land", (), {"blocking": "no"}, "blocking"),
        ("lease", (), {"take": "no"}, "take"),
    ],
)
def test_what_is_switched_is_true_or_false(
    member: str, args: tuple[Any, ...], kwargs: Mapping[str, Any], field: str, refused_by_class: Refuse
) -> None:
    refusals = [refused_by_class, refused_by_client]
    if not {"blocking", "take"} & set(kwargs):  # these are the class's and the blocking client's
        refusals.append(refused_by_aio)
    for refuse in refusals:
        error = refuse(member, *args, **kwargs)
        assert error.message == f"{field}: 'no' is not True or False"
        assert error.metadata["field"] == field


@pytest.mark.parametrize("value", [True, False, 1, 0, np.bool_(True)])
def test_what_numpy_switches_and_1_and_0_are_flags(value: object) -> None:
    assert flag(value, "set_z") is bool(value)


@pytest.mark.parametrize("value", [2, 1.0, None, "", [True]])
def test_anything_else_is_no_flag(value: object) -> None:
    with pytest.raises(ual.InvalidArgumentError, match=r"set_z: .* is not True or False"):
        flag(value, "set_z")


@pytest.mark.parametrize(
    ("member", "args", "field"),
    [
        ("go_to_waypoint", (ual.PoseStamped(P, b"map"),), "waypoint"),  # type: ignore[arg-type]
        ("follow_path", ([ual.PoseStamped(P, b"map")],), "waypoints[0]"),  # type: ignore[arg-type]
        ("set_pose", (ual.PoseStamped(P, b"map"),), "pose"),  # type: ignore[arg-type]
        ("set_velocity", (ual.TwistStamped(ual.Twist(), b"map"),), "velocity"),  # type: ignore[arg-type]
        ("set_external_pose", (ual.PoseStamped(P, b"map"),), "pose"),  # type: ignore[arg-type]
        ("add_frame", (ual.Transform(P.position, child_frame_id=b"x"),), "transform"),  # type: ignore[arg-type]
        ("remove_frame", (b"x",), "frame_id"),
        ("transform", (b"map",), "target_frame_id"),
    ],
)
def test_bytes_are_no_name_of_a_frame(member: str, args: tuple[Any, ...], field: str, refused_by_class: Refuse) -> None:
    for refuse in (refused_by_class, refused_by_client, refused_by_aio):
        assert refuse(member, *args).metadata["field"].startswith(field)


def test_a_point_of_interest_is_a_vector() -> None:
    error = refused_by_client("follow_path", [P], heading=PathHeading.POINT_OF_INTEREST, point_of_interest=(1, 2, 3))
    assert error.message == "point_of_interest: (1, 2, 3) is of type tuple; pass ual.Vector3(x, y, z)"


def test_a_coordinate_that_is_missing_is_not_zero() -> None:
    path = [ual.GeoWaypoint(37.4, None, 20)]  # type: ignore[arg-type]
    error = refused_by_client("follow_path", path)
    assert error.message == "waypoints[0].longitude_deg: None is not a number"


def test_the_stamp_of_a_pose_from_outside_is_a_number() -> None:
    for stamp_s, shown in ((math.nan, "nan"), (math.inf, "inf")):
        error = refused_by_client("set_external_pose", ual.PoseStamped(P, "map", stamp_s))
        assert error.message == f"pose.stamp_s: {shown} is not a finite number"


def test_a_heading_that_is_no_number_is_refused_where_it_is_passed() -> None:
    with pytest.raises(ual.InvalidArgumentError, match="yaw_rad: 'north' is not an angle"):
        ual.Pose.at(1.0, 2.0, 3.0, "north")  # type: ignore[arg-type]


def test_a_task_that_is_named_by_a_number_is_not_there(refused_by_class: Refuse) -> None:
    for refused in (refused_by_client, refused_by_aio, refused_by_class):
        assert str(refused("task", 1)) == "task_id: there is no task 1"


@pytest.mark.parametrize("make", [ual.Uav, ual.aio.Uav])
def test_an_address_instead_of_a_name_is_refused(make: Callable[..., object]) -> None:
    """It would be looked for as a name, at the default port of this computer: another UAV may be there."""
    with pytest.raises(ual.InvalidArgumentError, match=r"pass it as address='10.0.0.7:50051'"):
        make("10.0.0.7:50051")
    with pytest.raises(ual.InvalidArgumentError, match="ns: 50051 is no name; pass a text as 'uav_1'"):
        make(50051)
    with pytest.raises(ual.InvalidArgumentError, match="50051 is not an address; write HOST:PORT"):
        make(address=50051)
    # gRPC takes a port modulo 65536: 84515 is 18979, whatever listens there.
    with pytest.raises(ual.InvalidArgumentError, match=r"the port of '127.0.0.1:84515' is not from 1 to 65535"):
        make(address="127.0.0.1:84515")
    with pytest.raises(ual.InvalidArgumentError, match=r"the port of '\[::1\]:0' is not"):
        make(address="[::1]:0")


@pytest.mark.parametrize(
    ("argument", "why"),
    [
        ({"ns": "uav-1"}, "ns: 'uav-1' is no name"),
        ({"ns": 1}, "ns: 1 is no name"),
        ({"settings": {"home_pose": [1, 2, 0]}}, "settings: expected a VehicleSettings, got a dict"),
    ],
)
def test_the_class_refuses_what_is_no_name_and_no_settings(argument: Mapping[str, Any], why: str) -> None:
    with pytest.raises(ConfigError, match=why):
        UAL(**argument)
