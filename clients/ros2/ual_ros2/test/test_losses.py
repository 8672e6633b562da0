"""Losses, ends and jumps: the node, a daemon, the lease, the lifecycle's states, ROS' clock."""

from __future__ import annotations

import signal
from collections.abc import Iterator

import pytest
from conftest import ARMED_FAST, Processes, own_client, own_processes
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from flying import ABORTED, LATCHED, Client, current_position, pose, velocity, waited
from geometry_msgs.msg import PoseStamped, TwistStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.qos import ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from ual_msgs import action, srv
from ual_msgs.msg import State

import ual

UAL = "/uav_1/ual"
client, processes = own_client, own_processes
BRAKES_AT_M_S2 = 2.0
"""A light UAV's horizontal acceleration."""


@pytest.fixture
def uav(processes: Processes) -> Iterator[ual.Uav]:
    """A light UAV in real time."""
    processes.daemon("--auto-arm")
    with ual.Uav("uav_1") as uav:
        yield uav


def is_reported(client: Client, state: int, text: str = "", ns: str = "uav_1") -> None:
    """Waits until the node tells a state, for a reason with a text in it."""
    states = client.hear(State, f"/{ns}/ual/state", LATCHED)
    waited(lambda: states and states[-1].state == state and text in states[-1].reason)


def take_off(client: Client, ns: str = "uav_1") -> None:
    taken_off = client.call(srv.TakeOff, f"/{ns}/ual/take_off", height=3.0, blocking=True)
    assert taken_off.success, taken_off.message


def test_a_node_that_is_killed_while_a_velocity_streams(client: Client, processes: Processes, flying: ual.Uav) -> None:
    node = processes.node("ns:=uav_1")
    stream = client.repeat(0.02, TwistStamped, f"{UAL}/set_velocity", lambda: velocity(1.0))
    waited(lambda: flying.velocity().twist.linear.x > 0.98)
    begin = flying.pose().pose.position
    node.kill()
    waited(lambda: flying.velocity().twist.linear.norm() < 0.02)
    client.node.destroy_timer(stream)
    travelled_m = (flying.pose().pose.position - begin).norm()
    late_m = 0.5  # the position before the kill was read up to this much before it, on a busy machine
    assert travelled_m < 1.0 * 0.5 + 1.0**2 / (2.0 * BRAKES_AT_M_S2) + late_m
    assert flying.state() is ual.State.FLYING_AUTO
    processes.node("ns:=uav_1")
    is_reported(client, State.FLYING_AUTO)
    assert client.call(srv.Land, f"{UAL}/land", blocking=True).success


def test_a_node_that_is_killed_leaves_no_goal_flying(client: Client, processes: Processes, flying: ual.Uav) -> None:
    node = processes.node("ns:=uav_1")
    client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", lambda _: None, waypoint=pose(90.0, 0.0, 3.0))
    waited(lambda: flying.telemetry().task)
    node.kill()
    waited(lambda: flying.telemetry().task is None)
    waited(lambda: flying.velocity().twist.linear.norm() < 0.02)
    assert flying.state() is ual.State.FLYING_AUTO


def test_a_node_that_ends_says_so_to_who_waits(client: Client, processes: Processes, flying: ual.Uav) -> None:
    node = processes.node("ns:=uav_1")
    goal = client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", lambda _: None, waypoint=pose(90.0, 0.0, 3.0))
    ended = client.end_soon(goal)
    waited(lambda: flying.telemetry().task)
    node.terminate()
    waited(ended.done)
    assert (ended.result().status, ended.result().result.reason) == (ABORTED, "TASK_ABORTED")
    assert ended.result().result.message == "cancelled: the node has ended"
    assert node.wait(60.0) == 0
    waited(lambda: flying.telemetry().task is None)


def test_a_daemon_that_dies_is_reported_and_found_again(client: Client, processes: Processes) -> None:
    daemon = processes.daemon(*ARMED_FAST)
    processes.node("ns:=uav_1")
    is_reported(client, State.LANDED_ARMED)
    healths = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    daemon.kill()
    daemon.wait()
    is_reported(client, State.UNINITIALIZED, "DAEMON_UNREACHABLE: ")
    waited(lambda: healths and healths[-1].status[0].level == b"\x02")
    refused = client.call(srv.TakeOff, f"{UAL}/take_off", height=3.0, blocking=True)
    assert refused.reason == "DAEMON_UNREACHABLE"
    processes.daemon(*ARMED_FAST)
    is_reported(client, State.LANDED_ARMED)
    take_off(client)


def test_a_daemon_that_was_started_anew_gets_the_frames_of_tf_again(client: Client, processes: Processes) -> None:
    daemon = processes.daemon(*ARMED_FAST)
    processes.node("ns:=uav_1")
    publisher = client.node.create_publisher(TFMessage, "/tf_static", LATCHED)
    publisher.publish(current_position(5.0, "map", "tower"))
    for _ in range(2):
        is_reported(client, State.LANDED_ARMED)
        take_off(client)
        waypoint = pose(-1.0, 0.0, 3.0, "tower")
        gone = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=waypoint, blocking=True)
        assert gone.success, gone.message
        daemon.kill()
        daemon.wait()
        is_reported(client, State.UNINITIALIZED, "DAEMON_UNREACHABLE: ")
        daemon = processes.daemon(*ARMED_FAST)


