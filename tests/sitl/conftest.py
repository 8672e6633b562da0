"""A real PX4 and a real ArduCopter that already run, and their safety pilots. docs/reference/backends/mavlink.md."""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.conftest import DaemonProcess, StartDaemon
from tests.sitl.flights import PATIENCE_S, Flight
from tests.sitl.simulators import ARDUPILOT, PX4, Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.truth import Truth
from tests.sitl.wiretap import Wiretap
from ual_daemon import UAL

TIMES_VARIABLE = "UAL_TEST_TIMES"
FORCE = 21196.0
"""Parameter of a disarming in the air."""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Has each flight of a real autopilot flown as often as the environment says."""
    times = int(os.environ.get(TIMES_VARIABLE, "1"))
    if times > 1 and "simulator" in metafunc.fixturenames:
        metafunc.fixturenames.append("time_number")
        metafunc.parametrize("time_number", range(times))


@pytest.fixture(scope="session", params=[PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def simulator(request: pytest.FixtureRequest) -> Simulator:
    simulator: Simulator = request.param
    return simulator


@pytest.fixture(scope="session")
def url(simulator: Simulator) -> str:
    """Address of the autopilot's link for the companion computer."""
    return simulator.url()


@pytest.fixture(scope="session")
def pilot(simulator: Simulator) -> Iterator[Transmitter]:
    """The safety pilot of the whole session: PX4 talks to the first one only; without the pilot both return home."""
    host, port = address_of(simulator.pilot_url())
    be_first_client(simulator.url())
    wait_for_port(simulator.pilot_url())
    pilot = simulator.make_pilot(host, port)
    try:
        pilot.begin()
        yield pilot
    finally:
        pilot.close()


def address_of(url: str) -> tuple[str, int]:
    parts = urlsplit(url)
    assert parts.hostname is not None
    assert parts.port is not None
    return parts.hostname, parts.port


def be_first_client(url: str) -> None:
    """Connects for a moment: ArduPilot's simulator begins, and opens its other ports, with the first client of 5760."""
    if url.startswith("tcp:"):
        with contextlib.suppress(OSError), socket.create_connection(address_of(url), timeout=5.0):
            time.sleep(1.0)


def wait_for_port(url: str, limit_s: float = 10.0) -> None:
    """Returns once the port accepts connections; after the time limit anyway, as the pilot then says what is wrong."""
    if not url.startswith("tcp:"):
        return
    until_s = time.monotonic() + limit_s
    while time.monotonic() < until_s:
        try:
            socket.create_connection(address_of(url), timeout=1.0).close()
        except OSError:
            time.sleep(0.2)
        else:
            return


@pytest.fixture
def wiretap(url: str) -> Iterator[Wiretap]:
    """Between the autopilot and the program that flies it at `Wiretap.url`."""
    wiretap = Wiretap(url)
    yield wiretap
    wiretap.close()


@pytest.fixture
def uav(wiretap: Wiretap) -> Iterator[UAL]:
    uav = UAL("mavlink", "uav_1", url=wiretap.url, allow_arming=True)
    yield uav
    uav.close()


@pytest.fixture
def flight(uav: UAL, pilot: Transmitter) -> Iterator[Flight]:
    flight = Flight(uav, pilot)
    flight.wait_for(uav.is_ready, "a state")
    flight.end()  # what a test that failed has left in the air
    yield flight
    flight.end()


@pytest.fixture
def truth(pilot: Transmitter) -> Truth:
    truth = Truth(pilot)
    truth.begin_at_rest()
    return truth


@pytest.fixture
def tapped_daemon(wiretap: Wiretap, start_daemon: StartDaemon) -> DaemonProcess:
    """A daemon as a process, behind the wiretap."""
    return start_daemon("--url", wiretap.url, "--allow-arming", backend="mavlink")


@pytest.fixture
def lands_in_the_end(pilot: Transmitter) -> Iterator[None]:
    """Disarms it, wherever it lies."""
    yield
    disarm(pilot)


def disarm(pilot: Transmitter) -> None:
    """Stops its motors by force, until the autopilot tells it."""
    until_s = time.monotonic() + PATIENCE_S
    while pilot.is_armed and time.monotonic() < until_s:
        pilot.order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0, FORCE))
        time.sleep(0.5)  # until the autopilot tells it
