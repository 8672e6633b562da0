"""The conformance checks over the simulated DJI aircraft, behind both wrappers, in the process."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.patient_checks import grouped, run_check_or_skip, wait_until_ready, without
from tests.simulators.dji import Psdk
from tests.simulators.dji_cameras import Camera
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk, LockstepOsdkVehicle, LockstepPsdk
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.settings import LimitSettings, VehicleSettings

TOLERANCES = Tolerances(
    position_m=0.5, wander_m=0.0, heading_rad=0.2, speed_m_s=0.3, line_ratio=0.1, overshoot_ratio=0.1
)
LIMIT_M_S = 2.5
"""Slow enough that the checks fly it to its limit."""
NOT_HERE = {
    "arming_belongs_to_the_pilot",
    "the_pilot_flies_and_gives_back",
    "bad_poses_from_outside_are_refused",
    *without(),
}
"""Checks that are skipped, and no others: control authority that the pilot took is only obtained, never given."""
NOT_BEHIND_OSDK = {"goes_to_a_geographic_waypoint"}
"""dji_osdk_ros does not say how the ellipsoid lies to mean sea level, which the check asks for, too."""


SETTINGS = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=LIMIT_M_S))
WRAPPERS: dict[str, type[LockstepDji]] = {
    "psdk": LockstepPsdk,
    "osdk": LockstepOsdk,
    "osdk_vehicle": LockstepOsdkVehicle,
}


@pytest.fixture(scope="module", params=[grouped(kind, name, f"dji_{name}") for name, kind in WRAPPERS.items()])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    backend: LockstepDji = request.param(BackendOptions("uav_1"))
    for node in backend.bridge.nodes:
        if isinstance(node, Psdk):
            node.camera_module.cameras[1] = Camera()
            node.gimbal_module.is_mounted = True
    with UAL(backend, settings=SETTINGS, allow_arming=True) as uav:
        wait_until_ready(uav)
        yield Flight(uav, TOLERANCES)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check, request: pytest.FixtureRequest) -> None:
    not_here = NOT_HERE | (NOT_BEHIND_OSDK if "osdk" in request.node.name else set())
    run_check_or_skip(flight, check, not_here)
