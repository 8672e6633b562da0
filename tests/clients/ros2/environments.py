"""ROS 2 from PyPI for a test, or why the test is skipped."""

from __future__ import annotations

import functools
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tools import ros2

ROOT = Path(__file__).parents[3]
NAMES = tuple(ros2.VERSIONS)
_ALONE = (
    'mount -t tmpfs tmpfs /dev/shm && ip link set lo up multicast on && ip route add 224.0.0.0/4 dev lo && exec "$@"'
)
_SOURCES = (ROOT / "clients" / "python", ROOT / "clients" / "ros2" / "ual_ros2")


@dataclass(frozen=True)
class Environment:
    """A Python that imports rclpy, `ual_msgs` and UAL, and the variables of its processes."""

    python: Path
    variables: Mapping[str, str]

    def in_domain(self, domain: int) -> dict[str, str]:
        """Returns the environment of a process that hears those of a domain (0 to 101)."""
        return {**os.environ, **self.variables, "ROS_DOMAIN_ID": str(domain)}


@functools.cache
def environment(name: str) -> Environment | str:
    """Returns the environment of a distribution, made where it is not there yet, or why it cannot be had."""
    if not os.environ.get("UAL_TEST_ROS2"):
        return "ROS 2 takes minutes to install and build: make test-ros2"
    if sys.platform != "linux" or shutil.which("cmake") is None or shutil.which("c++") is None:
        return "ROS 2 is not flown here: that needs Linux, cmake and c++ (apt-get install g++ cmake make)"
    try:
        python, variables = ros2.environment(name)
    except subprocess.CalledProcessError as error:
        return f"ROS 2 is not flown here: `{' '.join(map(str, error.cmd[:4]))} …` ended with {error.returncode}"
    ours = os.pathsep.join([variables["PYTHONPATH"], *map(str, _SOURCES)])
    return Environment(python, {**variables, "PYTHONPATH": ours})


@functools.cache
def alone() -> tuple[str, ...]:
    """Returns the words before a command that give it a network and a shared memory of its own.

    Loopback has multicast there. So neither another computer nor another test of this one is heard. No words: the
    machine does not allow it (`unshare`, `ip`).
    """
    words = ("unshare", "--map-root-user", "--net", "--mount", "sh", "-c", _ALONE, "sh")
    is_there = shutil.which("unshare") is not None
    return words if is_there and subprocess.run([*words, "true"], capture_output=True).returncode == 0 else ()
