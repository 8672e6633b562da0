"""The conformance checks over the simulated autopilots, in the process. The wire is that of the light UAV's checks."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.patient_checks import grouped, run_check_or_skip, wait_until_ready, without
from tests.simulators.lockstep import LockstepArduPilot, LockstepPx4
from tests.simulators.parachute import Parachute
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.interface import Uav
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.settings import LimitSettings, VehicleSettings

LIMIT_M_S = 2.5
"""Slow enough that the checks fly it to its limit."""
# Without noise and wind, but with the lag of an autopilot's controllers.
TOLERANCES = Tolerances(
    position_m=0.4, wander_m=0.0, heading_rad=0.2, speed_m_s=0.4, line_ratio=0.1, overshoot_ratio=0.1
)
BACKENDS = {"px4": LockstepPx4, "ardupilot": LockstepArduPilot}
_NOT_OFFERED = without("corrections", "fence", "gripper", "logs", "missions", "parachute", "parameters")
NOT_HERE = {
    # A simulation's daemon may arm.
    "px4": {"arming_belongs_to_the_pilot", "the_pilot_flies_and_gives_back", *_NOT_OFFERED},
    "ardupilot": {"arming_belongs_to_the_pilot", *_NOT_OFFERED},
}
"""Checks that are skipped, and no others. PX4 takes OFFBOARD only while setpoints come, and the daemon sends none while
the pilot flies: the pilot cannot give control back.
"""


SETTINGS = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=LIMIT_M_S))


@pytest.fixture(scope="module", params=[grouped(kind, kind) for kind in BACKENDS])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def is_known(uav: Uav) -> bool:
    """Returns whether the autopilot's version and limits have come."""
    info = uav.info()
    return bool(info.autopilot_version) and info.limits.climb_speed_m_s >= 2.0


@pytest.fixture(scope="module")
def flight(kind: str) -> Iterator[Flight]:
    backend = BACKENDS[kind](BackendOptions("uav_1"))
    files = backend.autopilot.files
    files.files[f"{files.directory}/001.bin"] = bytes(range(256)) * 200  # a log
    with UAL(backend, settings=SETTINGS) as uav:
        wait_until_ready(uav, is_known)
        Parachute(backend.autopilot, is_component=kind == "px4")
        yield Flight(uav, TOLERANCES)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check, kind: str) -> None:
    run_check_or_skip(flight, check, NOT_HERE[kind], flight.uav.recover_from_manual)
