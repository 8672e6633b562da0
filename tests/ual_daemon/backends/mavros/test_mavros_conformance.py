"""The conformance checks through MAVROS: PX4 with ROS 2, ArduCopter with ROS 1, in the process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.patient_checks import (
    grouped,
    run_check_or_skip,
    wait_until_ready,
    without,
)
from tests.simulators.lockstep_mavros import LockstepMavrosArduPilot, LockstepMavrosPx4
from tests.ual_daemon.backends.mavlink.test_autopilot_conformance import NOT_HERE as NOT_OVER_MAVLINK
from tests.ual_daemon.backends.mavlink.test_autopilot_conformance import SETTINGS, TOLERANCES, is_known
from ual import conformance
from ual.conformance import Check, Flight
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions

BACKENDS = {"px4": LockstepMavrosPx4, "ardupilot": LockstepMavrosArduPilot}
NOT_HERE = {
    kind: names
    | {"bad_poses_from_outside_are_refused"}
    | without("corrections", "fence", "gripper", "missions", "parameters")
    for kind, names in NOT_OVER_MAVLINK.items()
}


@pytest.fixture(scope="module", params=[grouped(kind, f"mavros_{kind}") for kind in BACKENDS])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def flight(kind: str) -> Iterator[Flight]:
    with UAL(BACKENDS[kind](BackendOptions("uav_1")), settings=SETTINGS) as uav:
        wait_until_ready(uav, is_known)
        yield Flight(uav, TOLERANCES)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check, kind: str) -> None:
    run_check_or_skip(flight, check, NOT_HERE[kind], flight.uav.recover_from_manual)
