"""The conformance checks over a small AirSim, through the class and over gRPC to a daemon."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import ual
from tests.conftest import DaemonProcess, daemon_environment
from tests.patient_checks import run_check
from tests.simulators.airsim import Vehicle
from tests.simulators.airsim_server import AirsimServer, wait_until
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.conformance.flight import CannotRunError
from ual.interface import Uav
from ual_daemon import UAL
from ual_daemon.settings import LimitSettings, VehicleSettings

RATE_HZ = 25.0
LIMIT_M_S = 2.5
"""Slow enough that the checks fly it to its limit."""
TOLERANCES = Tolerances(
    position_m=0.4, wander_m=0.0, heading_rad=0.2, speed_m_s=0.4, line_ratio=0.1, overshoot_ratio=0.1
)
NOT_HERE = {"arming_belongs_to_the_pilot", "bad_poses_from_outside_are_refused"}
"""What is skipped, and nothing else: a simulation's daemon may arm, and `simple_flight` needs no poses."""


def over_class(stack: ExitStack, url: str, _: Path) -> Uav:
    settings = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=LIMIT_M_S))
    return stack.enter_context(
        UAL("airsim", "uav_1", url=url, settings=settings, backend_settings={"rate_hz": RATE_HZ})
    )


def over_grpc(stack: ExitStack, url: str, directory: Path) -> Uav:
    settings = (f"limits.horizontal_speed_m_s={LIMIT_M_S}", f"airsim.rate_hz={RATE_HZ}")
    flags = [flag for each in settings for flag in ("--set", each)]
    daemon = DaemonProcess(
        ("--backend", "airsim", "--url", url, "--listen", "127.0.0.1:0", *flags),
        "uav_1",
        daemon_environment(directory),
    )
    stack.callback(daemon.close)
    return stack.enter_context(ual.Uav(address=daemon.address))


WAYS = [
    # All checks of a way run on one worker: one daemon, and one flight from check to check.
    pytest.param(way, id=way.__name__, marks=pytest.mark.xdist_group(f"airsim {way.__name__}"))
    for way in (over_class, over_grpc)
]


@pytest.fixture(scope="module", params=WAYS)
def flight(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    make: Callable[[ExitStack, str, Path], Uav] = request.param
    with ExitStack() as stack:
        server = stack.enter_context(AirsimServer([Vehicle("Drone1")], clock_speed=6.0))
        uav = make(stack, server.url, tmp_path_factory.mktemp("ual"))
        wait_until(uav.is_ready, "it is not ready")
        yield Flight(uav, TOLERANCES)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check) -> None:
    try:
        run_check(flight, check)
    except CannotRunError:
        assert check.name in NOT_HERE
        pytest.skip("not with this autopilot: see NOT_HERE")
