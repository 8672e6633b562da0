"""The distributions: their versions, what their wheels carry, and that these fly."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager
from packaging.requirements import Requirement

import ual
import ual_daemon
import ual_tools
from tests.conftest import DaemonProcess, daemon_environment

ROOT = Path(__file__).parents[1]
CLIENTS = ROOT / "clients" / "python"
PROJECTS = {".": ual_daemon, "clients/python": ual, "clients/python/ual_tools": ual_tools}
PROGRAMS = [
    ("ual_daemon.program.entry", f"ual-daemon {ual_daemon.__version__}"),
    ("ual_tools.entry", f"ual, version {ual_tools.__version__}"),
]


@pytest.mark.parametrize("project", PROJECTS)
def test_the_wheel_has_the_version_of_the_package(project: str) -> None:
    assert ProjectMetadata(str(ROOT / project), PluginManager()).version == PROJECTS[project].__version__


def test_no_module_of_the_tools_hides_one_of_python() -> None:
    """Their pyproject.toml lies in the package: `python -m build` there has its modules on the path."""
    names = {path.stem for path in (CLIENTS / "ual_tools").iterdir()}
    assert not names & sys.stdlib_module_names


@pytest.mark.parametrize(("module", "shown"), PROGRAMS)
def test_a_program_shows_the_version_of_its_package(module: str, shown: str) -> None:
    command = [sys.executable, "-c", f"from {module} import main; main()", "--version"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0)
    assert (done.returncode, done.stdout.strip()) == (0, shown), done.stderr


@pytest.mark.parametrize("project", [".", "clients/python/ual_tools"])
def test_daemon_and_tools_ask_for_the_client_of_this_repository(project: str) -> None:
    text = (ROOT / project / "pyproject.toml").read_text(encoding="utf-8")
    assert re.findall(r'"ual-client==([^"]+)"', text) == [ual.__version__]


def test_the_client_asks_for_grpc_and_protobuf_only() -> None:
    assert required("clients/python") == {"grpcio", "grpcio-status", "protobuf", "typing-extensions"}


def test_the_daemon_does_not_ask_for_the_tools() -> None:
    assert "ual-tools" not in required(".")


def required(project: str) -> set[str]:
    """Returns the packages that pip installs with the distribution, without extras."""
    core = ProjectMetadata(str(ROOT / project), PluginManager()).core
    return {Requirement(each).name for each in core.dependencies}


@pytest.mark.parametrize("project", PROJECTS)
def test_the_wheel_carries_the_licence(project: str) -> None:
    builder = WheelBuilder(str(ROOT / project))
    assert builder.metadata.core.license_expression == "Apache-2.0"
    assert builder.metadata.core.license_files == ["LICENSE"]
    text = (ROOT / project / "LICENSE").read_text(encoding="utf-8")
    assert text == (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in text
    assert "END OF TERMS AND CONDITIONS" in text


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The contents of all wheels in one directory, as pip would install them."""
    directory = tmp_path_factory.mktemp("installed")
    for project in PROJECTS:
        for wheel in WheelBuilder(str(ROOT / project)).build(directory=str(directory / "dist"), versions=["standard"]):
            with zipfile.ZipFile(wheel) as archive:
                archive.extractall(directory)
    return directory


def test_the_wheels_carry_types_and_contract(installed: Path) -> None:
    assert (installed / "ual" / "py.typed").exists()
    assert (installed / "ual_daemon" / "py.typed").exists()
    for contract in (ROOT / "proto" / "ual" / "v1").glob("*.proto"):
        assert (installed / "ual" / "v1" / contract.name).read_bytes() == contract.read_bytes()


def test_the_wheels_carry_all_modules_and_nothing_else(installed: Path) -> None:
    for source, package in ((ROOT, "ual_daemon"), (CLIENTS, "ual"), (CLIENTS, "ual_tools")):
        of_source, of_wheel = (
            {str(path.relative_to(root)) for path in (root / package).rglob("*.py") if "packages" not in path.parts}
            for root in (source, installed)
        )
        assert of_wheel == of_source
    packages = {path.name for path in installed.iterdir() if path.is_dir() and not path.name.endswith(".dist-info")}
    assert packages == {"dist", "ual", "ual_tools", "ual_daemon"}


@pytest.mark.parametrize("package", ["ual_msgs", "ual_ros2/ual_ros2"])
def test_the_tools_carry_what_runs_as_a_node_of_ros(installed: Path, package: str) -> None:
    of_wheel, of_source = (
        {
            path.relative_to(root): path.read_bytes()
            for path in root.rglob("*")
            if path.is_file() and path.suffix != ".pyc"
        }
        for root in (installed / "ual_tools" / "ros2" / "packages" / package, ROOT / "clients" / "ros2" / package)
    )
    assert of_wheel == of_source
    for name in ("unite.cmake", "tf2_msgs/CMakeLists.txt", "tf2_msgs/package.xml", "tf2_msgs/msg/TFMessage.msg"):
        assert (installed / "ual_tools" / "ros2" / name).is_file()


FIRST_FLIGHT = ("takeoff 3", "goto 4 2 3 --yaw 90deg", "velocity 1 0 0 --for 2", "land")


def test_the_wheels_fly_the_first_flight_of_the_readme(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the packages that they need come from this environment."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(f"\n    ual {command}\n" in readme for command in FIRST_FLIGHT)
    monkeypatch.chdir(tmp_path)
    environment = daemon_environment(tmp_path / "run") | {"PYTHONPATH": str(installed), "PYTHONSAFEPATH": "1"}
    flags = ("--backend", "light", "--auto-arm", "--listen", "127.0.0.1:0", "--set", "light.speed_factor=10")
    daemon = DaemonProcess(flags, "uav_1", environment)
    try:
        daemon.wait_for("state", new="LANDED_ARMED")
        for command in FIRST_FLIGHT:
            _run_ual(environment, command.split())
        daemon.wait_for("task_done", task="land")
    finally:
        daemon.close()
    assert f"{installed}{os.sep}ual{os.sep}" in _run(environment, "import ual; print(ual.__file__)")


def _run_ual(environment: dict[str, str], words: list[str]) -> None:
    _run(environment, f"import sys; from ual_tools.main import main; sys.argv = {['ual', *words]!r}; main()")


def _run(environment: dict[str, str], program: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=60.0
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
