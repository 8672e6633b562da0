"""``ual ros2`` beside a ROS that is not there: `rclpy`, CMake and the node are small files of the test."""

from __future__ import annotations

import fcntl
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from ual_tools.ros2 import found, interfaces
from ual_tools.ros2.found import RosInstallation

CMAKE = """\
#!{python}
import pathlib, sys
with open({log!r}, "a") as log:
    log.write(" ".join(sys.argv[1:]) + "\\n")
if {fails}:
    sys.exit("no such generator")
if "-S" in sys.argv:
    settings = dict(word[2:].split("=", 1) for word in sys.argv if word.startswith("-D"))
    name = pathlib.Path(sys.argv[sys.argv.index("-B") + 1]).name
    module = pathlib.Path(settings["CMAKE_INSTALL_PREFIX"], "lib/python3/site-packages", name)
    module.mkdir(parents=True)
    (module / "__init__.py").touch()
"""
NODE = """\
import json, os, sys
import tf2_msgs, ual_msgs
print(json.dumps({"words": sys.argv[1:], "ament": os.environ["AMENT_PREFIX_PATH"], "ual_msgs": ual_msgs.__file__}))
"""


class Machine:
    """A home directory, and a ROS that only looks like one."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.log = root / "cmake.log"
        self.ros = root / "opt"
        self.cache = root / "cache" / "ual" / "ros2"
        self._write("python/rclpy/__init__.py", "")
        self._write("python/ual_ros2/__init__.py", "")
        self._write("python/ual_ros2/__main__.py", NODE)
        self._write("opt/share/rclpy/package.xml", "<package><version>7.1.6</version></package>")
        self.make_cmake(fails=False)

    def _write(self, name: str, text: str) -> Path:
        file = self.root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file

    def make_cmake(self, *, fails: bool) -> None:
        """Puts a CMake on the path, which writes down how it is called, and a compiler, which is not."""
        for name in ("cmake", "c++"):
            text = CMAKE.format(python=sys.executable, log=str(self.log), fails=fails)
            self._write(f"bin/{name}", text).chmod(0o755)

    def ual(self, *words: str, **changes: str) -> subprocess.CompletedProcess[str]:
        """Runs ``ual`` with these words."""
        running = self.begin(*words, **changes)
        out, error = running.communicate(timeout=60.0)
        return subprocess.CompletedProcess(running.args, running.returncode, out, error)

    def begin(self, *words: str, **changes: str) -> subprocess.Popen[str]:
        """Starts ``ual`` with these words."""
        program = "from ual_tools.main import main; main()"
        environment = {
            "PATH": str(self.root / "bin"),
            "PYTHONPATH": os.pathsep.join([str(self.root / "python"), *filter(None, sys.path)]),
            "XDG_CACHE_HOME": str(self.root / "cache"),
            "HOME": str(self.root),
            "AMENT_PREFIX_PATH": str(self.ros),
        }
        command = [sys.executable, "-c", program, *words]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, env=environment | changes, stdout=pipe, stderr=pipe, text=True)

    def node(self, *words: str) -> dict[str, Any]:
        """Returns what the node says of how it was started."""
        done = self.ual(*words)
        assert done.returncode == 0, done.stderr
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer

    def steps(self) -> list[str]:
        """Returns the calls of CMake."""
        return self.log.read_text().splitlines() if self.log.exists() else []


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_without_ros_it_says_what_to_install(machine: Machine) -> None:
    done = machine.ual("ros2", PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    assert done.returncode == 1
    assert "does not find rclpy. Install ROS 2" in done.stderr
    assert "setup.bash" in done.stderr


def test_without_a_compiler_it_says_what_to_install(machine: Machine) -> None:
    done = machine.ual("ros2", PATH=str(machine.root))
    assert done.returncode == 1
    assert "there is no cmake and no c++: `sudo apt install build-essential cmake`" in done.stderr


def test_the_interfaces_are_built_once_and_found_by_the_node(machine: Machine) -> None:
    first = machine.node("ros2")
    assert len(machine.steps()) == 6  # configured, built and installed, for tf2_msgs and ual_msgs
    assert [step for step in machine.steps() if "-DCMAKE_INSTALL_RPATH=$ORIGIN" in step and "-S" in step]
    assert len([step for step in machine.steps() if "-DUAL_FOR_PYTHON_ALONE=OFF" in step]) == 2
    assert machine.node("ros2") == first
    assert len(machine.steps()) == 6
    [prefix] = [path for path in machine.cache.iterdir() if path.is_dir()]
    assert first["ual_msgs"].startswith(str(prefix))
    assert first["ament"] == f"{prefix}{os.pathsep}{machine.ros}"


def test_two_programs_at_once_build_them_once(machine: Machine) -> None:
    machine.node("ros2")
    [prefix] = [path for path in machine.cache.iterdir() if path.is_dir()]
    prefix.rename(machine.root / "built")
    with prefix.with_suffix(".lock").open("w") as building:
        fcntl.flock(building, fcntl.LOCK_EX)
        waiting = machine.begin("ros2")
        assert waiting.stderr is not None
        assert waiting.stderr.readline() == "ual: another program builds ual_msgs already: waiting for it\n"
        (machine.root / "built").rename(prefix)
    said, _ = waiting.communicate(timeout=60.0)
    assert json.loads(said)["ual_msgs"].startswith(str(prefix))
    assert len(machine.steps()) == 6


def test_what_ros_has_is_not_built(machine: Machine) -> None:
    for name in ("tf2_msgs", "ual_msgs"):
        machine._write(f"python/{name}/__init__.py", "")
    assert machine.node("ros2")["ament"] == str(machine.ros)
    assert machine.steps() == []


def test_another_version_of_ros_gets_its_own(machine: Machine) -> None:
    machine.node("ros2")
    machine._write("opt/share/rclpy/package.xml", "<package><version>9.1.2</version></package>")
    machine.node("ros2")
    assert len([path for path in machine.cache.iterdir() if path.is_dir()]) == 2


def test_what_is_for_python_alone_is_another_build(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(machine.root / "bin"))
    ros, told = found.RosInstallation((machine.ros,)), list[str]()
    of_all, of_python = (
        interfaces.ready(ros, machine.cache, told.append, for_python_alone=is_alone)["AMENT_PREFIX_PATH"]
        for is_alone in (False, True)
    )
    assert of_all != of_python
    assert [line.rpartition(": ")[2] for line in told] == ["some minutes", "about a minute"]
    asked = [word for step in machine.steps() for word in step.split() if "PYTHON_ALONE" in word]
    assert asked == ["-DUAL_FOR_PYTHON_ALONE=OFF"] * 2 + ["-DUAL_FOR_PYTHON_ALONE=ON"] * 2


def test_a_build_that_fails_is_reported_and_leaves_nothing_half_done(machine: Machine) -> None:
    machine.make_cmake(fails=True)
    done = machine.ual("ros2")
    assert done.returncode == 1
    assert "tf2_msgs cannot be built: `cmake -S` ended with 1" in done.stderr
    assert "no such generator" in done.stderr
    [log] = machine.cache.glob("*.log")
    assert str(log) in done.stderr
    assert "no such generator" in log.read_text()
    machine.make_cmake(fails=False)
    assert machine.node("ros2")["words"] == []


def test_options_of_ual_become_parameters_of_the_node(machine: Machine, tmp_path: Path) -> None:
    token = tmp_path / "a token"
    token.touch()
    node = machine.node("--ns", "uav_1,uav_2", "--token-file", str(token), "--lease", "ros2")
    assert node["words"] == [
        "--ros-args",
        "-p",
        'ns:=["uav_1", "uav_2"]',
        "-p",
        f'token_file:="{token}"',
        "-p",
        "lease:=true",
    ]


def test_a_lease_that_is_taken_is_taken_by_the_node(machine: Machine) -> None:
    words = machine.node("--take", "ros2")["words"]
    assert {"lease:=true", "lease_take:=true"} <= set(words)


def test_the_network_is_not_left_out_silently(machine: Machine) -> None:
    done = machine.ual("--network", "ros2")
    assert done.returncode == 2
    assert "the node does not look on the network: say where the UAVs are" in done.stderr


def test_further_words_go_to_the_node(machine: Machine) -> None:
    words = ["--ros-args", "-p", "rate_hz:=100.0"]
    assert machine.node("--all", "ros2", "--", *words)["words"] == words


def test_the_variables_are_printed_for_a_shell(machine: Machine) -> None:
    done = machine.ual("ros2", "--variables")
    assert done.returncode == 0, done.stderr
    assert re.findall(r"^export (\w+)=", done.stdout, re.MULTILINE) == [
        "AMENT_PREFIX_PATH",
        "LD_LIBRARY_PATH",
        "PYTHONPATH",
    ]


def test_what_is_built_comes_before_what_was_there(tmp_path: Path) -> None:
    (tmp_path / "local" / "lib" / "python3.12" / "dist-packages").mkdir(parents=True)  # as on Debian and Ubuntu
    ros = RosInstallation((Path("/opt/ros/jazzy"),))
    before = {"LD_LIBRARY_PATH": "/opt/ros/jazzy/lib", "PYTHONPATH": "", "AMENT_PREFIX_PATH": "/opt/ros/jazzy"}
    assert interfaces.variables(tmp_path, ros, before) == {
        "AMENT_PREFIX_PATH": f"{tmp_path}:/opt/ros/jazzy",
        "LD_LIBRARY_PATH": f"{tmp_path}/lib:/opt/ros/jazzy/lib",
        "PYTHONPATH": f"{tmp_path}/local/lib/python3.12/dist-packages",
    }


def test_ros_from_wheels_is_where_python_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "share" / "ament_index").mkdir(parents=True)
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(found, "find_spec", {"rclpy": object()}.get)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    assert found.ros() == RosInstallation((tmp_path,))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/opt/ros/jazzy:{tmp_path}")
    assert found.ros() == RosInstallation((Path("/opt/ros/jazzy"), tmp_path))
