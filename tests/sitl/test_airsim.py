"""A real AirSim that already runs: UAL_TEST_AIRSIM_URL (HOST:PORT), and UAL_TEST_AIRSIM_VEHICLE where it has several.

Without Unreal, its RPC server and `simple_flight` do. See docs/reference/backends/airsim.md.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess, daemon_environment
from tests.patient_checks import without
from tests.waiting import until
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.conformance.flight import CannotRunError
from ual.errors import RejectedByAutopilotError
from ual.interface import Uav
from ual.types import State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]
VEHICLE = os.environ.get("UAL_TEST_AIRSIM_VEHICLE", "")
NOT_HERE = {
    "arming_belongs_to_the_pilot",
    "bad_poses_from_outside_are_refused",
    "scales_a_velocity_down",
    *without(),
}
"""Checks that may be skipped: its daemon may arm, it takes no poses, and its limit of 5 m/s needs more room than there
is.

A simulator without a renderer has no pictures: see `test_pictures_come_or_it_learns_why_not`.
"""
OF_CAMERAS = without("corrections", "fence", "gripper", "logs", "missions", "parameters")
NO_RENDERER = "not offered without Unreal"


@pytest.fixture(scope="module")
def url() -> str:
    url = os.environ.get("UAL_TEST_AIRSIM_URL")
    if not url:
        pytest.skip("no AirSim: set UAL_TEST_AIRSIM_URL=127.0.0.1:41451")
    return url


def over_class(stack: ExitStack, url: str, _: Path) -> Uav:
    return stack.enter_context(UAL("airsim", "uav_1", url=url, backend_settings={"vehicle_name": VEHICLE}))


def over_grpc(stack: ExitStack, url: str, directory: Path) -> Uav:
    return stack.enter_context(ual.Uav(address=started(stack, url, directory).address))


def started(stack: ExitStack, url: str, directory: Path) -> DaemonProcess:
    flags = ("--backend", "airsim", "--url", url, "--listen", "127.0.0.1:0")
    name = ("--set", f"airsim.vehicle_name={VEHICLE}") if VEHICLE else ()
    daemon = DaemonProcess((*flags, *name), "uav_1", daemon_environment(directory))
    stack.callback(daemon.close)
    return daemon


def wait_until_ready(uav: Uav) -> None:
    until(uav.is_ready, seen=uav.telemetry, limit_s=LIMIT_S)


# Before the checks, whose daemon would be a second one on the same link.
def test_a_daemon_that_is_killed_in_flight_leaves_it_hovering_and_the_next_one_says_so(
    url: str, tmp_path: Path
) -> None:
    with ExitStack() as stack:
        daemon = started(stack, url, tmp_path)
        uav = stack.enter_context(ual.Uav(address=daemon.address))
        wait_until_ready(uav)
        if uav.state() is State.LANDED_DISARMED:
            uav.arm()
        uav.take_off(3.0)
        goal = ual.Pose.at(10.0, 0.0, 3.0)
        uav.go_to_waypoint(goal, blocking=False)
        time.sleep(1.0)
        daemon.close()
        again = stack.enter_context(ual.Uav(address=started(stack, url, tmp_path).address))
        wait_until_ready(again)
        assert again.state() is State.FLYING_AUTO
        with pytest.raises(RejectedByAutopilotError, match="on the ground"):
            again.simulation.pilot_disarm()
        again.go_to_waypoint(goal)
        again.land()


@pytest.fixture(scope="module", params=[over_class, over_grpc], ids=lambda way: way.__name__)
def flight(request: pytest.FixtureRequest, url: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    connect: Callable[[ExitStack, str, Path], Uav] = request.param
    with ExitStack() as stack:
        uav = connect(stack, url, tmp_path_factory.mktemp("ual"))
        wait_until_ready(uav)
        flight = Flight(uav, Tolerances())
        yield flight
        with flight.observing():
            flight.bring_to([State.LANDED_DISARMED])


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check) -> None:
    try:
        conformance.run_check(flight, check)
    except RejectedByAutopilotError as error:
        if check.name not in OF_CAMERAS or NO_RENDERER not in str(error):
            raise
        pytest.skip(str(error))
    except CannotRunError as error:
        assert check.name in NOT_HERE
        pytest.skip(str(error))


def test_pictures_come_or_it_learns_why_not(flight: Flight) -> None:
    cameras = flight.uav.cameras
    assert [each.name for each in cameras.get_all()][:2] == ["front_center", "front_right"]
    try:
        image = cameras[0].image()
    except RejectedByAutopilotError as error:
        if NO_RENDERER not in error.metadata["text"]:
            raise
        pytest.skip(str(error))
    assert image.camera is not None
