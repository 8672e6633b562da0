"""A real MAVROS whose bridge is cut off, stalls or loses its daemon in flight. See test_mavros."""

from __future__ import annotations

import selectors
import signal
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from urllib.parse import urlsplit

import pytest

import ual
from tests.conftest import StartDaemon
from tests.sitl.flights import Flight
from tests.sitl.simulators import Simulator
from tests.sitl.test_mavros import SIMULATORS
from tests.sitl.transmitter import Transmitter
from ual.errors import UalError
from ual.interface import Task
from ual.types import State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

LOST_S = 1.5
"""By then a bridge that says nothing shows as UNINITIALIZED."""
KNOWN_S = 4.0
"""By then a daemon knows the state, once the bridge is there again: MAVROS tells of a mode once a second."""
DEAD_S = (0.0, 1.5, 4.0)
_PIECE = 65536


class Cable:
    """Between a daemon and rosbridge: passes everything on, unless it is pulled (connections end, and new ones are
    refused) or stalls (everything waits in it).
    """

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        assert parts.hostname is not None
        assert parts.port is not None
        self._bridge = (parts.hostname, parts.port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._address = self._listener.getsockname()
        self.url = f"rosbridge://127.0.0.1:{self._address[1]}"
        self._ways: dict[socket.socket, socket.socket] = {}
        self._is_closing = self._is_stalled = False
        self._thread = threading.Thread(target=self._run, name="cable")
        self._thread.start()

    def close(self) -> None:
        self._is_closing = True
        self._thread.join()
        self._pull()

    @contextmanager
    def pulled(self) -> Iterator[None]:
        """Is pulled while the block runs."""
        self._is_closing = True
        self._thread.join()
        self._pull()
        yield
        self._is_closing = False
        self._listener = socket.create_server(self._address)
        self._thread = threading.Thread(target=self._run, name="cable")
        self._thread.start()

    @contextmanager
    def stalled(self) -> Iterator[None]:
        """Stalls while the block runs. What came meanwhile is passed on in the end."""
        self._is_stalled = True
        yield
        self._is_stalled = False

    def _pull(self) -> None:
        for each in (self._listener, *self._ways):
            each.close()
        self._ways.clear()

    def _run(self) -> None:
        while not self._is_closing:
            with selectors.DefaultSelector() as selector:
                for each in (self._listener, *self._ways):
                    selector.register(each, selectors.EVENT_READ)
                while not self._is_closing and self._pass_on(selector):
                    pass

    def _pass_on(self, selector: selectors.BaseSelector) -> bool:
        """Passes on what is there; returns whether the connections are the same as before."""
        if self._is_stalled:
            time.sleep(0.01)
            return True
        for key, _ in selector.select(0.05):
            near = key.fileobj
            assert isinstance(near, socket.socket)
            if near is self._listener:
                self._connect(near.accept()[0])
                return False
            if not self._pass_piece(near):
                self._end(near)
                return False
        return True

    def _pass_piece(self, near: socket.socket) -> bool:
        """Passes on what has come; returns whether the connection is still there."""
        try:
            data = near.recv(_PIECE)
            self._ways[near].sendall(data)
        except OSError:
            return False
        return bool(data)

    def _connect(self, near: socket.socket) -> None:
        try:
            far = socket.create_connection(self._bridge)
        except OSError:
            near.close()
            return
        self._ways |= {near: far, far: near}

    def _end(self, near: socket.socket) -> None:
        for each in (near, self._ways.pop(near)):
            self._ways.pop(each, None)
            each.close()


@pytest.fixture(scope="session", params=SIMULATORS, ids=["px4", "ardupilot"])
def simulator(request: pytest.FixtureRequest) -> Simulator:
    simulator: Simulator = request.param
    return simulator


@pytest.fixture
def cable(url: str) -> Iterator[Cable]:
    cable = Cable(url)
    yield cable
    cable.close()


@pytest.fixture
def flight(cable: Cable, pilot: Transmitter) -> Iterator[Flight]:
    with ExitStack() as stack:
        flight = Flight(stack.enter_context(UAL("mavros", "uav_1", url=cable.url)), pilot)
        flight.wait_for(flight.uav.is_ready, "a state")
        flight.end()
        yield flight
        flight.end()


def begin_go_to(flight: Flight, dx: float) -> Task:
    task = flight.uav.go_to_waypoint(flight.offset(dx), blocking=False)
    flight.wait_for_speed(1.5)
    return task


def test_a_cable_that_is_pulled_shows_and_nothing_is_ordered_when_it_is_back(
    flight: Flight, cable: Cable, pilot: Transmitter, simulator: Simulator
) -> None:
    flight.take_off()
    for number in range(3):
        task = begin_go_to(flight, -30.0 if number % 2 else 30.0)
        with cable.pulled():
            lost_s = flight.wait_for_state(State.UNINITIALIZED)
            with pytest.raises(UalError):
                task.wait(2.0)
            time.sleep(2.0)
            mode = pilot.mode
        known_s = flight.wait_for(lambda: flight.uav.state() is not State.UNINITIALIZED, "a state")
        state = flight.uav.state()
        print(
            f"{simulator.autopilot}: UNINITIALIZED after {lost_s:.2f} s; {state.name} {known_s:.2f} s after it was back"
        )
        assert lost_s < LOST_S
        assert known_s < KNOWN_S
        time.sleep(1.5)  # that nothing is ordered shows only in time
        assert pilot.mode == mode
        if flight.uav.state() is State.FLYING_MANUAL:
            flight.uav.recover_from_manual()
        assert flight.uav.state() is State.FLYING_AUTO


@pytest.mark.parametrize("stall_s", [0.5, 2.0, 5.0])
def test_a_pilot_who_takes_over_in_a_stall_keeps_control(
    flight: Flight, cable: Cable, simulator: Simulator, stall_s: float
) -> None:
    flight.take_off()
    begin_go_to(flight, 30.0)
    with cable.stalled():
        flight.pilot.take_over()
        time.sleep(stall_s)
    flight.wait_for_state(State.FLYING_MANUAL)
    mode = flight.pilot.mode
    assert mode != simulator.references_mode
    time.sleep(2.0)
    assert flight.pilot.mode == mode
    flight.uav.recover_from_manual()


def test_a_command_that_is_issued_in_a_stall_is_not_executed_once_the_pilot_has_it(
    flight: Flight, cable: Cable, simulator: Simulator
) -> None:
    flight.take_off()
    with cable.stalled():
        time.sleep(0.5)  # a command that left before a stall is executed when it ends
        try:
            flight.uav.land(blocking=False)
        except UalError as error:
            print(error)
        flight.pilot.take_over()
        time.sleep(2.0)
    flight.wait_for_state(State.FLYING_MANUAL)
    mode = flight.pilot.mode
    assert mode != simulator.references_mode
    time.sleep(3.0)
    assert flight.pilot.mode == mode
    flight.uav.recover_from_manual()


@pytest.fixture
def landed_in_the_end(url: str, pilot: Transmitter) -> Iterator[None]:
    """It lands when the daemons are gone, however they ended."""
    yield
    with UAL("mavros", "uav_1", url=url) as uav:
        flight = Flight(uav, pilot)
        flight.wait_for(uav.is_ready, "a state")
        flight.end()


@pytest.mark.usefixtures("landed_in_the_end")
def test_a_daemon_that_is_killed_in_flight_is_followed_by_one_that_takes_control_back(
    url: str, pilot: Transmitter, simulator: Simulator, start_daemon: StartDaemon
) -> None:
    daemon = start_daemon("--url", url, backend="mavros")
    with ual.Uav(address=daemon.address) as uav:
        flight = Flight(uav, pilot)
        flight.wait_for(uav.is_ready, "a state")
        flight.take_off()
    for number, dead_s in enumerate(DEAD_S):
        with ual.Uav(address=daemon.address) as uav:
            begin_go_to(Flight(uav, pilot), -30.0 if number % 2 else 30.0)
            daemon.signal(signal.SIGKILL)
            daemon.wait()
        time.sleep(dead_s)
        started_s = time.monotonic()
        daemon = start_daemon("--url", url, backend="mavros")
        with ual.Uav(address=daemon.address) as uav:
            flight = Flight(uav, pilot)
            flight.wait_for(lambda: uav.state() is not State.UNINITIALIZED, "a state")
            known_s = time.monotonic() - started_s
            print(f"{simulator.autopilot}: killed, dead for {dead_s:g} s: {uav.state().name} in {known_s:.2f} s")
            assert known_s < KNOWN_S
            time.sleep(1.5)
            if uav.state() is State.FLYING_MANUAL:
                uav.recover_from_manual()
            assert uav.state() is State.FLYING_AUTO
    daemon.signal(signal.SIGKILL)
    daemon.wait()