def test_a_daemon_that_hangs_delays_no_other_uav(client: Client, processes: Processes) -> None:
    hanging = processes.daemon(*ARMED_FAST, ns="uav_1")
    processes.daemon(*ARMED_FAST, ns="uav_2")
    processes.node("ns:=[uav_1, uav_2]")
    is_reported(client, State.LANDED_ARMED)
    hanging.send_signal(signal.SIGSTOP)
    is_reported(client, State.UNINITIALIZED, "tells nothing")
    waits = client.call_soon(srv.TakeOff, f"{UAL}/take_off", height=3.0, blocking=True)
    is_reported(client, State.LANDED_ARMED, ns="uav_2")
    take_off(client, "uav_2")
    assert not waits.done()
    hanging.send_signal(signal.SIGCONT)
    waited(waits.done)
    ended = waits.result()
    assert ended.success or ended.reason == "TIMEOUT"  # what a daemon may have kept for over 2.5 s moves nothing
    is_reported(client, State.FLYING_AUTO if ended.success else State.LANDED_ARMED)


def test_two_nodes_of_one_uav_are_reported(client: Client, processes: Processes, armed: ual.Uav) -> None:
    processes.node("ns:=uav_1")
    is_reported(client, State.LANDED_ARMED)
    healths = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    states = client.hear(State, f"{UAL}/state", LATCHED)
    other = processes.node("ns:=uav_1")
    waited(lambda: healths and "1 more node(s) offer this UAV" in healths[-1].status[0].message)
    other.terminate()
    other.wait(60.0)
    waited(lambda: "more node" not in healths[-1].status[0].message)
    waited(lambda: states[-1].state == State.LANDED_ARMED)
    assert armed.state() is ual.State.LANDED_ARMED


def test_uavs_whose_daemons_start_later_are_found(client: Client, processes: Processes) -> None:
    processes.node()
    processes.daemon(*ARMED_FAST, ns="uav_1")
    take_off(client)
    processes.daemon(*ARMED_FAST, ns="uav_2")
    take_off(client, "uav_2")


def test_by_its_lease_the_node_is_the_only_one_that_flies(client: Client, processes: Processes, armed: ual.Uav) -> None:
    healths = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    node = processes.node("ns:=uav_1", "lease:=true", "lease_holder:=survey")
    waited(lambda: healths and KeyValue(key="lease", value="held") in healths[-1].status[0].values)
    with pytest.raises(ual.LeaseHeldError) as held:
        armed.take_off(3.0)
    assert held.value.metadata["holder"] == "survey"
    take_off(client)
    node.terminate()
    node.wait(60.0)
    assert armed.lease_info() is None
    armed.land()


def test_only_an_active_node_flies_and_tells(client: Client, processes: Processes, flying: ual.Uav) -> None:
    processes.node("ns:=uav_1")
    goal = client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", lambda _: None, waypoint=pose(90.0, 0.0, 3.0))
    waited(lambda: flying.telemetry().task)
    change(client, Transition.TRANSITION_DEACTIVATE)
    assert client.end_of(goal)[1].message == "cancelled: the node is not active"
    waited(lambda: flying.telemetry().task is None)
    is_reported(client, State.UNINITIALIZED, "the node is not active")
    assert "the node is not active" in client.call(Trigger, f"{UAL}/arm").message
    change(client, Transition.TRANSITION_CLEANUP)
    waited(lambda: not client.node.get_publishers_info_by_topic(f"{UAL}/pose"))
    change(client, Transition.TRANSITION_CONFIGURE)
    change(client, Transition.TRANSITION_ACTIVATE)
    is_reported(client, State.FLYING_AUTO)
    assert client.call(srv.Land, f"{UAL}/land", blocking=True).success


def change(client: Client, transition: int) -> None:
    """Lets the node change its state of the lifecycle."""
    wanted = Transition(id=transition)
    assert client.call(ChangeState, "/ual/change_state", transition=wanted).success


def test_parameters_that_are_wrong_leave_the_node_unconfigured(client: Client, processes: Processes) -> None:
    processes.node("ns:=[uav_1, uav_1]")
    waited(lambda: "ns: uav_1, uav_1 names a UAV twice" in processes.status_text())
    wanted = Transition(id=Transition.TRANSITION_CONFIGURE)
    assert not client.call_again(ChangeState, "/ual/change_state", transition=wanted).success


class JumpingClock:
    """ROS' simulated time."""

    def __init__(self, client: Client) -> None:
        self.now_s = 1000
        client.repeat(0.02, Clock, "/clock", self._tick)

    def _tick(self) -> Clock:
        message = Clock()
        message.clock.sec = self.now_s
        return message

    def is_stamped(self, poses: list[PoseStamped]) -> bool:
        """Returns whether the newest pose has this time."""
        return bool(poses) and abs(poses[-1].header.stamp.sec - self.now_s) < 3


def test_a_clock_that_jumps_moves_nothing(client: Client, processes: Processes, flying: ual.Uav) -> None:
    clock = JumpingClock(client)
    processes.node("ns:=uav_1", "use_sim_time:=true")
    poses = client.hear(PoseStamped, f"{UAL}/pose")
    begin = flying.pose().pose.position
    for clock.now_s in (1000, 5, 9000):
        waited(lambda: clock.is_stamped(poses))
    assert flying.telemetry().task is None
    assert (flying.pose().pose.position - begin).norm() < 0.1
    gone = client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(1.0, 0.0, 3.0), blocking=True)
    assert gone.success, "a clock that stands delays no command"


def test_a_parameter_changes_the_qos_of_a_topic(client: Client, processes: Processes) -> None:
    processes.daemon(*ARMED_FAST)
    processes.node("ns:=uav_1", "qos_overrides./uav_1/ual/pose.publisher.reliability:=reliable")
    of_topic = client.node.get_publishers_info_by_topic
    [found] = waited(lambda: of_topic(f"{UAL}/pose"))
    assert found.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    [other] = waited(lambda: of_topic(f"{UAL}/velocity"))
    assert other.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
