"""One light UAV, flown by a program in ROS: services, actions, topics, frames, and what is refused."""

from __future__ import annotations

import itertools
import json
import math
import time
from collections.abc import Iterator

import pytest
import rclpy
from conftest import ARMED_FAST, Processes, own_processes
from diagnostic_msgs.msg import DiagnosticArray
from flying import ABORTED, CANCELED, LATCHED, SUCCEEDED, Client, current_position, pose, velocity, waited
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState, Imu, NavSatFix
from std_srvs.srv import Empty, Trigger
from tf2_msgs.msg import TFMessage
from ual_msgs import action, srv
from ual_msgs.msg import State

import ual

__all__ = ["own_processes"]  # a fixture

UAL = "/uav_1/ual"


@pytest.fixture(scope="module")
def uav(processes: Processes) -> Iterator[ual.Uav]:
    processes.daemon(*ARMED_FAST)
    processes.node("ns:=uav_1", "rate_hz:=50.0")
    with ual.Uav("uav_1") as uav:
        yield uav


def is_near(uav: ual.Uav, x: float, y: float, z: float) -> bool:
    return (uav.pose().pose.position - ual.Vector3(x, y, z)).norm() < 0.3


# --- Services ---------------------------------------------------------------------------------------------------------


def test_a_flight_by_services(client: Client, armed: ual.Uav) -> None:
    taken_off = client.call(srv.TakeOff, f"{UAL}/take_off", height=3.0, blocking=True)
    assert (taken_off.success, taken_off.reason, taken_off.message) == (True, "", "")
    assert armed.state() is ual.State.FLYING_AUTO
    gone = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(2.0, 1.0, 3.0), blocking=True)
    assert gone.success
    assert is_near(armed, 2.0, 1.0, 3.0)
    landed = client.call(srv.Land, f"{UAL}/land", blocking=True)
    assert landed.success
    assert armed.state() in (ual.State.LANDED_ARMED, ual.State.LANDED_DISARMED)


def test_one_that_does_not_block_answers_when_it_has_begun(client: Client, flying: ual.Uav) -> None:
    far = pose(30.0, 0.0, 3.0)
    assert client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=far, blocking=False).success
    task = flying.telemetry().task
    assert task is not None
    assert task.kind is ual.TaskKind.GO_TO_WAYPOINT
    assert client.call(Trigger, f"{UAL}/pause").success
    waited(lambda: (now := flying.telemetry().task) is not None and now.is_paused)
    assert client.call(Trigger, f"{UAL}/resume").success
    assert client.call(srv.Abort, f"{UAL}/abort", freeze=True).success
    waited(lambda: flying.telemetry().task is None)


def test_a_geographic_waypoint(client: Client, flying: ual.Uav) -> None:
    here = flying.telemetry().position_geo
    assert here is not None
    fix = NavSatFix(latitude=here.latitude_deg, longitude=here.longitude_deg, altitude=5.0)
    assert client.call(srv.GoToWaypointGeo, f"{UAL}/go_to_waypoint_geo", waypoint=fix, blocking=True).success
    assert flying.pose().pose.position.z == pytest.approx(5.0, abs=0.3)
    goal = client.fly(action.GoToWaypointGeo, f"{UAL}/go_to_waypoint_geo", waypoint=fix, has_yaw=True, yaw=1.0)
    assert goal[0] == SUCCEEDED
    assert flying.pose().pose.yaw_rad == pytest.approx(1.0, abs=0.1)


def test_a_refusal_says_reason_words_and_metadata(client: Client, armed: ual.Uav) -> None:
    refused = client.call(srv.Land, f"{UAL}/land", blocking=True)
    with pytest.raises(ual.WrongStateError) as same:
        armed.land()
    assert not refused.success
    assert (refused.reason, refused.message) == ("WRONG_STATE", same.value.message)
    assert {each.key: each.value for each in refused.metadata} == same.value.metadata
    below = client.call(srv.TakeOff, f"{UAL}/take_off", height=-1.0)
    assert [(each.key, each.value) for each in below.metadata] == [("field", "height")]
    assert below.message.startswith("height: ")
    words, metadata = client.call(Trigger, f"{UAL}/pause").message.split("\n")
    with pytest.raises(ual.WrongStateError) as same:
        armed.pause()
    assert (words, json.loads(metadata)) == (f"WRONG_STATE: {same.value.message}", same.value.metadata)
    assert client.call(Trigger, f"{UAL}/recover").message.startswith("WRONG_STATE: recover_from_manual needs")
    client.call(Empty, f"{UAL}/recover_from_manual")  # its answer has no field for a refusal


