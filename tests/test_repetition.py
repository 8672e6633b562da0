"""Tests that `make test` leaves out, and workers that share no flight: rules which fail silently."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests import repetition
from tests.ual.test_conformance import WAYS
from tests.ual_daemon.backends.faults.crafts import CRAFTS
from ual import conformance

ROOT = Path(__file__).parents[1]


def test_the_rules_name_what_there_is() -> None:
    named = (*repetition.PROGRAMS, *repetition.WHOLE, *repetition.BOTH_ALIKE, *repetition.CROSSED, repetition._MAVLINK)
    for each in named:
        path, _, test = each.partition("::")
        assert list(ROOT.glob(f"{path.rstrip('/')}*"))
        assert not test or f"def {test}" in (ROOT / path).read_text()
    assert set(repetition.SAME_BACKEND) < set(CRAFTS)
    rooms = {check.run.__module__.rpartition(".")[2] for check in conformance.CHECKS}
    assert rooms > repetition._ABOVE_BACKENDS
    names = {check.name for check in conformance.CHECKS}
    assert names > (repetition._OF_TRAJECTORIES | repetition._OF_THE_WIRE)
    assert set(repetition.WHOLE["tests/ual/test_conformance.py"]) < {str(way.id) for way in WAYS}


SELECTED = """
test_stalls.py::test_a_command_in_a_stall_overrules_no_pilot[land-0.6-px4]
test_stalls.py::test_a_command_in_a_stall_overrules_no_pilot[land-0.6-mavros px4]
test_stalls.py::test_a_command_in_a_stall_overrules_no_pilot[land-1.5-px4]
test_autopilot_home.py::test_the_return_path_leads_to_a_home_that_was_set_just_before[px4]
test_autopilot_cut_uploads.py::test_a_fence_whose_rally_points_were_cut_off_is_not_enabled[px4-link]
test_autopilot_cut_uploads.py::test_a_fence_whose_rally_points_were_cut_off_is_not_enabled[ardupilot-client]
test_dji_conformance.py::test_conformance[psdk-turns_with_a_rate]
test_dji_conformance.py::test_conformance[osdk-takes_off]
test_dji_conformance.py::test_conformance[osdk-turns_a_gimbal]
test_dji_take_off.py::test_the_pilot_takes_over_at_any_time_of_a_take_off[2.3-LockstepPsdk]
test_dji_take_off.py::test_the_pilot_takes_over_at_any_time_of_a_take_off[0.2-LockstepOsdk]
test_crazyflie_vehicle.py::test_a_firmware_that_has_booted_in_flight_stays_down_and_was_not_controlled_by_others[-True-1.0-15.0]
"""
LEFT_OUT = """
test_stalls.py::test_a_command_in_a_stall_overrules_no_pilot[land-0.6-ardupilot]
test_stalls.py::test_a_command_in_a_stall_overrules_no_pilot[land-1.5-mavros px4]
test_autopilot_home.py::test_the_return_path_leads_to_a_home_that_was_set_just_before[ardupilot]
test_autopilot_cut_uploads.py::test_a_fence_whose_rally_points_were_cut_off_is_not_enabled[ardupilot-link]
test_dji_conformance.py::test_conformance[osdk-turns_with_a_rate]
test_dji_conformance.py::test_conformance[psdk-rounds_the_corners_of_a_path]
test_dji_take_off.py::test_the_pilot_takes_over_at_any_time_of_a_take_off[2.3-LockstepOsdk]
test_crazyflie_vehicle.py::test_a_firmware_that_has_booted_in_flight_stays_down_and_was_not_controlled_by_others[-False-1.0-15.0]
"""
"""Examples of flights that there are, and whether `make test` has them: some of each rule."""


def test_which_flights_are_selected() -> None:
    files = {each.partition("::")[0] for each in SELECTED.splitlines() if each}
    paths = [str(path) for name in files for path in (ROOT / "tests/ual_daemon/backends").rglob(name)]
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", "-m", "not repetition"]
    found = subprocess.run([*command, *paths], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    selected = {each.rpartition("/")[2] for each in found.splitlines()}
    assert set(filter(None, SELECTED.splitlines())) <= selected
    assert set(filter(None, LEFT_OUT.splitlines())).isdisjoint(selected)


@pytest.mark.xdist_group("flight")
def test_a_group_of_tests_keeps_to_one_worker(request: pytest.FixtureRequest) -> None:
    """pytest-xdist groups by the end of the name. With pytest 9.2 it had none, and each worker flew each flight."""
    if not request.config.getoption("loadgroup", default=False):
        pytest.skip("nothing is shared out by groups: -n 2 --dist loadgroup")
    assert request.node.nodeid.endswith("@flight")
