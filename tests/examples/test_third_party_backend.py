"""The example of a third party's backend, as installed: in a directory of its own, seen only by what runs here."""

from __future__ import annotations

from pathlib import Path

import pytest

import ual
from tests.conftest import DaemonProcess
from tests.examples.installing import install, run, search_path
from ual import conformance
from ual.types import State

FLY = """
import threading

from ual import Pose, State
from ual_daemon import UAL

with UAL(backend="hover", ns="uav_7", allow_arming=True, backend_settings={"speed": 10}) as uav:
    ready = threading.Event()
    with uav.subscribe(lambda sample: ready.set() if sample.state is State.LANDED_DISARMED else None):
        assert ready.wait(30.0)
    uav.arm()
    uav.take_off(3.0)
    uav.go_to_waypoint(Pose.at(4.0, 2.0, 3.0, yaw_rad=0.5))
    pose = uav.pose().pose
    assert (pose.position - Pose.at(4.0, 2.0, 3.0).position).norm() < 0.5, pose
    assert abs(pose.yaw_rad - 0.5) < 0.15, pose
    uav.land()
    print(uav.info().backend, uav.state().name)
print([thread.name for thread in threading.enumerate()])
"""

UNKNOWN = """
from ual_daemon import UAL
from ual_daemon.settings import ConfigError

for backend, settings in (("hoover", {}), ("hover", {"sped": 2}), ("hover", {"speed": 0})):
    try:
        UAL(backend=backend, backend_settings=settings)
    except ConfigError as error:
        print(error)
"""

CONFORM = """
import sys

import ual_hover

assert ual_hover.__file__.startswith(sys.argv[1])

from tests.patient_checks import run_check
from tests.simulators.lockstep_hover import LockstepHover
from tests.waiting import until
from ual import conformance
from ual.conformance.flight import CannotRunError
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions

first, end = map(int, sys.argv[2:])
with UAL(LockstepHover(BackendOptions("uav_1"), 5.0), allow_arming=True) as uav:
    until(uav.is_ready, seen=uav.telemetry)
    flight = conformance.Flight(uav)
    for check in conformance.CHECKS[first:end]:
        try:
            run_check(flight, check)
        except CannotRunError as error:
            print("SKIPPED", check.name, error)
        except Exception as error:
            print("FAILED", check.name, repr(error))
        else:
            print("PASSED", check.name)
"""
"""Its device is stepped: a computer that stands still for a moment is no pause of UAL's."""


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder in which the package is installed."""
    return install("third_party_backend", tmp_path_factory.mktemp("hover"))


def test_it_flies_in_the_process_and_leaves_no_thread(installed: Path) -> None:
    assert run(FLY, installed) == ["hover LANDED_ARMED", "['MainThread']"]


def test_errors_name_what_is_known(installed: Path) -> None:
    unknown, other_setting, bad_value = run(UNKNOWN, installed)
    known = "airsim, crazyflie, dji, hover, light, mavlink, mavros, replay"
    assert unknown == f"backend: there is no backend 'hoover'; known are {known}; did you mean hover?"
    assert other_setting == "hover.sped: there is no such setting; did you mean hover.speed?"
    assert bad_value.startswith("hover.speed: ")


def test_it_flies_from_a_daemon(
    installed: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.setenv("PYTHONPATH", search_path(installed))
    start_daemon = request.getfixturevalue("start_daemon")
    daemon: DaemonProcess = start_daemon("--allow-arming", "--set", "hover.speed=10", ns="uav_7", backend="hover")
    with ual.Uav(address=daemon.address) as uav:
        daemon.wait_for("state", new="LANDED_DISARMED")
        uav.arm()
        uav.take_off(2.0)
        with pytest.raises(ual.NotSupportedError, match="the backend hover cannot"):
            uav.go_to_waypoint_geo(0.0, 0.0, 2.0)
        uav.land()
        assert uav.state() in (State.LANDED_ARMED, State.LANDED_DISARMED)


PARTS = 4
MUST_PASS = {"takes_off", "goes_straight_to_a_waypoint", "flies_a_velocity_and_stops_without", "lands"}
"""These are never skipped."""


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_it_passes_the_conformance_checks(part: int, installed: Path) -> None:
    first, end = (len(conformance.CHECKS) * number // PARTS for number in (part, part + 1))
    results = [line.split(" ", 2) for line in run(CONFORM, installed, installed, first, end)]
    assert [result for result in results if result[0] == "FAILED"] == []
    names = [check.name for check in conformance.CHECKS[first:end]]
    assert [name for _, name, *_ in results] == names
    assert {check.name for check in conformance.CHECKS} >= MUST_PASS
    assert MUST_PASS.intersection(names) <= {name for outcome, name, *_ in results if outcome == "PASSED"}