@pytest.mark.parametrize(("kind", "name"), [(Empty, "recover_from_manual"), (Trigger, "recover")])
def test_control_is_taken_back_from_the_safety_pilot(client: Client, flying: ual.Uav, kind: type, name: str) -> None:
    states = client.hear(State, f"{UAL}/state", LATCHED)
    flying.simulation.pilot_take_over()
    waited(lambda: states and states[-1].state == State.FLYING_MANUAL)
    client.call(kind, f"{UAL}/{name}")
    waited(lambda: states[-1].state == State.FLYING_AUTO)


def test_home_is_set(client: Client, armed: ual.Uav) -> None:
    assert client.call(srv.SetHome, f"{UAL}/set_home", set_z=True).success
    waited(lambda: is_near(armed, 0.0, 0.0, 0.0))


@pytest.mark.usefixtures("flying")
def test_many_wait_at_once_and_the_executor_answers_meanwhile(client: Client) -> None:
    goals = [
        client.call_soon(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(x, 0.0, 3.0), blocking=True)
        for x in (20.0, 21.0, 22.0)
    ]
    waited(lambda: sum(goal.done() for goal in goals) == 2)
    assert client.call(Trigger, f"{UAL}/pause").success
    assert client.call(Trigger, f"{UAL}/resume").success
    assert client.call(srv.Abort, f"{UAL}/abort").success
    waited(lambda: all(goal.done() for goal in goals))
    assert {goal.result().reason for goal in goals} == {"TASK_ABORTED"}


# --- Actions ----------------------------------------------------------------------------------------------------------


def test_a_flight_by_actions(client: Client, armed: ual.Uav) -> None:
    told: list[action.TakeOff.Feedback] = []
    goal = client.begin(action.TakeOff, f"{UAL}/take_off", told.append, height=3.0)
    waited(lambda: told)
    assert not client.cancel(goal), "only the safety pilot ends a take-off"
    status, result = client.end_of(goal)
    assert (status, result.success) == (SUCCEEDED, True)
    assert told[-1].distance_left < 0.5
    assert State.TAKING_OFF in {each.state for each in told}
    corners = Path(poses=[pose(2.0, 0.0, 3.0), pose(2.0, 2.0, 3.0)])
    flown: list[action.FollowPath.Feedback] = []
    path = client.begin(action.FollowPath, f"{UAL}/follow_path", flown.append, path=corners, max_speed=1.0)
    assert client.end_of(path)[0] == SUCCEEDED
    assert is_near(armed, 2.0, 2.0, 3.0)
    assert {each.waypoint_index for each in flown} >= {0, 1}
    assert client.fly(action.ReturnToLaunch, f"{UAL}/return_to_launch", height=4.0)[0] == SUCCEEDED


def test_a_cancelled_goal_leaves_the_uav_holding(client: Client, flying: ual.Uav) -> None:
    told: list[action.GoToWaypoint.Feedback] = []
    goal = client.begin(
        action.GoToWaypoint, f"{UAL}/go_to_waypoint", told.append, waypoint=pose(50.0, 0.0, 3.0), max_speed=1.0
    )
    waited(lambda: told and told[-1].distance_left < 49.5)
    assert client.cancel(goal)
    status, result = client.end_of(goal)
    assert (status, result.reason) == (CANCELED, "TASK_ABORTED")
    assert flying.state() is ual.State.FLYING_AUTO
    assert flying.telemetry().task is None


def test_a_path_holds_at_a_pose_and_keeps_the_speed_of_a_leg(client: Client, flying: ual.Uav) -> None:
    corner = ual.Vector3(2.0, 0.0, 3.0)
    flying.go_to_waypoint(ual.Pose.at(0.0, 0.0, 3.0))
    samples: list[ual.Telemetry] = []
    there = Path(poses=[pose(2.0, 0.0, 3.0), pose(0.0, 0.0, 3.0)])
    with flying.subscribe(samples.append):
        flown = client.fly(action.FollowPath, f"{UAL}/follow_path", path=there, leg_speeds=[0.5, 0.0], holds=[3.0, 0.0])
    assert flown[0] == SUCCEEDED
    odometries = [sample.odometry for sample in samples if sample.odometry is not None]
    near_s = [each.stamp_s for each in odometries if (each.pose.position - corner).norm() < 0.3]
    assert near_s[-1] - near_s[0] > 2.5
    assert max(each.twist.linear.norm() for each in odometries if each.stamp_s < near_s[0]) < 0.6


