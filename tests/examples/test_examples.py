"""The examples, run as a user runs them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import ual
from tests.conftest import DaemonProcess, StartDaemon
from ual import discovery
from ual.simulation import PositionLost

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(name: str, *arguments: str, **environment: str) -> list[str]:
    """The lines that an example prints."""
    done = subprocess.run(
        [sys.executable, "-W", "error", str(EXAMPLES / name), *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=100.0,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def armed_daemon(start_daemon: StartDaemon) -> DaemonProcess:
    daemon = start_daemon("--auto-arm", "--set", "light.speed_factor=5")
    daemon.wait_for("state", new="LANDED_ARMED")
    return daemon


def test_first_flight() -> None:
    lines = run("first_flight.py")
    assert [line.split()[0] for line in lines] == ["up", "there", "LANDED_ARMED"]


def test_client_flight(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    daemon = armed_daemon(start_daemon)
    lines = run("client_flight.py", **{discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir)})
    assert lines[0] == f"flying {daemon.ns}"
    assert any(re.fullmatch(r"take-off: SUCCEEDED 100%", line) for line in lines)
    assert any(line.startswith("refused, as it should be: recover_from_manual") for line in lines)
    assert lines[-1] == "landed"


def test_the_cells_of_the_notebook_of_the_first_hour(
    start_daemon: StartDaemon, runtime_dir: Path, tmp_path: Path
) -> None:
    armed_daemon(start_daemon)
    cells = json.loads((EXAMPLES / "first_hour.ipynb").read_text("utf-8"))["cells"]
    program = tmp_path / "first_hour.py"
    program.write_text("\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"), "utf-8")
    lines = run(str(program), MPLBACKEND="agg", **{discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir)})
    assert lines[0] == "light LANDED_ARMED"
    assert any(line.startswith("refused: ") for line in lines)
    flown = re.fullmatch(r"(\S+) m flown, up to (\S+) m", lines[-1])
    assert flown is not None
    assert 21.0 < float(flown[1]) < 24.0  # up 3 m, a square of 16 m, down 3 m
    assert 2.8 < float(flown[2]) < 3.2


def test_inspection_path(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    armed_daemon(start_daemon)
    lines = run("inspection_path.py", **{discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir)})
    assert lines[-1] == "inspected"
    shown = [line for line in lines if line.startswith("waypoint")]
    assert len(shown) >= 3
    left_m = [float(line.split()[-3]) for line in shown]
    assert left_m == sorted(left_m, reverse=True)


def test_formation(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    start_daemon("--fleet", "3", "--set", "light.speed_factor=5").wait_for("state", ns="uav_3", new="LANDED_DISARMED")
    team = ("uav_1", "uav_2", "uav_3")
    lines = run("formation.py", "--arm", *team, **{discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir)})
    assert lines == ["all at 1, 0", "all at 1, 1", "all at 0, 1", "all at 0, 0", "all landed"]


def test_external_poses(start_daemon: StartDaemon, runtime_dir: Path) -> None:
    daemon = start_daemon()
    daemon.wait_for("state", new="LANDED_DISARMED")
    with ual.Uav() as uav:
        uav.simulation.begin_fault(PositionLost())
    daemon.wait_for("state", new="UNINITIALIZED")
    lines = run("external_poses.py", **{discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir)})
    assert any("LANDED_DISARMED not armed Vector3(x=1.0, y=2.0, z=0.0)" in line for line in lines), lines


def test_deliver() -> None:
    assert run("deliver.py") == ["released at 5.0, 2.0, 3.5 m below the UAV", "landed"]


def test_land_on_marker() -> None:
    pytest.importorskip("cv2", reason="no OpenCV: pip install opencv-python-headless")
    [line] = run("land_on_marker.py")
    landed = re.fullmatch(r"landed (\S+) m from the marker", line)
    assert landed is not None
    assert float(landed[1]) < 0.2


PROGRAMS = sorted(each.stem for each in EXAMPLES.glob("*.py") if '__name__ == "__main__"' in each.read_text("utf-8"))


def test_every_example_is_a_program_or_a_part_of_one() -> None:
    assert {each.stem for each in EXAMPLES.glob("*.py")} - set(PROGRAMS) == {"together", "tracks"}


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_answers_help_and_says_what_it_moves_without_a_uav(name: str, runtime_dir: Path) -> None:
    """There is no daemon here: one that connects fails."""
    if name == "land_on_marker":
        pytest.importorskip("cv2")
    module = ("-m", f"examples.{name}")
    done = subprocess.run(
        [sys.executable, *module, "--help"],
        cwd=EXAMPLES.parent,
        env={**os.environ, discovery.RUNTIME_DIR_VARIABLE: str(runtime_dir), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=100.0,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: ")
    assert name == "external_poses" or MOVES.search(done.stdout)


MOVES = re.compile(
    r"\b(fl(y|ies)|lands?|delivers?|circles?|surveys?|perches|change places|film|inspects?)\b", re.IGNORECASE
)
