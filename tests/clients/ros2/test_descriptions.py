"""What a daemon says of its UAV, in messages."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

import ual
from tests.clients.ros2 import messages
from ual.types import Capability, Circle, Geofence, LeaseInfo, Plan
from ual_ros2 import descriptions


def filled(message: SimpleNamespace) -> dict[str, object]:
    return vars(message)


def test_who_a_uav_is() -> None:
    message = SimpleNamespace()
    able = frozenset({Capability.TAKE_OFF, Capability.ARM})
    limits = ual.types.Limits(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    descriptions.fill_info(message, ual.Info("uav_1", "light", capabilities=able, limits=limits, url="here"))
    told = filled(message)
    assert (told["ns"], told["backend"], told["autopilot"], told["url"]) == ("uav_1", "light", "", "here")
    assert told["capabilities"] == ["ARM", "TAKE_OFF"]
    names = ("horizontal_speed", "climb_speed", "descent_speed", "horizontal_acceleration", "vertical_acceleration")
    assert [told[name] for name in (*names, "yaw_rate")] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert (told["has_safety_pilot"], told["is_arming_allowed"]) == (True, False)


def test_where_it_may_fly() -> None:
    def message() -> SimpleNamespace:
        return SimpleNamespace(header=messages.header(), center=messages.vector(), radius=0.0)

    corners = (ual.Vector3(1.0), ual.Vector3(2.0), ual.Vector3(3.0))
    all_of_it, nothing = message(), message()
    circle = Circle(ual.Vector3(4.0, 5.0), 6.0)
    descriptions.fill_geofence(all_of_it, Geofence("map", corners, circle, -1.0, 9.0), messages.vector)
    assert [each.x for each in all_of_it.corners] == [1.0, 2.0, 3.0]
    assert (all_of_it.has_circle, all_of_it.center.y, all_of_it.radius) == (True, 5.0, 6.0)
    assert (all_of_it.min_z, all_of_it.max_z, all_of_it.header.frame_id) == (-1.0, 9.0, "map")
    descriptions.fill_geofence(nothing, Geofence(), messages.vector)
    assert (nothing.corners, nothing.has_circle, nothing.min_z, nothing.max_z) == ([], False, -math.inf, math.inf)


def test_who_holds_the_lease() -> None:
    message = SimpleNamespace()
    descriptions.fill_lease(message, LeaseInfo("survey", "local", 5.0))
    assert filled(message) == {"is_held": True, "holder": "survey", "identity": "local"}


def test_a_task_and_why_it_has_ended() -> None:
    error = ual.TaskAbortedError("replaced by land", {"by": "land"})
    ended = ual.TaskInfo("land-1", ual.TaskKind.LAND, ual.TaskStatus.ABORTED, elapsed_s=2.0, error=error)
    told = descriptions.fill_task(SimpleNamespace(), ended, dict)
    assert (told.task_id, told.kind, told.status, told.elapsed) == ("land-1", "LAND", "ABORTED", 2.0)
    assert (told.reason, told.message) == ("TASK_ABORTED", "replaced by land")
    assert told.metadata == [{"key": "by", "value": "land"}]
    assert math.isnan(told.progress)
    assert told.waypoint_index == -1
    path = ual.TaskInfo("path-1", ual.TaskKind.FOLLOW_PATH, ual.TaskStatus.RUNNING, 0.5, 3.0, waypoint_index=0)
    told = descriptions.fill_task(SimpleNamespace(), path, dict)
    assert (told.progress, told.distance_left, told.waypoint_index) == (0.5, 3.0, 0)


@pytest.mark.parametrize(("plan", "known"), [(Plan(3.0, 2.0), [3.0, 2.0]), (Plan(), [])])
def test_a_plan(plan: Plan, known: list[float]) -> None:
    told = descriptions.fill_plan(SimpleNamespace(), plan)
    assert [each for each in (told.length, told.duration) if not math.isnan(each)] == known


def test_a_frame() -> None:
    def message() -> SimpleNamespace:
        return SimpleNamespace(transform=messages.transform_stamped().transform)

    there = ual.Transform(ual.Vector3(1.0, 2.0, 3.0), ual.Quaternion.from_yaw(1.0), "map", "mast")
    told = descriptions.fill_frame(message(), ual.Frame("mast", "map", there, True))
    assert (told.frame_id, told.parent_frame_id, told.is_known, told.is_static) == ("mast", "map", True, True)
    assert (told.transform.translation.z, told.transform.rotation.w) == (3.0, there.rotation.w)
    assert not descriptions.fill_frame(message(), ual.Frame("mast", "map", None, False)).is_known


def test_a_place_on_earth() -> None:
    gps = ual.GpsInfo(ual.types.GpsFix.RTK_FIXED, 17, 0.01, corrections_age_s=0.5)
    message = SimpleNamespace()
    descriptions.fill_position(message, ual.GeoPoint(37.0, -6.0, 12.0, None, 60.0), gps)
    assert (message.latitude, message.longitude) == (37.0, -6.0)
    assert (message.altitude_amsl, message.altitude_ellipsoid) == (12.0, 60.0)
    assert (message.gps_fix, message.satellites_count, message.horizontal_accuracy) == ("RTK_FIXED", 17, 0.01)
    assert message.corrections_age == 0.5
    unknown = (message.altitude_home, message.vertical_accuracy, message.baseline)
    assert all(map(math.isnan, unknown))
    descriptions.fill_position(message, ual.GeoPoint(37.0, -6.0), None)
    assert (message.gps_fix, message.satellites_count) == ("", 0)
    assert math.isnan(message.horizontal_accuracy)


def test_a_refusal() -> None:
    message = SimpleNamespace()
    descriptions.fill_refusal(message, "set_pose", ual.GeofenceError("far", {"field": "pose"}), 3, dict)
    assert filled(message) == {
        "topic": "set_pose",
        "reason": "GEOFENCE",
        "message": "far",
        "metadata": [{"key": "field", "value": "pose"}],
        "count": 3,
    }
