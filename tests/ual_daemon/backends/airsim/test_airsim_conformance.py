"""The conformance checks over a small AirSim, in the process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.patient_checks import run_check, without
from tests.simulators.airsim import Vehicle
from tests.simulators.airsim_server import AirsimServer
from tests.simulators.lockstep_airsim import LockstepAirsim
from tests.waiting import until
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.conformance.flight import CannotRunError
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.settings import LimitSettings, VehicleSettings

LIMIT_M_S = 2.5
"""Slow enough that the checks fly it to its limit."""
TOLERANCES = Tolerances(
    position_m=0.4, wander_m=0.0, heading_rad=0.2, speed_m_s=0.4, line_ratio=0.1, overshoot_ratio=0.1
)
NOT_HERE = {
    "arming_belongs_to_the_pilot",
    "bad_poses_from_outside_are_refused",
    *without("cameras"),
}
"""Checks that are skipped, and no others: a simulation's daemon may arm, and `simple_flight` needs no poses."""


SETTINGS = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=LIMIT_M_S))


@pytest.fixture(scope="module")
def flight() -> Iterator[Flight]:
    vehicle = Vehicle("Drone1")
    with (
        AirsimServer([vehicle], clock_speed=6.0) as server,
        UAL(LockstepAirsim(BackendOptions("uav_1"), server, vehicle), settings=SETTINGS) as uav,
    ):
        until(uav.is_ready, "its readiness")
        yield Flight(uav, TOLERANCES)


@pytest.mark.xdist_group("airsim")
@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check) -> None:
    try:
        run_check(flight, check)
    except CannotRunError:
        assert check.name in NOT_HERE
        pytest.skip("not with this autopilot: see NOT_HERE")
