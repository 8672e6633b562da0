"""The conformance checks through MAVROS: PX4 with ROS 2, ArduCopter with ROS 1, by the class and over gRPC."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess
from tests.patient_checks import PatientFlight, run_check
from tests.simulators.lockstep_mavros import LockstepMavrosArduPilot, LockstepMavrosPx4
from tests.ual_daemon.backends.mavlink.test_autopilot_conformance import (
    LIMIT_M_S,
    TOLERANCES,
    grouped,
)
from tests.ual_daemon.backends.mavlink.test_autopilot_conformance import NOT_HERE as NOT_OVER_MAVLINK
from ual import _discovery, conformance
from ual.conformance import Check
from ual.conformance.flight import CannotRunError
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
    limit = f"limits.horizontal_speed_m_s={LIMIT_M_S}"
    flags = ("--backend", f"lockstep_mavros_{kind}", "--listen", "127.0.0.1:0", "--set", limit)
    environment = {_discovery.RUNTIME_DIR_VARIABLE: str(directory)}
    daemon = DaemonProcess(flags, "uav_1", environment, module="tests.simulators.daemon")
    stack.callback(daemon.close)
    return stack.enter_context(ual.Uav(address=daemon.address))


@pytest.fixture(scope="module", params=[grouped(make, f"mavros_{make.__name__}") for make in (over_class, over_grpc)])
def make(request: pytest.FixtureRequest) -> Make:
    made: Make = request.param
    return made


@pytest.fixture(scope="module", params=[grouped(kind, f"mavros_{kind}") for kind in BACKENDS])
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def flight(kind: str, make: Make, tmp_path_factory: pytest.TempPathFactory) -> Iterator[PatientFlight]:
    with ExitStack() as stack:
        uav = make(stack, kind, tmp_path_factory.mktemp("ual"))
        deadline_s = time.monotonic() + LIMIT_S
        while not uav.is_ready() or not uav.info().autopilot_version or uav.info().limits.climb_speed_m_s < 2.0:
            assert time.monotonic() < deadline_s, uav.telemetry()
            time.sleep(0.02)
        yield PatientFlight(uav, TOLERANCES)


@pytest.mark.parametrize("check", conformance.CHECKS, ids=lambda check: check.name)
def test_conformance(flight: PatientFlight, check: Check, kind: str) -> None:
    try:
        run_check(flight, check)
    except CannotRunError:
        assert check.name in NOT_HERE[kind]
        pytest.skip("not with this autopilot: see NOT_HERE")
    except ual.NotSupportedError:
        assert check.name in NOT_HERE[kind]
        flight.uav.recover_from_manual()
        pytest.skip("not with this autopilot: see NOT_HERE")