def test_a_goal_that_is_cancelled_at_once_ends(client: Client, flying: ual.Uav) -> None:
    for _ in range(20):
        goal = client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", lambda _: None, waypoint=pose(50.0, 0.0, 3.0))
        assert client.cancel(goal)
        assert client.end_of(goal)[0] == CANCELED
    waited(lambda: flying.telemetry().task is None)


@pytest.mark.usefixtures("flying")
def test_a_refused_goal_is_aborted_with_words(client: Client) -> None:
    status, result = client.fly(
        action.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(1.0, 0.0, 3.0, frame_id="nowhere")
    )
    assert (status, result.success, result.reason) == (ABORTED, False, "UNKNOWN_FRAME")
    assert "there is no frame nowhere" in result.message


@pytest.mark.usefixtures("flying")
def test_a_newer_goal_replaces_the_older(client: Client) -> None:
    told: list[object] = []
    first = client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", told.append, waypoint=pose(40.0, 0.0, 3.0))
    waited(lambda: told)
    assert client.fly(action.Land, f"{UAL}/land")[0] == SUCCEEDED
    status, result = client.end_of(first)
    assert (status, result.reason) == (ABORTED, "TASK_ABORTED")


# --- Setpoints --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("topic", ["set_velocity", "cmd_vel"])
def test_velocities_fly_and_their_end_stops_the_uav(client: Client, flying: ual.Uav, topic: str) -> None:
    kind, message = (Twist, velocity(1.0).twist) if topic == "cmd_vel" else (TwistStamped, velocity(1.0, "map"))
    begin = flying.pose().pose.position
    deadline_s = time.monotonic() + 90.0
    while (flying.pose().pose.position - begin).norm() < 1.0:
        client.publish(kind, f"{UAL}/{topic}", message)
        time.sleep(0.02)
        assert time.monotonic() < deadline_s
    waited(lambda: flying.velocity().twist.linear.norm() < 0.02)
    held = flying.pose().pose.position
    assert flying.state() is ual.State.FLYING_AUTO
    assert (flying.pose().pose.position - held).norm() < 0.1


def test_a_reference_pose_is_followed_and_reported(client: Client, flying: ual.Uav) -> None:
    references = client.hear(PoseStamped, f"{UAL}/ref_pose")
    goals = client.repeat(0.1, PoseStamped, f"{UAL}/set_pose", lambda: pose(1.0, 1.0, 4.0, "uav_1/odom"))
    waited(lambda: is_near(flying, 1.0, 1.0, 4.0))
    client.node.destroy_timer(goals)
    waited(lambda: references and references[-1].pose.position.x == pytest.approx(1.0))


def test_a_refused_setpoint_is_reported_in_the_diagnostics(client: Client, flying: ual.Uav) -> None:
    told = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    wrong = client.repeat(0.1, TwistStamped, f"{UAL}/set_velocity", lambda: velocity(math.nan))
    bad = waited(lambda: [each for each in told if "refused" in each.status[0].message])[0].status[0]
    client.node.destroy_timer(wrong)
    assert bad.level == b"\x01"
    assert "INVALID_ARGUMENT" in bad.message
    assert flying.velocity().twist.linear.norm() < 0.05


@pytest.mark.parametrize("topic", ["external_pose", "external_pose_cov"])
@pytest.mark.usefixtures("uav")
def test_a_pose_from_outside_reaches_the_daemon(client: Client, topic: str) -> None:
    told = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    stamped = PoseWithCovarianceStamped() if topic == "external_pose_cov" else PoseStamped()
    measured = stamped.pose if topic == "external_pose" else stamped.pose.pose
    measured.orientation.w = 1.0
    stamped.header.frame_id = "map"
    stamped.header.stamp.sec = 1_000_000_000  # long ago
    poses = client.repeat(0.1, type(stamped), f"{UAL}/{topic}", lambda: stamped)
    waited(lambda: [each for each in told if "it is old" in each.status[0].message])
    client.node.destroy_timer(poses)


@pytest.mark.usefixtures("uav")
def test_a_covariance_that_is_none_is_refused(client: Client) -> None:
    told = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    measured = PoseWithCovarianceStamped()
    measured.pose.covariance[0] = -1.0
    poses = client.repeat(0.1, PoseWithCovarianceStamped, f"{UAL}/external_pose_cov", lambda: measured)
    waited(lambda: [each for each in told if "position_std_dev_m" in each.status[0].message])
    client.node.destroy_timer(poses)


# --- What is told -----------------------------------------------------------------------------------------------------


