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
from ual.conformance.runner import LONGEST_TELEMETRY_GAP_S

SPEED_FACTOR = 3.0
ATTEMPTS = 5
NOT_HERE = (
    "arming_belongs_to_the_pilot",
    "reads_the_autopilots_parameters",
    "writes_a_parameter_and_reads_it_back",
    "writes_no_parameter_in_flight",
    "reads_the_autopilots_fence",
    "uploads_no_fence_in_flight",
    "reads_the_autopilots_mission",
    "keeps_an_uploaded_mission",
    "flies_a_mission_of_the_autopilot",
    "a_mission_of_the_autopilot_is_aborted",
    "lists_the_autopilots_logs",
    "downloads_a_log",
)
"""The first needs a daemon that may not arm: that of a light UAV always may. The others need an autopilot: those of
`test_beside_autopilots` are one."""
CARRIED = """\
payload:
  grippers: [{name: claw}]
  winches: [{name: hook}]
  servos: [{name: door, channel: 9, min_pwm_us: 1000, max_pwm_us: 2000, positions: {open: 1100}}]
  relays: [{name: lamp, number: 1}]
"""
NODE = ("rate_hz:=100.0", "slow_rate_hz:=20.0", "feedback_rate_hz:=50.0")
"""Faster than a daemon samples, so that each sample is told."""


@pytest.fixture(scope="module")
def flight(processes: Processes, client: Client, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    file = tmp_path_factory.mktemp("carried") / "daemon.yaml"
    file.write_text(CARRIED)
    processes.daemon("--config", str(file), "--set", f"light.speed_factor={SPEED_FACTOR}")
    processes.node("ns:=uav_1", *NODE)
    with ual.Uav("uav_1") as world:

        def now_s() -> float:
            return world.telemetry().stamp_s

        yield Flight(RosUav(client, world.ns, now_s), Tolerances.of_simulation())


def run_check(flight: Flight, check: Check) -> None:
    """Runs a check; runs it again if it failed while this computer was too busy to receive what the vehicle sent."""
    for _ in range(ATTEMPTS - 1):
        try:
            return conformance.run_check(flight, check)
        except (CheckFailedError, ual.UalError):
            if flight.longest_silence_s <= LONGEST_TELEMETRY_GAP_S:
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
        try:
            said = what_it_says(flight, check)
        except CannotRunError as error:
            assert check.name in NOT_HERE
            pytest.skip(str(error))
        if re.search(INEXPRESSIBLE[check.name].says, said):
            return
    pytest.fail(said or "it passes")


def what_it_says(flight: Flight, check: Check) -> str:
    try:
        conformance.run_check(flight, check)
    except (InexpressibleError, CheckFailedError, ual.UalError) as error:
        return str(error)
    return ""
