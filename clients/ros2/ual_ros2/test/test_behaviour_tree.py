"""The example with a behaviour tree flies where py_trees_ros is installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Processes
from flying import LIMIT_S

import ual

EXAMPLE = Path(__file__).parents[1] / "examples" / "behaviour_tree.py"
pytest.importorskip("py_trees_ros", reason="it is not on PyPI: apt install ros-jazzy-py-trees-ros")
BATTERY = ("--set", "light.battery_percent=45", "--set", "light.battery_endurance_s=60")


def test_a_tree_patrols_and_lands_once_the_battery_is_low(processes: Processes) -> None:
    processes.daemon("--auto-arm", *BATTERY)
    processes.node("ns:=uav_1")
    done = subprocess.run([sys.executable, str(EXAMPLE)], capture_output=True, text=True, timeout=LIMIT_S, check=False)
    assert done.returncode == 0, done.stderr
    flown = [line for line in done.stdout.splitlines() if line in {"take_off", "go_to_waypoint", "land", "landed"}]
    assert flown == ["take_off", "go_to_waypoint", "land", "landed"]
    with ual.Uav("uav_1") as uav:
        assert uav.state() in {ual.State.LANDED_ARMED, ual.State.LANDED_DISARMED}
