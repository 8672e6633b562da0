"""Programs that share no code with ROS' own client hear and command the node: Cyclone DDS, and ros2-client in Rust.

The node, the daemon and they run in a network of their own, whose only interface is loopback with multicast.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tests.clients.ros2.environments import NAMES, ROOT, Environment, alone, environment
from tests.conftest import LIMIT_S, daemon_environment
from tests.waiting import until
from tools import ros2
from ual import discovery

HERE = Path(__file__).parent
DOMAIN = 36
NO_NETWORK = "no network of its own can be made here: `unshare -rn` (util-linux) and `ip` (iproute2) are needed"
HOLD = ("sh", "-c", "echo ready && exec sleep 3600")
ON_LOOPBACK = "<Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces></General></Domain>"

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]


class Network:
    """A network of its own, and a UAV with its node in it."""

    def __init__(self, stack: ExitStack, ros: Environment, directory: Path) -> None:
        self._stack = stack
        self._directory = directory
        of_ros = {**ros.in_domain(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
        holder = subprocess.Popen([*alone(), *HOLD], stdout=subprocess.PIPE, text=True)
        stack.callback(self._end, holder)
        assert holder.stdout is not None
        with holder.stdout as said:
            assert said.readline() == "ready\n"
        self._inside = ["nsenter", "--preserve-credentials", "-U", "-n", "-m", "-t", str(holder.pid)]
        registry = daemon_environment(directory)
        flags = ["--backend", "light", "--ns", "uav_1", "--auto-arm", "--listen", "127.0.0.1:0"]
        self._start(registry, sys.executable, "-m", "ual_daemon", *flags, "--set", "light.speed_factor=4")
        of_node = {**of_ros, discovery.RUNTIME_DIR_VARIABLE: str(directory)}
        self._start(of_node, str(ros.python), "-m", "ual_ros2", "--ros-args", "-p", "ns:=uav_1")

    def _start(self, variables: dict[str, str], *command: str) -> None:
        log = self._stack.enter_context((self._directory / "log").open("ab"))
        started = subprocess.Popen([*self._inside, *command], env=variables, stdout=log, stderr=log)
        self._stack.callback(self._end, started)

    @staticmethod
    def _end(process: subprocess.Popen[bytes] | subprocess.Popen[str]) -> None:
        process.terminate()
        process.wait(LIMIT_S)

    def status_text(self, *command: str, **variables: str) -> str:
        """Runs a program in the network, and returns what it says."""
        done = subprocess.run(
            [*self._inside, *command], env={**os.environ, **variables}, capture_output=True, text=True, timeout=120.0
        )
        assert done.returncode == 0, f"{done.stderr}\n{(self._directory / 'log').read_text()}"
        return done.stdout.strip()


@contextmanager
def network(ros: Environment, directory: Path) -> Iterator[Network]:
    with ExitStack() as stack:
        yield Network(stack, ros, directory)


@pytest.fixture(params=NAMES)
def flying(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Network]:
    found = environment(request.param)
    if isinstance(found, str):
        pytest.skip(found)
    if not alone():
        pytest.skip(NO_NETWORK)
    with network(found, tmp_path) as made:
        yield made


@pytest.fixture(scope="module")
def cyclone() -> Path:
    try:
        return ros2.package("cyclonedds==11.0.1")
    except subprocess.CalledProcessError:
        pytest.skip("Cyclone DDS does not hear the node here: PyPI's cyclonedds cannot be installed")


@pytest.fixture(scope="module")
def take_off() -> str:
    """The program in Rust."""
    if not (os.environ.get("UAL_TEST_CLIENTS") and os.environ.get("UAL_TEST_ROS2")):
        pytest.skip("to build ros2-client takes minutes: UAL_TEST_CLIENTS=1 make test-ros2")
    if shutil.which("cargo") is None:
        pytest.skip("ros2-client does not call the node here: no cargo. Get it: https://rustup.rs")
    target = ROOT / "build" / "take_off_by_rust"
    command = ["cargo", "build", "--locked", "--jobs", "2", "--target-dir", str(target)]
    done = subprocess.run(command, cwd=HERE / "take_off_by_rust", capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return str(target / "debug" / "take_off")


def test_cyclone_dds_hears_the_pose(flying: Network, cyclone: Path) -> None:
    command = (sys.executable, str(HERE / "pose_by_cyclone.py"), "/uav_1/ual/pose", str(DOMAIN))
    stamp, frame_id, height = flying.status_text(*command, PYTHONPATH=str(cyclone), CYCLONEDDS_URI=ON_LOOPBACK).split()
    assert abs(int(stamp) - time.time()) < 120.0
    assert frame_id == "uav_1/odom"
    assert float(height) == pytest.approx(0.0, abs=0.1)


def test_ros2_client_in_rust_takes_off_and_hears_why_not(flying: Network, take_off: str) -> None:
    def call() -> str:
        return flying.status_text(take_off, "/uav_1/ual", str(DOMAIN), "3")

    until(lambda: call() == "true", limit_s=LIMIT_S)
    assert call().startswith("false WRONG_STATE take_off needs the state LANDED_ARMED, but it is FLYING_AUTO")
