"""Services of ROS in addition to the paper's: explained refusals, dry runs, tasks, frames, routes, and the UAV's
info.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
from conftest import ARMED_FAST, Processes
from flying import ABORTED, LATCHED, SUCCEEDED, Client, pose, velocity, waited
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Path
from sensor_msgs.msg import NavSatFix
from ual_msgs import action, msg, srv

import ual

UAL = "/uav_1/ual"


@pytest.fixture(scope="module")
def uav(processes: Processes) -> Iterator[ual.Uav]:
    processes.daemon(*ARMED_FAST)
    processes.node("ns:=uav_1", "rate_hz:=50.0")
    with ual.Uav("uav_1") as uav:
        yield uav


def metadata(message: Any) -> dict[str, str]:
    return {each.key: each.value for each in message.metadata}


# --- Refused setpoints ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "topic", "message"),
    [
        (PoseStamped, "set_pose", pose(math.nan, 0.0, 3.0)),
        (TwistStamped, "set_velocity", velocity(math.nan)),
        (Twist, "cmd_vel", velocity(math.nan).twist),
        (PoseStamped, "external_pose", pose(0.0, 0.0, 3.0, "map")),
    ],
)
@pytest.mark.usefixtures("flying")
def test_a_refused_setpoint_is_reported_and_counted(client: Client, kind: type, topic: str, message: Any) -> None:
    told = client.hear(msg.Refusal, f"{UAL}/refusals", 100)
    waited(lambda: client.node.count_publishers(f"{UAL}/refusals"))
    wrong = client.repeat(0.02, kind, f"{UAL}/{topic}", lambda: message)
    ours: list[Any] = waited(lambda: found if len(found := [each for each in told if each.topic == topic]) > 2 else [])
    client.node.destroy_timer(wrong)
    assert {each.reason for each in ours} == {"INVALID_ARGUMENT"}
    assert metadata(ours[0])["field"]
    assert ours[0].count == 1
    assert ours[1].count > 1
    first_s, second_s = (each.header.stamp.sec + each.header.stamp.nanosec / 1e9 for each in ours[:2])
    assert second_s - first_s > 0.4, "at most every 0.5 s"


def test_one_setpoint_is_answered(client: Client, flying: ual.Uav) -> None:
    refused = client.call(srv.SetVelocity, f"{UAL}/set_velocity", velocity=velocity(math.inf))
    with pytest.raises(ual.InvalidArgumentError) as same:
        flying.set_velocity(ual.Twist(ual.Vector3(math.inf, 0.0, 0.0)))
    assert (refused.reason, refused.message) == ("INVALID_ARGUMENT", same.value.message)
    assert client.call(srv.SetPose, f"{UAL}/set_pose", pose=pose(1.0, 0.0, 3.0), dry_run=True).success
    assert flying.reference_pose() is None or flying.reference_pose().pose.position.x < 0.5  # type: ignore[union-attr]
    assert client.call(srv.SetPose, f"{UAL}/set_pose", pose=pose(1.0, 0.0, 3.0)).success
    waited(lambda: (flying.pose().pose.position - ual.Vector3(1.0, 0.0, 3.0)).norm() < 0.3)


@pytest.mark.usefixtures("flying")
def test_a_setpoint_by_the_service_is_answered_while_a_topic_streams(client: Client) -> None:
    stream = client.repeat(0.02, TwistStamped, f"{UAL}/set_velocity", lambda: velocity(0.1))
    for _ in range(10):
        refused = client.call(srv.SetVelocity, f"{UAL}/set_velocity", velocity=velocity(math.inf))
        assert refused.reason == "INVALID_ARGUMENT"
    client.node.destroy_timer(stream)


# --- Dry runs ---------------------------------------------------------------------------------------------------------


def test_a_dry_run_says_what_a_goal_would_be(client: Client, flying: ual.Uav) -> None:
    far = {"waypoint": pose(6.0, 8.0, 3.0), "max_speed": 0.5}
    status, result = client.fly(action.GoToWaypoint, f"{UAL}/go_to_waypoint", **far, dry_run=True)
    plan = flying.dry_run.go_to_waypoint(ual.Pose.at(6.0, 8.0, 3.0), max_speed_m_s=0.5)
    assert (status, result.success, result.task_id) == (SUCCEEDED, True, "")
    assert result.plan.length == pytest.approx(10.0, abs=0.3)
    assert result.plan.duration == pytest.approx(plan.duration_s, abs=0.5)
    _, landing = client.fly(action.Land, f"{UAL}/land", dry_run=True)
    assert landing.success
    assert math.isnan(landing.plan.length)
    status, refused = client.fly(action.TakeOff, f"{UAL}/take_off", height=3.0, dry_run=True)
    assert (status, refused.reason) == (ABORTED, "WRONG_STATE")
    assert flying.telemetry().task is None
    assert flying.state() is ual.State.FLYING_AUTO


def test_a_dry_run_leaves_a_goal_flying(client: Client, flying: ual.Uav) -> None:
    goal = client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", lambda _: None, waypoint=pose(50.0, 0.0, 3.0))
    waited(lambda: flying.telemetry().task)
    assert client.fly(action.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(0.0, 0.0, 3.0), dry_run=True)[
        1
    ].success
    assert flying.telemetry().task is not None
    assert client.cancel(goal)
    client.end_of(goal)


# --- Tasks ------------------------------------------------------------------------------------------------------------


def test_a_task_is_found_by_its_identifier_and_ordered(client: Client, flying: ual.Uav) -> None:
    begun = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(50.0, 0.0, 3.0), blocking=False)
    now = flying.telemetry().task
    assert now is not None
    assert begun.task_id == now.id
    states = client.hear(msg.State, f"{UAL}/state", LATCHED)
    waited(lambda: states and states[-1].task_id == begun.task_id)
    for order, status in (("pause_task", True), ("resume_task", False)):
        assert client.call(srv.OrderTask, f"{UAL}/{order}", task_id=begun.task_id).success
        told = client.call(srv.GetTask, f"{UAL}/get_task", task_id=begun.task_id).task
        assert (told.kind, told.status, told.is_paused) == ("GO_TO_WAYPOINT", "RUNNING", status)
    assert client.call(srv.OrderTask, f"{UAL}/cancel_task", task_id=begun.task_id).success
    ended = client.call(srv.GetTask, f"{UAL}/get_task", task_id=begun.task_id).task
    assert (ended.status, ended.reason, metadata(ended)["by"]) == ("ABORTED", "TASK_ABORTED", "abort")
    assert client.call(srv.GetTask, f"{UAL}/get_task", task_id="none").reason == "INVALID_ARGUMENT"


@pytest.mark.usefixtures("flying")
def test_an_action_names_its_task_also_where_it_is_aborted(client: Client) -> None:
    told: list[Any] = []
    goal = client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", told.append, waypoint=pose(50.0, 0.0, 3.0))
    waited(lambda: told)
    second = client.fly(action.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(0.0, 0.0, 3.0))[1]
    first = client.end_of(goal)[1]
    assert first.reason == "TASK_ABORTED"
    assert first.task_id == told[0].task_id == told[-1].task_id != ""
    assert second.task_id not in ("", first.task_id)


# --- The way ----------------------------------------------------------------------------------------------------------


def test_the_path_of_a_task_is_reported_and_then_none(client: Client, flying: ual.Uav) -> None:
    ways = client.hear(Path, f"{UAL}/route", LATCHED)
    waited(lambda: ways and not ways[-1].poses)
    begun = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(50.0, 0.0, 3.0), blocking=False)
    waited(lambda: len(ways[-1].poses) == 2)
    assert ways[-1].header.frame_id == ways[-1].poses[0].header.frame_id == "map"
    assert ways[-1].poses[-1].pose.position.x == pytest.approx(50.0, abs=0.1)
    asked = client.call(srv.GetRoute, f"{UAL}/get_route")
    assert (asked.is_flown, asked.task_id, asked.is_goal_moving) == (True, begun.task_id, False)
    assert [each.pose for each in asked.route.poses] == [each.pose for each in ways[-1].poses]
    flying.abort()
    waited(lambda: not ways[-1].poses)
    assert not client.call(srv.GetRoute, f"{UAL}/get_route").is_flown


# --- A path on Earth --------------------------------------------------------------------------------------------------


def test_a_path_of_positions_on_earth(client: Client, flying: ual.Uav) -> None:
    here = flying.telemetry().position_geo
    assert here is not None
    places = [
        msg.GeoWaypoint(
            waypoint=NavSatFix(latitude=here.latitude_deg + north_deg, longitude=here.longitude_deg, altitude=4.0)
        )
        for north_deg in (2e-5, 0.0)
    ]
    places[-1].has_yaw, places[-1].yaw = True, 1.0
    status, result = client.fly(action.FollowPath, f"{UAL}/follow_path", geo_waypoints=places, dry_run=True)
    assert (status, result.message) == (SUCCEEDED, "")
    assert result.plan.length > 4.0
    assert client.fly(action.FollowPath, f"{UAL}/follow_path", geo_waypoints=places)[0] == SUCCEEDED
    assert flying.pose().pose.yaw_rad == pytest.approx(1.0, abs=0.1)
    both = Path(poses=[pose(0.0, 0.0, 3.0)])
    refused = client.fly(action.FollowPath, f"{UAL}/follow_path", path=both, geo_waypoints=places)[1]
    assert (refused.reason, metadata(refused)) == ("INVALID_ARGUMENT", {"field": "geo_waypoints"})


# --- Frames -----------------------------------------------------------------------------------------------------------


def test_a_frame_is_added_used_and_removed(client: Client, flying: ual.Uav) -> None:
    given = TransformStamped(child_frame_id="mast")
    given.transform.translation.x = 2.0
    assert client.call(srv.AddFrame, f"{UAL}/add_frame", transform=given).success
    listed = {each.frame_id: each for each in client.call(srv.ListFrames, f"{UAL}/list_frames").frames}
    assert (listed["mast"].parent_frame_id, listed["mast"].is_known, listed["mast"].transform.translation.x) == (
        "map",
        True,
        2.0,
    )
    assert listed["map"].parent_frame_id == ""
    gone = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(-1.0, 0.0, 3.0, "mast"), blocking=True)
    assert gone.success, gone.message
    assert flying.transform("map", "uav_1/base_link").translation.x == pytest.approx(1.0, abs=0.3)
    assert client.call(srv.RemoveFrame, f"{UAL}/remove_frame", frame_id="mast").success
    assert client.call(srv.RemoveFrame, f"{UAL}/remove_frame", frame_id="mast").reason == "UNKNOWN_FRAME"
    in_mast = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(-1.0, 0.0, 3.0, "mast"))
    assert in_mast.reason == "UNKNOWN_FRAME", "the node gave the daemon what it had itself told to tf"


# --- Control ----------------------------------------------------------------------------------------------------------


def test_control_is_taken_by_a_service_that_says_all(client: Client, flying: ual.Uav) -> None:
    refused = client.call(srv.TakeControl, f"{UAL}/take_control")
    assert (refused.reason, metadata(refused)["state"]) == ("WRONG_STATE", "FLYING_AUTO")
    flying.simulation.pilot_take_over()
    flying.wait_for(ual.State.FLYING_MANUAL)
    assert client.call(srv.TakeControl, f"{UAL}/take_control", dry_run=True).success
    assert flying.state() is ual.State.FLYING_MANUAL
    assert client.call(srv.TakeControl, f"{UAL}/take_control", force=True).success
    assert flying.state() is ual.State.FLYING_AUTO


# --- Who it is --------------------------------------------------------------------------------------------------------


def test_what_is_reported_to_each_new_listener(client: Client, uav: ual.Uav) -> None:
    infos, fences = client.hear(msg.Info, f"{UAL}/info", LATCHED), client.hear(msg.Geofence, f"{UAL}/geofence", LATCHED)
    leases = client.hear(msg.Lease, f"{UAL}/lease", LATCHED)
    waited(lambda: infos and fences and leases)
    info, fence = uav.info(), uav.geofence()
    assert (infos[-1].ns, infos[-1].backend, infos[-1].is_simulation) == ("uav_1", "light", True)
    assert infos[-1].capabilities == sorted(each.name for each in info.capabilities)
    assert infos[-1].horizontal_speed == info.limits.horizontal_speed_m_s
    assert (fences[-1].header.frame_id, fences[-1].unknown, fences[-1].has_circle) == ("map", "", False)
    assert fences[-1].min_z == (-math.inf if fence.min_z_m is None else fence.min_z_m)
    assert not leases[-1].is_held
    with uav.lease("survey"):
        waited(lambda: leases[-1].is_held)
        assert (leases[-1].holder, leases[-1].identity) == ("survey", "local")
        assert client.call(srv.SetPose, f"{UAL}/set_pose", pose=pose(0.0, 0.0, 3.0)).reason == "LEASE_HELD"
        assert client.call(srv.ListFrames, f"{UAL}/list_frames").success
    waited(lambda: not leases[-1].is_held)
    assert len(infos) == 1, "what does not change is not published again"
