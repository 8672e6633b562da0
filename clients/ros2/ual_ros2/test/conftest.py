"""Daemons with light UAVs, nodes, and a client in ROS. Runs in an environment with ROS 2 (see tests/clients/ros2).

`DAEMON_PYTHON` is the Python that has the daemon; where it is not set, nothing is flown.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import rclpy
from flying import Client, waited

import ual
from ual import discovery

MOST_DOMAINS = 100
_RESERVED_AT = 5300
_reserved: list[socket.socket] = []


def reserve_domain() -> None:
    """Lets ROS use a domain that no other run of these tests on this computer uses: they would fly each other's UAVs.

    A domain is reserved by a port of its own, for as long as this process lives.
    """
    for number in range(MOST_DOMAINS):
        domain = 1 + (os.getpid() + number) % MOST_DOMAINS
        reserving = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            reserving.bind(("127.0.0.1", _RESERVED_AT + domain))
        except OSError:
            reserving.close()
            continue
        _reserved.append(reserving)
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        return
    raise RuntimeError("all domains of ROS are reserved")


reserve_domain()
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
ARMED_FAST = ("--auto-arm", "--set", "light.speed_factor=4")


class Processes:
    """Processes that a test has started."""

    def __init__(self, stack: ExitStack, directory: Path) -> None:
        self._stack = stack
        self._directory = directory
        self._count = 0
        self.running: list[subprocess.Popen[bytes]] = []

    def start(self, *command: str) -> subprocess.Popen[bytes]:
        """Starts a program, which is killed in the end."""
        self._count += 1
        log = self._stack.enter_context((self._directory / f"{self._count}.log").open("wb"))
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)
        self._stack.callback(end, process)
        self.running.append(process)
        return process

    def daemon(self, *flags: str, ns: str = "uav_1", backend: str = "light") -> subprocess.Popen[bytes]:
        """Starts the daemon of a UAV, and waits until it is there."""
        python = os.environ.get("DAEMON_PYTHON")
        if python is None:
            pytest.skip("DAEMON_PYTHON does not name a Python that has ual_daemon")
        environment = {name: value for name, value in os.environ.items() if name not in ROS_ONLY}
        log = self._stack.enter_context((self._directory / f"{ns}-{self._count}.log").open("wb"))
        command = (python, "-m", "ual_daemon", "--backend", backend, "--ns", ns, "--listen", "127.0.0.1:0", *flags)
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=subprocess.STDOUT)
        self._stack.callback(end, process)
        waited(lambda: process.poll() is not None or is_registered(ns, process))
        assert process.poll() is None, self.status_text()
        return process

    def node(self, *parameters: str, program: Sequence[str] = ("-m", "ual_ros2")) -> subprocess.Popen[bytes]:
        """Starts a node with parameters (``ns:=uav_1``); `program` is what Python runs."""
        given = [word for parameter in parameters for word in ("-p", parameter)]
        return self.start(sys.executable, *program, "--ros-args", *given)

    def status_text(self) -> str:
        """All that they have said."""
        return "".join(log.read_text(errors="replace") for log in sorted(self._directory.glob("*.log")))


ROS_ONLY = ("PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH")


def is_registered(ns: str, process: subprocess.Popen[bytes]) -> bool:
    """Returns whether the daemon of a name can be found."""
    found = discovery.registered(ns)
    return found is not None and found.pid == process.pid


def end(process: subprocess.Popen[bytes]) -> None:
    """Ends a process, however it is."""
    process.send_signal(signal.SIGCONT)
    process.terminate()
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def registry(directory: Path) -> Iterator[Processes]:
    """Starts daemons and nodes with a registry in a directory."""
    directory.chmod(0o700)
    with pytest.MonkeyPatch.context() as patch, ExitStack() as stack:
        patch.setenv("UAL_RUNTIME_DIR", str(directory))
        yield Processes(stack, directory)


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    """Starts daemons and nodes in a registry of their own."""
    with registry(tmp_path_factory.mktemp("run")) as processes:
        yield processes


@pytest.fixture
def own_processes(tmp_path: Path) -> Iterator[Processes]:
    """Starts daemons and nodes of one test."""
    with registry(tmp_path) as processes:
        yield processes


@contextmanager
def in_ros() -> Iterator[Client]:
    """A program in ROS."""
    rclpy.init()
    client = Client()
    yield client
    client.close()
    rclpy.try_shutdown()


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    """A program in ROS."""
    with in_ros() as client:
        yield client


@pytest.fixture
def own_client() -> Iterator[Client]:
    """A program in ROS, in a domain of its own: a node that was killed before is thought to be there for a while."""
    reserve_domain()
    with in_ros() as client:
        yield client


@pytest.fixture
def armed(uav: ual.Uav) -> ual.Uav:
    """The UAV, armed on the ground: what flew before lands."""
    if uav.state() is ual.State.FLYING_AUTO:
        uav.land()
    uav.wait_for(ual.State.LANDED_ARMED, timeout_s=60.0)
    return uav


@pytest.fixture
def flying(uav: ual.Uav) -> ual.Uav:
    """The UAV, 3 m over home: what flew before goes on from there."""
    if uav.state() is not ual.State.FLYING_AUTO:
        uav.wait_for(ual.State.LANDED_ARMED, timeout_s=60.0)
        uav.take_off(3.0)
    uav.go_to_waypoint(ual.Pose.at(0.0, 0.0, 3.0))
    return uav
