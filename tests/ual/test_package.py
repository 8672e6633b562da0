"""The package as its first user meets it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import ual
import ual_daemon
from ual import routes
from ual.geometry import Pose

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("module", "names"), [(ual, {"Uav", "aio", "Pose"}), (ual_daemon, {"UAL"})])
def test_dir_lists_what_is_imported_late(module: object, names: set[str]) -> None:
    assert names | {"__version__"} <= set(dir(module))


@pytest.mark.parametrize("package", ["ual", "ual_daemon"])
def test_a_name_that_is_none_is_an_error_for_python_and_for_mypy(package: str, tmp_path: Path) -> None:
    with pytest.raises(AttributeError, match="has no attribute 'Poze'"):
        __import__(package).__getattr__("Poze")
    user, package_itself = tmp_path / "user.py", Path(str(__import__(package).__file__))
    user.write_text(f"from {package} import Poze\n")
    # What the package imports says nothing of its own names, and took 8 s of a processor.
    options = ["--config-file=", "--follow-imports=skip", "--ignore-missing-imports"]
    command = [sys.executable, "-m", "mypy", *options, str(user), str(package_itself)]
    environment = {**os.environ, "MYPYPATH": f"{ROOT / 'clients' / 'python'}:{ROOT}"}
    ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert 'has no attribute "Poze"' in ran.stdout, ran.stdout + ran.stderr


def test_a_misspelled_value_of_a_sample_is_answered_with_what_was_meant() -> None:
    code = "import ual; print(ual.Telemetry(ual.State.FLYING_AUTO).baterry)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "'Telemetry' object has no attribute 'baterry'. Did you mean: 'battery'?" in ran.stderr


def test_a_route_is_read_by_a_name_as_by_a_path(tmp_path: Path) -> None:
    file = tmp_path / "saved.jsonl"
    file.write_text('{"x": 1.0, "y": 2.0, "z": 3.0}\n')
    assert routes.read(str(file)) == routes.read(file)
    (waypoint,) = routes.read(str(file)).waypoints
    assert getattr(waypoint, "pose", waypoint) == Pose.at(1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    "name", ["routes.read", "network.Network", "geotag.to_jpeg", "missions.MissionPlan", "simulation.LinkLost"]
)
def test_what_the_manual_writes_with_dots_needs_no_second_import(name: str) -> None:
    """In a process of its own: here, other tests have imported all of them."""
    subprocess.run([sys.executable, "-c", f"import ual; ual.{name}"], check=True)
