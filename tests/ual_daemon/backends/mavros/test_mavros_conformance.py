"""The conformance checks through MAVROS: PX4 with ROS 2, ArduCopter with ROS 1, by the class and over gRPC."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.patient_checks import grouped, run_check_or_skip, served, wait_until_ready
from tests.simulators.lockstep_mavros import LockstepMavrosArduPilot, LockstepMavrosPx4
from tests.ual_daemon.backends.mavlink.test_autopilot_conformance import LIMIT_M_S, TOLERANCES, is_known
from tests.ual_daemon.backends.mavlink.test_autopilot_conformance import NOT_HERE as NOT_OVER_MAVLINK
from ual import conformance
from ual.conformance import Check, Flight
from ual.interface import Uav
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.settings import LimitSettings, VehicleSettings

BACKENDS = {"px4": LockstepMavrosPx4, "ardupilot": LockstepMavrosArduPilot}
NOT_HERE = {kind: names | {"bad_poses_from_outside_are_refused"} for kind, names in NOT_OVER_MAVLINK.items()}
Make = Callable[[ExitStack, str, Path], Uav]


def over_class(stack: ExitStack, kind: str, _: Path) -> Uav:
    settings = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=LIMIT_M_S))
    return stack.enter_context(UAL(BACKENDS[kind](BackendOptions("uav_1")), settings=settings))


def over_grpc(stack: ExitStack, kind: str, directory: Path) -> Uav:
    return served(stack, directory, f"lockstep_mavros_{kind}", "--set", f"limits.horizontal_speed_m_s={LIMIT_M_S}")


@pytest.fixture(scope="module", params=[grouped(make, f"mavros_{make.__name__}") for make in (over_class, over_grpc)])
def make(request: pytest.FixtureRequest) -> Make:
    made: Make = request.param
    return made


@pytest.fixture(scope="module", params=[grouped(kind, f"mavros_{kind}") for kind in BACKENDS])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def flight(kind: str, make: Make, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Flight]:
    with ExitStack() as stack:
        uav = make(stack, kind, tmp_path_factory.mktemp("ual"))
        wait_until_ready(uav, is_known)
        yield Flight(uav, TOLERANCES)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: Flight, check: Check, kind: str) -> None:
    run_check_or_skip(flight, check, NOT_HERE[kind], flight.uav.recover_from_manual)