def test_what_the_topics_tell(client: Client, flying: ual.Uav) -> None:
    poses, velocities = client.hear(PoseStamped, f"{UAL}/pose"), client.hear(TwistStamped, f"{UAL}/velocity")
    odoms, fixes = client.hear(Odometry, f"{UAL}/odom"), client.hear(NavSatFix, f"{UAL}/fix")
    batteries, states = client.hear(BatteryState, f"{UAL}/battery"), client.hear(State, f"{UAL}/state", LATCHED)
    healths, moving = client.hear(DiagnosticArray, f"{UAL}/health", 10), client.hear(TFMessage, "/tf", 100)
    static = client.hear(TFMessage, "/tf_static", LATCHED)
    waited(lambda: all((poses, velocities, odoms, fixes, batteries, states, healths, moving, static)))
    sample = flying.telemetry()
    assert poses[-1].header.frame_id == "uav_1/odom"
    assert poses[-1].pose.position.z == pytest.approx(3.0, abs=0.3)
    assert poses[-1].header.stamp.sec == pytest.approx(sample.stamp_s, abs=10.0)
    assert velocities[-1].header.frame_id == "uav_1/odom"
    assert (odoms[-1].header.frame_id, odoms[-1].child_frame_id) == ("uav_1/odom", "uav_1/base_link")
    body = [link for told in moving for link in told.transforms if link.child_frame_id == "uav_1/base_link"][-1]
    assert body.header.frame_id == "uav_1/odom"
    assert body.transform.translation.z == pytest.approx(3.0, abs=0.3)
    assert [(each.header.frame_id, each.child_frame_id) for each in static[-1].transforms] == [("map", "uav_1/odom")]
    assert states[-1].state == State.FLYING_AUTO
    assert states[-1].armed
    assert sample.position_geo is not None
    assert fixes[-1].latitude == pytest.approx(sample.position_geo.latitude_deg, abs=1e-4)
    assert 0.0 < batteries[-1].percentage <= 1.0
    assert healths[-1].status[0].hardware_id == "uav_1"


@pytest.mark.usefixtures("flying")
def test_the_state_reaches_a_subscriber_with_the_defaults_of_ros(client: Client) -> None:
    states = client.hear(State, f"{UAL}/state", 10)
    waited(lambda: states)
    assert states[-1].state == State.FLYING_AUTO


EXPECTED_QOS = {
    "pose": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    "velocity": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    "odom": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    "ref_pose": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    "battery": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    "batteries": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    "fix": (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
    "state": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),
    "health": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
    "/tf": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
    "/tf_static": (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),
}


@pytest.mark.parametrize("name", EXPECTED_QOS)
@pytest.mark.usefixtures("uav")
def test_the_qos_of_a_topic(client: Client, name: str) -> None:
    topic = name if name.startswith("/") else f"{UAL}/{name}"
    of_topic = client.node.get_publishers_info_by_topic
    [found] = waited(lambda: [each for each in of_topic(topic) if each.node_name == "ual"])
    assert (found.qos_profile.reliability, found.qos_profile.durability) == EXPECTED_QOS[name]


@pytest.mark.parametrize("name", ["set_pose", "set_velocity", "cmd_vel", "external_pose", "external_pose_cov"])
@pytest.mark.usefixtures("uav")
def test_what_comes_in_is_received_from_any_publisher(client: Client, name: str) -> None:
    of_topic = client.node.get_subscriptions_info_by_topic
    [found] = waited(lambda: [each for each in of_topic(f"{UAL}/{name}") if each.node_name == "ual"])
    assert found.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert found.qos_profile.durability == DurabilityPolicy.VOLATILE


# --- Frames -----------------------------------------------------------------------------------------------------------


def test_a_goal_in_a_frame_that_only_tf_knows(client: Client, flying: ual.Uav) -> None:
    static = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = client.node.create_publisher(TFMessage, "/tf_static", static)
    publisher.publish(current_position(5.0, "map", "tower"))
    client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(0.0, 0.0, 3.0, "nowhere"))  # tf is heard now
    waited(publisher.get_subscription_count)
    gone = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(-1.0, 0.0, 3.0, "tower"), blocking=True)
    assert gone.success, gone.message
    there = flying.transform("map", "uav_1/base_link").translation
    assert there.x == pytest.approx(4.0, abs=0.3)


def test_a_goal_in_a_frame_of_tf_that_moves_is_followed(client: Client, flying: ual.Uav) -> None:
    xs = (min(2.0, 0.005 * i) for i in itertools.count())
    places = client.repeat(0.02, TFMessage, "/tf", lambda: current_position(next(xs), "map", "deck"))
    goals = client.repeat(0.1, PoseStamped, f"{UAL}/set_pose", lambda: pose(0.0, 2.0, 4.0, "deck"))
    waited(lambda: flying.transform("map", "uav_1/base_link").translation.z > 3.2)
    assert client.node.destroy_timer(goals), "a goal that was given once is followed, too"
    there = ual.Vector3(2.0, 2.0, 4.0)
    waited(lambda: (flying.transform("map", "uav_1/base_link").translation - there).norm() < 0.1)
    client.node.destroy_timer(places)


