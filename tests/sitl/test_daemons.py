"""Daemons as real processes with real autopilots in simulation: killed in flight, and three for one client."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from urllib.parse import urlsplit

import pytest

import ual
from tests.conftest import StartDaemon
from tests.sitl.flights import HEIGHT_M, Flight
from tests.sitl.pilot import SafetyPilot
from tests.sitl.simulators import PX4, Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.wiretap import Wiretap
from ual.types import State
from ual_daemon import UAL
from ual_daemon.backends.mavlink.settings import default_url

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(400)]

COUNT_VARIABLE = "UAL_TEST_PX4_COUNT"
KNOWN_S = 2.0
"""By then a daemon that is started in flight must know the state."""
DEAD_S = (0.0, 1.5, 4.0)
"""Seconds without a daemon: PX4 leaves OFFBOARD after 1 s, ArduPilot stops after 3."""
PILOT_HEARS_S = 2.0
"""By then the pilot knows a mode, which PX4 reports once a second: it may just be leaving OFFBOARD."""


@pytest.fixture
def landed_in_the_end(wiretap: Wiretap, pilot: Transmitter) -> Iterator[None]:
    """It lands when the daemons are gone, however they ended."""
    yield
    with UAL("mavlink", "uav_1", url=wiretap.url) as uav:
        flight = Flight(uav, pilot)
        flight.wait_for(uav.is_ready, "a state")
        flight.end()


@pytest.mark.usefixtures("landed_in_the_end")
def test_a_daemon_that_is_killed_in_flight_is_followed_by_one_that_tells_the_truth_and_asks_for_nothing(
    wiretap: Wiretap, pilot: Transmitter, simulator: Simulator, start_daemon: StartDaemon
) -> None:
    daemon = start_daemon("--url", wiretap.url, backend="mavlink")
    with ual.Uav(address=daemon.address) as uav:
        Flight(uav, pilot).take_off()
    for number, dead_s in enumerate(DEAD_S):
        with ual.Uav(address=daemon.address) as uav:
            flight = Flight(uav, pilot)
            uav.go_to_waypoint(flight.offset(-40.0 if number % 2 else 40.0), blocking=False)
            flight.wait_for_speed(2.0)
            daemon.signal(signal.SIGKILL)
            daemon.wait()
        time.sleep(dead_s)
        started_s = time.monotonic()
        daemon = start_daemon("--url", wiretap.url, backend="mavlink")
        told = daemon.wait_for("state")
        if told["new"] == State.UNINITIALIZED.name:
            told = daemon.wait_for("state", after=told)
        known_s = time.monotonic() - started_s
        print(f"{simulator.autopilot} killed, dead for {dead_s:g} s: {told['new']} ({told['why']}) in {known_s:.2f} s")
        assert known_s < KNOWN_S, daemon.stderr
        is_ours = told["new"] == State.FLYING_AUTO.name
        assert is_ours or told["new"] == State.FLYING_MANUAL.name
        with ual.Uav(address=daemon.address) as uav:
            flight = Flight(uav, pilot)
            flight.wait_for(partial(_is_reported, pilot, simulator, is_ours), "what the pilot hears", PILOT_HEARS_S)
            time.sleep(1.5)  # that nothing is ordered shows only in time
            assert wiretap.orders(started_s) == []
            if uav.state() is State.FLYING_MANUAL:
                uav.recover_from_manual()
            assert uav.state() is State.FLYING_AUTO
    with ual.Uav(address=daemon.address) as uav:
        uav.land()
        Flight(uav, pilot).wait_for_state(State.LANDED_DISARMED)


def _is_reported(pilot: Transmitter, simulator: Simulator, is_ours: bool) -> bool:
    """Returns whether the pilot has heard that it flies by references, or that it does not."""
    return (pilot.mode == simulator.references_mode) is is_ours


@pytest.fixture
def pilots(pilot: Transmitter, simulator: Simulator) -> Iterator[list[Transmitter]]:
    """The pilots of as many PX4 as there are, the first one's among them."""
    count = int(os.environ.get(COUNT_VARIABLE, "1"))
    if count < 2:
        pytest.skip(f"one PX4 only: set {COUNT_VARIABLE}=3 (the instances after the first)")
    parts = urlsplit(simulator.pilot_url())
    assert parts.hostname is not None
    assert parts.port is not None
    with ExitStack() as stack:
        others = [SafetyPilot(parts.hostname, parts.port + number) for number in range(1, count)]
        for other in others:
            stack.callback(other.close)
        for other in others:
            other.begin()
        yield [pilot, *others]


@pytest.mark.parametrize("simulator", [PX4], indirect=True, ids=["px4"])
def test_daemons_by_their_namespaces_fly_for_one_client(
    url: str, pilots: list[Transmitter], start_daemon: StartDaemon
) -> None:
    namespaces = [f"uav_{number}" for number in range(1, len(pilots) + 1)]
    assert url == default_url(namespaces[0])  # the daemons are told no URL
    daemons = [start_daemon(ns=ns, backend="mavlink") for ns in namespaces]
    with ExitStack() as stack:
        uavs = [
            stack.enter_context(ual.Uav(ns, address=daemon.address))
            for ns, daemon in zip(namespaces, daemons, strict=True)
        ]
        flights = [Flight(uav, pilot) for uav, pilot in zip(uavs, pilots, strict=True)]
        for flight in flights:
            flight.be_armed()
        for task in [uav.take_off(HEIGHT_M, blocking=False) for uav in uavs]:
            task.wait()
        goals = [flight.offset(2.0 * number, -2.0 * number) for number, flight in enumerate(flights, 1)]
        for task in [uav.go_to_waypoint(goal, blocking=False) for uav, goal in zip(uavs, goals, strict=True)]:
            task.wait()
        for ns, flight, goal in zip(namespaces, flights, goals, strict=True):
            assert flight.uav.ns == ns
            assert (flight.position() - goal.position).norm() < PX4.wanders_m
        for task in [uav.land(blocking=False) for uav in uavs]:
            task.wait()
        for flight in flights:
            flight.wait_for_state(State.LANDED_DISARMED)
