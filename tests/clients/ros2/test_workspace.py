"""A workspace of ROS 2: what colcon installs of `ual_ros2`, and what `ros2 run` and `ros2 launch` start of it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[3] / "clients" / "ros2" / "ual_ros2"
INSTALLED = (
    "lib/ual_ros2/node",
    "share/ament_index/resource_index/packages/ual_ros2",
    "share/ual_ros2/launch/team.launch.py",
    "share/ual_ros2/package.xml",
    "share/ual_ros2/rviz/uav.rviz",
    "share/ual_ros2/urdf/quadrotor.urdf",
)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the package, installed as colcon does it."""
    scratch = tmp_path_factory.mktemp("colcon")
    words = ["egg_info", f"--egg-base={scratch}", "build", f"--build-base={scratch / 'build'}", "install"]
    where = [f"--prefix={scratch / 'install'}", f"--record={scratch / 'record'}", "--single-version-externally-managed"]
    command = [sys.executable, "-W", "ignore", "setup.py", "--quiet", *words, *where]
    subprocess.run(command, cwd=PACKAGE, check=True, capture_output=True)
    return scratch / "install"


def run(installed: Path, bin_: Path, path: Path | str = "") -> subprocess.CompletedProcess[str]:
    """Runs the node as `ros2 run` does, where `python3` is that of a directory."""
    environment = {**os.environ, "PATH": f"{bin_}:/usr/bin:/bin", "PYTHONPATH": str(path)}
    return subprocess.run(
        [installed / "lib/ual_ros2/node"], env=environment, capture_output=True, text=True, timeout=60.0
    )


def test_ros_finds_the_package(installed: Path) -> None:
    assert [name for name in INSTALLED if not (installed / name).is_file()] == []


def test_the_node_runs_with_the_python_of_the_active_environment(installed: Path, tmp_path: Path) -> None:
    """`colcon` is a program of the system, and its Python has no UAL."""
    (tmp_path / "python3").symlink_to("/bin/echo")
    assert run(installed, tmp_path).stdout.strip() == str(installed / "lib/ual_ros2/node")


@pytest.mark.parametrize(
    ("has", "missing"),
    [
        ((), "does not find `rclpy` of ROS 2. Run `. /opt/ros/jazzy/setup.bash`"),
        (("rclpy",), "does not find `ual` of the Python client of UAL. Activate the virtual environment"),
        (("rclpy", "ual"), "does not find `ual_msgs` of ual_msgs. Run `. install/setup.bash`"),
    ],
)
def test_what_the_node_lacks_is_reported_with_what_to_do(
    installed: Path, tmp_path: Path, has: tuple[str, ...], missing: str
) -> None:
    for name in has:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    (tmp_path / "ual_ros2").symlink_to(PACKAGE / "ual_ros2")
    (tmp_path / "python3").write_text(f'#!/bin/sh\nexec {sys.executable} -S "$@"\n')
    (tmp_path / "python3").chmod(0o755)
    done = run(installed, tmp_path, tmp_path)
    assert done.returncode == 1
    assert missing in done.stderr
