"""The conformance checks over the simulated Crazyflie, in the process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.patient_checks import run_check_or_skip, wait_until_ready, without
from tests.simulators.crazyflie import Crazyflie
from tests.simulators.lockstep_crazyflie import LockstepCrazyflie
from tests.simulators.ports import MemoryPort
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions

TOLERANCES = Tolerances(
    position_m=0.3, wander_m=0.0, heading_rad=0.2, speed_m_s=0.3, line_ratio=0.1, overshoot_ratio=0.1
)
NOT_HERE = {
    "arming_belongs_to_the_pilot",
    "the_pilot_takes_over",
    "the_pilot_flies_and_gives_back",
    "goes_to_a_geographic_waypoint",
    "bad_geographic_waypoints_are_refused",
    *without("parameters"),
}
"""Checks that are skipped, and no others: it has no safety pilot, and does not know its position on Earth."""


NEEDS_DISARMED = {"arms_and_disarms", "takes_off_only_when_armed", "writes_a_parameter_and_reads_it_back"}


ON_GROUND = [check for check in conformance.CHECKS if State.FLYING_AUTO not in check.starts]


@pytest.fixture(scope="module")
def flight() -> Iterator[Flight]:
    with UAL(LockstepCrazyflie(BackendOptions("uav_1")), allow_arming=True) as uav:
        wait_until_ready(uav)
        yield Flight(uav, TOLERANCES)


@pytest.fixture(scope="module")
def flight_of_one_that_arms_itself() -> Iterator[Flight]:
    port = MemoryPort()
    crazyflie = Crazyflie(port, arms_itself=True)
    with UAL(LockstepCrazyflie(BackendOptions("uav_1"), crazyflie, port), allow_arming=True) as uav:
        wait_until_ready(uav)
        yield Flight(uav, TOLERANCES)


@pytest.mark.xdist_group("crazyflie_that_arms_itself")
@pytest.mark.parametrize("check", ON_GROUND, ids=lambda check: check.name)
def test_one_that_arms_itself_skips_only_what_needs_it_disarmed(
    flight_of_one_that_arms_itself: Flight, check: Check
) -> None:
    run_check_or_skip(
        flight_of_one_that_arms_itself,
        check,
        NOT_HERE | NEEDS_DISARMED,
    )


@pytest.mark.xdist_group("crazyflie")
@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check) -> None:
    run_check_or_skip(flight, check, NOT_HERE)
