"""The conformance checks on real autopilots in simulation, through the class and over gRPC to a daemon.

They are flown twice over: by a daemon that may not arm, with the safety pilot, as real UAVs are. And those that this
leaves out by one that may, with a limit of speed that is soon reached.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, cast

import pytest

import ual
from tests.conftest import LIMIT_S, DaemonProcess
from tests.patient_checks import without
from tests.sitl.copter_pilot import CopterPilot
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Sticks, Transmitter
from tests.waiting import until
from ual import conformance, discovery
from ual.conformance import Check, Flight, Need, Tolerances
from ual.conformance.flight import CannotRunError
from ual.errors import NotSupportedError
from ual.interface import Simulation, Uav
from ual.simulation import SimulationPart
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.mavlink import MavlinkBackend
from ual_daemon.settings import LimitSettings, VehicleSettings

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

SLOW_M_S = 2.5
"""Slow enough that a check may fly it to its limit."""
ONLY_SLOW = "scales_a_velocity_down"
WITHOUT_PILOT = ("arms_and_disarms", "ground_commands_are_refused_in_flight", ONLY_SLOW, "lands")
"""Checks for a daemon that may arm: those that need it, those that it answers otherwise, and a landing."""
WITH_PILOT = [check for check in conformance.CHECKS if Need.ARMING not in check.needs and check.name != ONLY_SLOW]
OF_WHAT_MAY_BE_ABSENT = without("corrections", "fence", "missions", "parameters")
"""A simulator carries what its version has."""
CANNOT_GIVE_BACK = "PX4's pilot cannot give back: PX4 takes OFFBOARD only while setpoints come"


class PilotAtHand(Simulation):
    """The safety pilot as `ual.interface.Simulation`; nothing else of a simulation is offered."""

    def __init__(self, pilot: Transmitter) -> None:
        self._pilot = pilot

    def parts(self) -> frozenset[SimulationPart]:
        return frozenset((SimulationPart.PILOT,))

    def pilot_arm(self) -> None:
        self._pilot.wait_until_ready()
        self._pilot.arm()

    def pilot_disarm(self) -> None:
        self._pilot.disarm()

    def pilot_take_over(self) -> None:
        self._pilot.stand_by()
        self._pilot.take_over()

    def pilot_move_sticks(self, *, forward: float = 0.0, left: float = 0.0, up: float = 0.0, turn: float = 0.0) -> None:
        self._pilot.sticks = Sticks(forward, -left, up, -turn)

    def pilot_give_back(self) -> None:
        if not isinstance(self._pilot, CopterPilot):
            raise NotSupportedError(CANNOT_GIVE_BACK)
        self._pilot.stand_by()


class WithPilot:
    """A UAV and its safety pilot; a `ual.interface.Uav`."""

    def __init__(self, uav: Uav, pilot: Transmitter) -> None:
        self._uav = uav
        self.simulation = PilotAtHand(pilot)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._uav, name)


def over_class(stack: ExitStack, url: str, limits: dict[str, float], is_arming: bool, _: Path) -> Uav:
    settings = VehicleSettings(limits=LimitSettings(**limits))
    backend = MavlinkBackend(BackendOptions("uav_1", url))
    return stack.enter_context(UAL(backend, settings=settings, allow_arming=is_arming))


def over_grpc(stack: ExitStack, url: str, limits: dict[str, float], is_arming: bool, directory: Path) -> Uav:
    flags = ["--backend", "mavlink", "--url", url, "--listen", "127.0.0.1:0", *["--allow-arming"] * is_arming]
    flags += [f"--set=limits.{name}={value}" for name, value in limits.items()]
    daemon = DaemonProcess(tuple(flags), "uav_1", {discovery.RUNTIME_DIR_VARIABLE: str(directory)})
    stack.callback(daemon.close)
    return stack.enter_context(ual.Uav(address=daemon.address))


Connect = Callable[[ExitStack, str, dict[str, float], bool, Path], Uav]


@pytest.fixture(scope="class", params=[over_class, over_grpc], ids=lambda connect: str(connect.__name__))
def connect(request: pytest.FixtureRequest) -> Connect:
    connect: Connect = request.param
    return connect


@contextmanager
def flying(uav: Uav) -> Iterator[Flight]:
    """The flight of the checks; in the end it has landed and is disarmed."""
    until(
        lambda: uav.is_ready() and uav.info().is_simulation and uav.telemetry().position_geo,
        "what the checks need to know",
        seen=uav.telemetry,
        limit_s=LIMIT_S,
    )
    flight = Flight(uav, Tolerances())
    try:
        yield flight
    finally:
        with flight.observing():
            flight.bring_to([State.LANDED_DISARMED])


def run_check(flight: Flight, check: Check, expected: Sequence[type[Exception]] = ()) -> None:
    """Runs it; it may be skipped only as expected, and where it is of a device or a log that is not there."""
    if check.name in OF_WHAT_MAY_BE_ABSENT:
        expected = (*expected, CannotRunError)
    try:
        conformance.run_check(flight, check)
    except (CannotRunError, NotSupportedError) as error:
        if type(error) not in expected:
            raise
        pytest.skip(str(error))


@pytest.fixture(scope="class")
def piloted(
    url: str, pilot: Transmitter, connect: Connect, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Flight]:
    with ExitStack() as stack:
        uav = connect(stack, url, {}, False, tmp_path_factory.mktemp("ual"))
        yield stack.enter_context(flying(cast("Uav", WithPilot(uav, pilot))))


@pytest.fixture(scope="class")
def permitted(
    url: str, pilot: Transmitter, connect: Connect, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Flight]:
    pilot.wait_until_ready()
    with ExitStack() as stack:
        uav = connect(stack, url, {"horizontal_speed_m_s": SLOW_M_S}, True, tmp_path_factory.mktemp("ual"))
        yield stack.enter_context(flying(uav))


class TestWithTheSafetyPilot:
    @pytest.mark.parametrize("check", WITH_PILOT, ids=lambda check: check.name)
    def test_conformance(self, piloted: Flight, check: Check, simulator: Simulator) -> None:
        gives_back = check.name == "the_pilot_flies_and_gives_back"
        run_check(piloted, check, [NotSupportedError] if gives_back and simulator.autopilot == "PX4" else [])


class TestWithThePermissionToArm:
    @pytest.mark.parametrize(
        "check", [check for check in conformance.CHECKS if check.name in WITHOUT_PILOT], ids=lambda check: check.name
    )
    def test_conformance(self, permitted: Flight, check: Check) -> None:
        run_check(permitted, check)
