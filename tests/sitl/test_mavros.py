"""Real autopilots through a real MAVROS: UAL_TEST_MAVROS_PX4_URL, UAL_TEST_MAVROS_ARDUPILOT_URL say where rosbridge is.

The safety pilots have links of their own, as in the other tests here. See docs/reference/backends/mavros.md.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest
from typing_extensions import override

import ual
from tests.conftest import DaemonProcess
from tests.sitl.simulators import ARDUPILOT, PX4, Simulator
from tests.sitl.test_conformance import (
    WITH_PILOT,
    TestWithThePermissionToArm,
    WithPilot,
    flying,
    permitted,
    piloted,
    run_check,
)
from tests.sitl.transmitter import Transmitter
from tests.waiting import until_state
from ual import discovery
from ual.conformance import Check, Flight
from ual.errors import NotSupportedError
from ual.geometry import Pose
from ual.interface import Uav
from ual.types import Capability, State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavros import MavrosBackend
from ual_daemon.backends.values import Setpoint
from ual_daemon.settings import LimitSettings, VehicleSettings

__all__ = ["TestWithThePermissionToArm", "permitted", "piloted"]

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]
EXAMPLE = "rosbridge://127.0.0.1:9090"
SIMULATORS = [
    replace(PX4, url_variable="UAL_TEST_MAVROS_PX4_URL", url_example=EXAMPLE),
    replace(ARDUPILOT, url_variable="UAL_TEST_MAVROS_ARDUPILOT_URL", url_example=EXAMPLE),
]
TIMES = 20


class CountingBackend(MavrosBackend):
    """Counts the setpoints that leave."""

    sent_count = 0

    @override
    def send(self, setpoint: Setpoint) -> None:
        super().send(setpoint)
        self.sent_count += 1


def over_class(stack: ExitStack, url: str, limits: dict[str, float], is_arming: bool, _: Path) -> Uav:
    settings = VehicleSettings(limits=LimitSettings(**limits))
    backend = CountingBackend(BackendOptions("uav_1", url))
    return stack.enter_context(UAL(backend, settings=settings, allow_arming=is_arming))


def over_grpc(stack: ExitStack, url: str, limits: dict[str, float], is_arming: bool, directory: Path) -> Uav:
    flags = ["--backend", "mavros", "--url", url, "--listen", "127.0.0.1:0", *["--allow-arming"] * is_arming]
    flags += [f"--set=limits.{name}={value}" for name, value in limits.items()]
    daemon = DaemonProcess(tuple(flags), "uav_1", {discovery.RUNTIME_DIR_VARIABLE: str(directory)})
    stack.callback(daemon.close)
    return stack.enter_context(ual.Uav(address=daemon.address))


@pytest.fixture(scope="session", params=SIMULATORS, ids=["px4", "ardupilot"])
def simulator(request: pytest.FixtureRequest) -> Simulator:
    simulator: Simulator = request.param
    return simulator


@pytest.fixture(scope="class", params=[over_class, over_grpc], ids=lambda connect: str(connect.__name__))
def connect(request: pytest.FixtureRequest) -> object:
    return request.param


class TestWithTheSafetyPilot:
    @pytest.mark.parametrize(
        "check",
        [check for check in WITH_PILOT if Capability.EXTERNAL_POSE not in check.capabilities],
        ids=lambda check: check.name,
    )
    def test_conformance(self, piloted: Flight, check: Check, simulator: Simulator) -> None:
        gives_back = check.name == "the_pilot_flies_and_gives_back"
        run_check(piloted, check, [NotSupportedError] if gives_back and simulator.autopilot == "PX4" else [])


@pytest.fixture
def counting(url: str, pilot: Transmitter) -> Iterator[tuple[CountingBackend, Uav]]:
    backend = CountingBackend(BackendOptions("uav_1", url))
    with ExitStack() as stack:
        uav = WithPilot(stack.enter_context(UAL(backend)), pilot)
        stack.enter_context(flying(cast("Uav", uav)))
        yield backend, cast("Uav", uav)


def test_the_pilot_takes_over_again_and_again_and_nothing_is_sent_after(
    counting: tuple[CountingBackend, Uav],
) -> None:
    backend, uav = counting
    assert uav.simulation is not None
    uav.simulation.pilot_arm()
    until_state(uav, State.LANDED_ARMED)  # the pilot sees it before we do: MAVROS reports it at its own rate
    uav.take_off(4.0)
    for number in range(TIMES):
        uav.go_to_waypoint(Pose.at(8.0 * (number % 2), 0.0, 4.0), blocking=False)
        time.sleep(1.0)
        uav.simulation.pilot_take_over()
        until_state(uav, State.FLYING_MANUAL)
        told = backend.sent_count
        time.sleep(1.0)
        assert backend.sent_count <= told + 1
        uav.recover_from_manual()
        until_state(uav, State.FLYING_AUTO)
    uav.land()
