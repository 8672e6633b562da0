"""A daemon with TLS and tokens: the node shows what its parameters name, and what a role may not do is told."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from conftest import ARMED_FAST, ROS_ONLY, Processes
from diagnostic_msgs.msg import DiagnosticArray
from flying import ABORTED, LATCHED, Client, pose, velocity, waited
from geometry_msgs.msg import PoseStamped, TwistStamped
from std_srvs.srv import Trigger
from ual_msgs import action, srv
from ual_msgs.msg import State

from ual import State as UavState
from ual import Uav, discovery

UAL = "/uav_1/ual"


class Team(NamedTuple):
    """Address of the UAV, and the files of the program that flies it."""

    address: str
    directory: Path

    def parameters(self, token: str) -> tuple[str, ...]:
        """The parameters of a node that shows a token."""
        authority = self.directory / "certificates" / "authority.pem"
        return (f"address:={self.address}", f"tls_ca:={authority}", f"token_file:={self.directory / token}")


@pytest.fixture(scope="module")
def team(processes: Processes, tmp_path_factory: pytest.TempPathFactory) -> Team:
    directory = tmp_path_factory.mktemp("team")
    flags = (*ARMED_FAST, "--tls-certificate", str(directory / "certificates/uav_1.pem"))
    secret = ("--tls-key", str(directory / "certificates/uav_1.key"), "--tokens", str(directory / "tokens.json"))
    ual(directory, "certificates", "authority")
    ual(directory, "certificates", "daemon", "uav_1", "--host", "127.0.0.1")
    for role, name in (("observer", "observer"), ("pilot", "pilot"), ("pilot", "guest")):
        ual(directory, "token", "new", "--role", role, "--name", name, "--output", f"{name}.token")
    (directory / "wrong.token").write_text("ual_wrong")
    processes.daemon(*flags, *secret)
    found = discovery.registered("uav_1")
    assert found is not None
    return Team(found.address, directory)


def ual(directory: Path, *words: str) -> None:
    """Runs `ual` with the Python of the daemon, which has what makes certificates."""
    python = os.environ.get("DAEMON_PYTHON")
    if python is None:
        pytest.skip("DAEMON_PYTHON does not name a Python that has ual-tools")
    environment = {name: value for name, value in os.environ.items() if name not in ROS_ONLY}
    done = subprocess.run(
        [str(Path(python).with_name("ual")), *words],
        cwd=directory,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.fixture(autouse=True)
def ended(processes: Processes) -> Iterator[None]:
    """Ends the node of each test."""
    before = set(processes.running)
    yield
    for node in set(processes.running) - before:
        node.terminate()
        node.wait(60.0)


def is_reported(client: Client, state: int, text: str = "") -> None:
    """Waits until the node that runs now tells a state, for a reason with a text in it."""
    states = client.hear(State, f"{UAL}/state", LATCHED)
    waited(lambda: states and states[-1].state == state and text in states[-1].reason)


def test_an_observer_sees_and_each_refusal_says_what_its_role_lacks(
    client: Client, processes: Processes, team: Team
) -> None:
    processes.node(*team.parameters("observer.token"))
    is_reported(client, State.LANDED_ARMED)
    poses, told = client.hear(PoseStamped, f"{UAL}/pose"), client.hear(DiagnosticArray, f"{UAL}/health", 10)
    waited(lambda: poses)
    refused = client.call(srv.TakeOff, f"{UAL}/take_off", height=3.0, blocking=True)
    assert (refused.success, refused.reason) == (False, "PERMISSION_DENIED")
    assert refused.message == "TakeOff needs the role pilot, and observer is an observer"
    assert {each.key: each.value for each in refused.metadata}["role"] == "observer"
    _, result = client.fly(action.TakeOff, f"{UAL}/take_off", height=3.0)
    assert (result.success, result.reason, result.message) == (False, "PERMISSION_DENIED", refused.message)
    assert client.call(Trigger, f"{UAL}/arm").message.startswith("PERMISSION_DENIED: ")
    stream = client.repeat(0.1, TwistStamped, f"{UAL}/set_velocity", lambda: velocity(1.0))
    waited(lambda: [each for each in told if "refused: PERMISSION_DENIED" in each.status[0].message])
    client.node.destroy_timer(stream)
    is_reported(client, State.LANDED_ARMED)


def test_a_pilot_flies(client: Client, processes: Processes, team: Team) -> None:
    processes.node(*team.parameters("pilot.token"))
    taken_off = client.call(srv.TakeOff, f"{UAL}/take_off", height=3.0, blocking=True)
    assert taken_off.success, taken_off.message
    assert client.call(srv.Land, f"{UAL}/land", blocking=True).success


@pytest.mark.parametrize(
    ("without", "said"),
    [("wrong.token", "UNAUTHENTICATED: "), ("tls_ca", "DAEMON_UNREACHABLE: ")],
)
def test_a_node_without_what_the_daemon_wants_says_so(
    client: Client, processes: Processes, team: Team, without: str, said: str
) -> None:
    parameters = team.parameters(without if without.endswith("token") else "pilot.token")
    processes.node("ns:=uav_1", *(each for each in parameters if not each.startswith(without)))
    is_reported(client, State.UNINITIALIZED, said)
    refused = client.call(srv.TakeOff, f"{UAL}/take_off", height=3.0, blocking=True)
    assert (refused.success, refused.reason) == (False, said.removesuffix(": "))


def test_a_token_that_is_revoked_in_flight_ends_the_goal_and_is_reported(
    client: Client, processes: Processes, team: Team
) -> None:
    processes.node(*team.parameters("guest.token"))
    assert client.call(srv.TakeOff, f"{UAL}/take_off", height=3.0, blocking=True).success
    goal = client.begin(action.GoToWaypoint, f"{UAL}/go_to_waypoint", lambda _: None, waypoint=pose(200.0, 0.0, 3.0))
    ual(team.directory, "token", "revoke", "guest")
    status, result = client.end_of(goal)
    assert (status, result.reason) == (ABORTED, "UNAUTHENTICATED")
    is_reported(client, State.UNINITIALIZED, "UNAUTHENTICATED: ")
    with Uav(address=team.address, tls_ca=str(team.directory / "certificates" / "authority.pem")) as world:
        waited(lambda: world.velocity().twist.linear.norm() < 0.02)
        telemetry = world.telemetry()
        assert (telemetry.state, telemetry.task) == (UavState.FLYING_AUTO, None)
        world.land()