def test_a_goal_in_a_frame_that_tf_refreshes_no_more_is_refused(client: Client, flying: ual.Uav) -> None:
    def requests_made() -> tuple[bool, str]:
        answer = client.call(srv.SetPose, f"{UAL}/set_pose", pose=pose(0.0, 0.0, 3.0, "buoy"), dry_run=True)
        return answer.success, answer.reason

    places = client.repeat(0.02, TFMessage, "/tf", lambda: current_position(1.0, "map", "buoy"))
    waited(lambda: requests_made() == (True, ""))
    client.node.destroy_timer(places)
    waited(lambda: requests_made() == (False, "FRAME_LOST"))
    begin = flying.pose().pose.position
    gone = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(5.0, 0.0, 3.0, "buoy"))
    assert (gone.success, gone.reason) == (False, "FRAME_LOST")
    assert "buoy was not on /tf for 1 s" in gone.message
    told = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    goals = client.repeat(0.1, PoseStamped, f"{UAL}/set_pose", lambda: pose(5.0, 0.0, 3.0, "buoy"))
    waited(lambda: [each for each in told if "FRAME_LOST" in each.status[0].message])
    client.node.destroy_timer(goals)
    assert (flying.pose().pose.position - begin).norm() < 0.1
    places = client.repeat(0.02, TFMessage, "/tf", lambda: current_position(1.0, "map", "buoy"))
    waited(lambda: requests_made() == (True, ""))
    client.node.destroy_timer(places)


# --- What readers of other packages need ------------------------------------------------------------------------------


def test_the_attitude_is_reported_as_of_an_imu_and_what_is_not_known_as_that(client: Client, flying: ual.Uav) -> None:
    """robot_localization takes zeros of an Odometry for certainty, and -1 of an Imu for "not there"."""
    imus, odometries = client.hear(Imu, f"{UAL}/imu"), client.hear(Odometry, f"{UAL}/odom")
    told, odometry = waited(lambda: imus and imus[-1]), waited(lambda: odometries and odometries[-1])
    orientation = flying.pose().pose.orientation
    found = (told.orientation.x, told.orientation.y, told.orientation.z, told.orientation.w)
    assert found == pytest.approx((orientation.x, orientation.y, orientation.z, orientation.w), abs=0.02)
    assert told.header.frame_id == "uav_1/base_link"
    assert list(told.orientation_covariance) == list(told.angular_velocity_covariance) == [0.0] * 9
    assert told.linear_acceleration_covariance[0] == -1.0
    for covariance in (odometry.pose.covariance, odometry.twist.covariance):
        assert [covariance[7 * axis] for axis in range(6)] == [-1.0] * 6


def test_two_publishers_of_velocities_are_reported_by_name(client: Client, flying: ual.Uav) -> None:
    del flying
    told = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    other = rclpy.create_node("joystick", context=client.node.context)
    try:
        client.publish(TwistStamped, f"{UAL}/set_velocity", velocity(0.0, "map"))
        publisher = other.create_publisher(Twist, f"{UAL}/cmd_vel", 1)
        bad = waited(lambda: [each for each in told if "nodes publish velocities" in each.status[0].message])
        assert bad[0].status[0].level == b"\x01"
        assert "/joystick" in bad[0].status[0].message
        other.destroy_publisher(publisher)
        seen = len(told)
        waited(lambda: [each for each in told[seen:] if "nodes publish velocities" not in each.status[0].message])
    finally:
        other.destroy_node()


def test_stamped_velocities_are_chosen_by_a_parameter(own_processes: Processes, client: Client) -> None:
    own_processes.daemon(*ARMED_FAST, ns="uav_8")
    own_processes.node("ns:=uav_8", "enable_stamped_cmd_vel:=true")
    with ual.Uav("uav_8") as uav:
        uav.wait_for(ual.State.LANDED_ARMED, timeout_s=60.0)
        uav.take_off(3.0)
        begin = uav.pose().pose.position
        deadline_s = time.monotonic() + 90.0
        while (uav.pose().pose.position - begin).norm() < 1.0:
            client.publish(TwistStamped, "/uav_8/ual/cmd_vel", velocity(1.0))  # no frame: along the body's axes
            time.sleep(0.02)
            assert time.monotonic() < deadline_s
