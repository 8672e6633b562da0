"""The conformance checks over the simulated DJI aircraft, behind both wrappers, through the class and over gRPC."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest

from tests.patient_checks import grouped, run_check_or_skip, served, wait_until_ready
from tests.simulators.lockstep_dji import LockstepDji, LockstepOsdk, LockstepOsdkVehicle, LockstepPsdk
from ual import conformance
from ual.conformance import Check, Flight, Tolerances
from ual.interface import Uav
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
}
"""What is skipped, and nothing else: control authority that the pilot took is only obtained, never given."""
NOT_BEHIND_OSDK = {"goes_to_a_geographic_waypoint"}
"""dji_osdk_ros does not say how the ellipsoid lies to mean sea level, which the check asks for, too."""


def over_class(kind: type[LockstepDji], stack: ExitStack, _: Path) -> Uav:
    settings = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=LIMIT_M_S))
    return stack.enter_context(UAL(kind(BackendOptions("uav_1")), settings=settings, allow_arming=True))


def over_grpc(backend: str, stack: ExitStack, directory: Path) -> Uav:
    return served(stack, directory, backend, "--allow-arming", "--set", f"limits.horizontal_speed_m_s={LIMIT_M_S}")


WAYS = tuple(
    grouped(make, name, f"dji_{name}")
    for name, make in {
        "psdk_over_class": partial(over_class, LockstepPsdk),
        "psdk_over_grpc": partial(over_grpc, "lockstep_psdk"),
        "osdk_over_class": partial(over_class, LockstepOsdk),
        "osdk_over_grpc": partial(over_grpc, "lockstep_osdk"),
        "osdk_vehicle_over_class": partial(over_class, LockstepOsdkVehicle),
    }.items()
)


@pytest.fixture(scope="module", params=WAYS)
def flight(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    with ExitStack() as stack:
        uav = request.param(stack, tmp_path_factory.mktemp("ual"))
        wait_until_ready(uav)
        yield Flight(uav, TOLERANCES)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check, request: pytest.FixtureRequest) -> None:
    not_here = NOT_HERE | (NOT_BEHIND_OSDK if "osdk" in request.node.name else set())
    run_check_or_skip(flight, check, not_here)
