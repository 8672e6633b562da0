"""The conformance checks over ROS: all but those that ROS cannot express pass, and those do not."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from conftest import Processes
from flying import Client
from inexpressible import INEXPRESSIBLE, InexpressibleError
from ros_uav import RosUav

import ual
from ual import conformance
from ual.conformance import CannotRunError, Check, CheckFailedError, Flight, Tolerances
from ual.conformance.runner import LONGEST_GAP_S

SPEED_FACTOR = 3.0
ATTEMPTS = 5
NOT_HERE = (
    "arming_belongs_to_the_pilot",
    "reads_the_autopilots_parameters",
    "writes_a_parameter_and_reads_it_back",
    "writes_no_parameter_in_flight",
)
"""The first needs a daemon that may not arm: that of a light UAV always may. The others need an autopilot."""
NODE = ("rate_hz:=100.0", "slow_rate_hz:=20.0", "feedback_rate_hz:=50.0")
"""Faster than a daemon samples, so that each sample is told."""


@pytest.fixture(scope="module")
def flight(processes: Processes, client: Client) -> Iterator[Flight]:
    processes.daemon("--set", f"light.speed_factor={SPEED_FACTOR}")
    processes.node("ns:=uav_1", *NODE)
    with ual.Uav("uav_1") as world:

        def now_s() -> float:
            return world.telemetry().stamp_s

        yield Flight(RosUav(client, world.ns, world.simulation, now_s), Tolerances.of_simulation())


def run_check(flight: Flight, check: Check) -> None:
    """Runs a check; runs it again if it failed while this computer was too busy to receive what the vehicle sent."""
    for _ in range(ATTEMPTS - 1):
        try:
            return conformance.run_check(flight, check)
        except (CheckFailedError, ual.UalError):
            if flight.longest_silence_s <= LONGEST_GAP_S:
                raise
    return conformance.run_check(flight, check)


def named(check: Check) -> str:
    return check.name


CAN = [check for check in conformance.CHECKS if check.name not in INEXPRESSIBLE]
CANNOT = [check for check in conformance.CHECKS if check.name in INEXPRESSIBLE]


@pytest.mark.parametrize("check", CAN, ids=named)
def test_conformance(flight: Flight, check: Check) -> None:
    try:
        run_check(flight, check)
    except CannotRunError as error:
        assert check.name in NOT_HERE
        pytest.skip(str(error))


@pytest.mark.parametrize("check", CANNOT, ids=named)
def test_what_cannot_be_expressed(flight: Flight, check: Check) -> None:
    """One that passes is to be taken from the list. On a busy computer a command may come too late."""
    for _ in range(ATTEMPTS):
        said = what_it_says(flight, check)
        if re.search(INEXPRESSIBLE[check.name].says, said):
            return
    pytest.fail(said or "it passes")


def what_it_says(flight: Flight, check: Check) -> str:
    try:
        conformance.run_check(flight, check)
    except (InexpressibleError, CheckFailedError, ual.UalError) as error:
        return str(error)
    return ""
