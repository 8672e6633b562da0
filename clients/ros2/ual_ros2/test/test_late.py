"""Late messages: sent to a node that stood still, kept by its publisher, or stamped for another time.

The node's clocks are those of `late_node`: no test waits for time to pass.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest
from conftest import ARMED_FAST, Processes, end, own_client
from diagnostic_msgs.msg import DiagnosticArray
from flying import ABORTED, LATCHED, SUCCEEDED, Client, pose, velocity, waited
from geometry_msgs.msg import PoseStamped, TwistStamped
from ual_msgs import action, srv

import ual
from ual_ros2.command import RosCommand
from ual_ros2.contact import DaemonContact
from ual_ros2.interface import UavInterface
from ual_ros2.lateness import LatenessCheck
from ual_ros2.outcome import CommandOutcome

UAL = "/uav_1/ual"
LATE_S = 3.1
"""The node refuses commands that are older than 3 s."""
client = own_client
PROGRAM = Path(__file__).with_name("late_node.py")
GO_TO = f"{UAL}/go_to_waypoint"


class LateNode:
    """A node, and by how much it believes that all is late."""

    def __init__(self, processes: Processes, file: Path) -> None:
        self._processes = processes
        self._file = file
        self.be_late(0.0)

    def start(self, *parameters: str) -> None:
        """Starts it."""
        self._running = self._processes.node("ns:=uav_1", *parameters, program=(str(PROGRAM), str(self._file)))

    def end(self) -> None:
        """Ends it: the next test has another one."""
        end(self._running)

    def be_late(self, late_s: float) -> None:
        """From now on, all that comes is late by so much."""
        written = self._file.with_suffix(".new")
        written.write_text(f"{late_s}", encoding="utf-8")
        written.replace(self._file)


@pytest.fixture(scope="module")
def uav(processes: Processes) -> Iterator[ual.Uav]:
    processes.daemon(*ARMED_FAST)
    with ual.Uav("uav_1") as uav:
        yield uav


@pytest.fixture
def node(processes: Processes, tmp_path: Path) -> Iterator[LateNode]:
    node = LateNode(processes, tmp_path / "late_s")
    yield node
    node.end()


@pytest.fixture
def reported(client: Client) -> list[DiagnosticArray]:
    """Diagnostics so far."""
    return client.hear(DiagnosticArray, f"{UAL}/health", 10)


def is_refused(reported: list[DiagnosticArray], text: str) -> None:
    """Waits until the diagnostics say that a setpoint is refused, with a text in it."""
    waited(lambda: [each for each in reported if text in each.status[0].message])


def is_still(uav: ual.Uav, begin: ual.Vector3) -> bool:
    return uav.telemetry().task is None and (uav.pose().pose.position - begin).norm() < 0.1


def test_what_was_sent_to_a_node_that_stood_still_is_not_executed(
    client: Client, node: LateNode, flying: ual.Uav
) -> None:
    node.start()
    here = pose(0.0, 0.0, 3.0)
    assert client.call(srv.GoToWaypoint, GO_TO, waypoint=here, blocking=True).success
    begin = flying.pose().pose.position
    node.be_late(LATE_S)
    answer = client.call(srv.GoToWaypoint, GO_TO, waypoint=pose(50.0, 0.0, 3.0))
    assert (answer.success, answer.reason) == (False, "TIMEOUT")
    assert "it was sent more than 3 s ago" in answer.message
    for stood_s in (0.0, 2.0, 4.0):  # what it stood still for is over, and what was sent meanwhile still comes
        node.be_late(LATE_S + stood_s)
        status, result = client.fly(action.GoToWaypoint, GO_TO, waypoint=pose(0.0, 50.0, 3.0))
        assert (status, result.reason) == (ABORTED, "TIMEOUT")
        assert "the node stood still for 3.1 s" in result.message
    assert is_still(flying, begin)
    node.be_late(LATE_S + 5.1)
    assert client.fly(action.GoToWaypoint, GO_TO, waypoint=here)[0] == SUCCEEDED


class Waiting(UavInterface):
    """The interface of a UAV, of which only what it does with a command is used: its frame comes very late."""

    def __init__(self) -> None:
        self._ns, self._is_active, self._not_leased, self._commands = "uav_1", True, None, set()
        self._now_s = 100.0
        self._lateness = LatenessCheck(is_refused=True, utc_s=lambda: self._now_s)
        self._contact = DaemonContact(AsyncMock(), 30.0, lambda: 0.0)
        frames: Any = SimpleNamespace(provide=self._provide)
        self._frames = frames

    async def _provide(self, _: object) -> None:
        self._now_s += LATE_S


def test_a_command_that_waited_too_long_for_its_frame_is_not_executed() -> None:
    command = RosCommand("set_velocity", srv.SetVelocity, lambda *_: pytest.fail("it is flown"))

    async def check() -> CommandOutcome:
        return await Waiting().begin_command(command, srv.SetVelocity.Request(), 100.0).task

    assert asyncio.run(check()).reason == "TIMEOUT"


def test_what_ends_a_flight_is_obeyed_late(client: Client, node: LateNode, flying: ual.Uav) -> None:
    node.be_late(LATE_S)
    node.start()
    task = flying.go_to_waypoint(ual.Pose.at(900.0, 0.0, 3.0), blocking=False)
    assert client.call(srv.Abort, f"{UAL}/abort").success
    with pytest.raises(ual.TaskAbortedError):
        task.wait()
    assert client.call(srv.Land, f"{UAL}/land", blocking=True).success


def test_a_pose_that_its_publisher_kept_is_not_executed(
    client: Client, node: LateNode, flying: ual.Uav, reported: list[DiagnosticArray]
) -> None:
    begin = flying.pose().pose.position
    node.be_late(0.6)  # longer than a setpoint may be old
    of_topic = "qos_overrides./uav_1/ual/set_pose.subscription"
    node.start(f"{of_topic}.durability:=transient_local", f"{of_topic}.reliability:=reliable")
    waited(lambda: reported)  # it is active: before that it hears nothing
    client.node.create_publisher(PoseStamped, f"{UAL}/set_pose", LATCHED).publish(pose(9.0, 0.0, 3.0))
    is_refused(reported, "TIMEOUT: it was sent more than 0.5 s ago")
    assert is_still(flying, begin)


@pytest.mark.parametrize(("age_s", "words"), [(86_400.0, "ago"), (-86_400.0, "in the future")])
def test_a_setpoint_that_is_stamped_for_another_time_is_not_executed(
    client: Client, node: LateNode, flying: ual.Uav, reported: list[DiagnosticArray], age_s: float, words: str
) -> None:
    node.start()
    begin = flying.pose().pose.position
    wrong = velocity(1.0)
    wrong.header.stamp.sec = math.floor(time.time() - age_s)
    client.repeat(0.05, TwistStamped, f"{UAL}/set_velocity", lambda: wrong)
    is_refused(reported, f"TIMEOUT: it is stamped more than 0.5 s {words}")
    assert is_still(flying, begin)


def test_a_setpoint_of_the_present_is_executed(client: Client, node: LateNode, flying: ual.Uav) -> None:
    node.start()

    def stamped() -> TwistStamped:
        message = velocity(1.0)
        message.header.stamp = client.node.get_clock().now().to_msg()
        return message

    client.repeat(0.02, TwistStamped, f"{UAL}/set_velocity", stamped)
    waited(lambda: flying.velocity().twist.linear.x > 0.9)
