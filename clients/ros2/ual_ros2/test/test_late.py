"""What comes late: sent to a node that stood still, kept by its publisher, or stamped for another time."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import Processes, in_ros, registry, reserve_domain
from diagnostic_msgs.msg import DiagnosticArray
from flying import ABORTED, LATCHED, Client, pose, velocity, waited
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.action import ActionClient
from ual_msgs import action, srv

import ual

UAL = "/uav_1/ual"
LATE_S = 3.1
"""The node refuses commands that are older than 3 s."""


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    with registry(tmp_path) as processes:
        yield processes


@pytest.fixture
def client() -> Iterator[Client]:
    reserve_domain()
    with in_ros() as client:
        yield client


@pytest.fixture
def uav(processes: Processes) -> Iterator[ual.Uav]:
    """A light UAV in real time."""
    processes.daemon("--auto-arm")
    with ual.Uav("uav_1") as uav:
        yield uav


@pytest.fixture
def refused(client: Client) -> Callable[[str], object]:
    """Waits until the diagnostics say that a setpoint is refused, with a text in it."""
    told = client.hear(DiagnosticArray, f"{UAL}/health", 10)
    return lambda text: waited(lambda: [each for each in told if text in each.status[0].message])


def is_still(uav: ual.Uav, begin: ual.Vector3) -> bool:
    return uav.telemetry().task is None and (uav.pose().pose.position - begin).norm() < 0.1


def test_what_was_sent_to_a_node_that_stood_still_is_not_flown(
    client: Client, processes: Processes, flying: ual.Uav
) -> None:
    node = processes.node("ns:=uav_1")
    goals = ActionClient(client.node, action.GoToWaypoint, f"{UAL}/go_to_waypoint")
    assert goals.wait_for_server(90.0)
    assert client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(0.0, 0.0, 3.0), blocking=True).success
    begin = flying.pose().pose.position
    node.send_signal(signal.SIGSTOP)
    answer = client.call_soon(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(50.0, 0.0, 3.0))
    sent: Any = goals.send_goal_async(action.GoToWaypoint.Goal(waypoint=pose(0.0, 50.0, 3.0)))
    time.sleep(LATE_S)  # the time that passes is what is tested
    node.send_signal(signal.SIGCONT)
    waited(answer.done)
    assert (answer.result().success, answer.result().reason) == (False, "TIMEOUT")
    assert "it was sent" in answer.result().message
    waited(sent.done)
    status, result = client.end_of(sent.result())
    assert (status, result.reason) == (ABORTED, "TIMEOUT")
    assert "the node stood still" in result.message
    assert is_still(flying, begin)


def test_what_ends_a_flight_is_obeyed_late(client: Client, processes: Processes, flying: ual.Uav) -> None:
    node = processes.node("ns:=uav_1")
    client.call(srv.Abort, f"{UAL}/abort")
    assert client.call(srv.GoToWaypoint, f"{UAL}/go_to_waypoint", waypoint=pose(90.0, 0.0, 3.0)).success
    node.send_signal(signal.SIGSTOP)
    answer = client.call_soon(srv.Abort, f"{UAL}/abort")
    time.sleep(LATE_S)
    node.send_signal(signal.SIGCONT)
    waited(answer.done)
    assert answer.result().success
    waited(lambda: flying.telemetry().task is None)


def test_a_pose_that_its_publisher_kept_is_not_flown(
    client: Client, processes: Processes, flying: ual.Uav, refused: Callable[[str], object]
) -> None:
    client.node.create_publisher(PoseStamped, f"{UAL}/set_pose", LATCHED).publish(pose(9.0, 0.0, 3.0))
    begin = flying.pose().pose.position
    time.sleep(0.6)  # longer than a setpoint may be old
    of_topic = "qos_overrides./uav_1/ual/set_pose.subscription"
    processes.node("ns:=uav_1", f"{of_topic}.durability:=transient_local", f"{of_topic}.reliability:=reliable")
    refused("TIMEOUT: it was sent")
    assert is_still(flying, begin)


@pytest.mark.parametrize("age_s", [86_400.0, -86_400.0])
def test_a_setpoint_that_is_stamped_for_another_time_is_not_flown(
    client: Client, processes: Processes, flying: ual.Uav, refused: Callable[[str], object], age_s: float
) -> None:
    processes.node("ns:=uav_1")
    begin = flying.pose().pose.position
    wrong = velocity(1.0)
    wrong.header.stamp.sec = math.floor(time.time() - age_s)
    stream = client.repeat(0.05, TwistStamped, f"{UAL}/set_velocity", lambda: wrong)
    refused("TIMEOUT: it is stamped")
    assert is_still(flying, begin)
    client.node.destroy_timer(stream)


def test_a_setpoint_of_the_present_is_flown(client: Client, processes: Processes, flying: ual.Uav) -> None:
    processes.node("ns:=uav_1")

    def stamped() -> TwistStamped:
        message = velocity(1.0)
        message.header.stamp = client.node.get_clock().now().to_msg()
        return message

    stream = client.repeat(0.02, TwistStamped, f"{UAL}/set_velocity", stamped)
    waited(lambda: flying.velocity().twist.linear.x > 0.9)
    client.node.destroy_timer(stream)
