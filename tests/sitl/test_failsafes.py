"""Failsafes of real autopilots in simulation: each is named, and only force overrides it."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from tests.sitl.flights import HEIGHT_M, PATIENCE_S, Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.troubles import CAUSES, trouble
from tests.sitl.wiretap import Wiretap
from ual.errors import RejectedByAutopilotError, TaskAbortedError, WrongStateError
from ual.types import Health, State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

FAR_M = 40.0
LATE_S = 1.0
"""An autopilot acts on its own sensors; the daemon's task must end so soon after the mode has changed."""


@pytest.fixture
def flight(flight: Flight) -> Iterator[Flight]:
    """Whoever flies it at the end of a test, it lands."""
    yield flight
    flight.wait_for(flight.uav.is_ready, "a state")
    flight.wait_for(lambda: is_taken_back(flight), "the control")


def is_taken_back(flight: Flight) -> bool:
    """Takes control back from a failsafe; an autopilot that has just found its position refuses that for a while."""
    if flight.uav.state() is State.FLYING_MANUAL:
        try:
            flight.uav.recover_from_manual(force=True)
        except RejectedByAutopilotError:
            return False
    return True


def health(uav: UAL) -> Health:
    found = uav.telemetry().health
    assert found is not None
    return found


@pytest.mark.parametrize("cause", CAUSES)
def test_a_failsafe_in_flight_is_named_and_ended_by_force_only(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator, pilot: Transmitter, cause: str
) -> None:
    """The recipe: battery, transmitter and fence were all "taken by the safety pilot", and `recover` cancelled them."""
    flight.take_off()
    task = uav.go_to_waypoint(flight.beside(FAR_M), blocking=False)
    flight.wait_for_speed(1.0)
    with trouble(pilot, simulator.autopilot, cause):
        with pytest.raises(TaskAbortedError, match=cause) as caught:
            task.wait(PATIENCE_S)
        ended_s = time.monotonic()
        assert caught.value.metadata["by"] == cause
        assert uav.state() in (State.FLYING_MANUAL, State.LANDING)
        assert health(uav).held_by == cause
        with pytest.raises(WrongStateError, match=cause) as refused:
            uav.recover_from_manual()
        assert refused.value.metadata["needed"] == "force"
        time.sleep(LATE_S)  # that nothing is sent shows only in time
        assert wiretap.setpoints(ended_s) == 0
        assert wiretap.orders(ended_s) == []
        assert uav.telemetry().flight_mode != simulator.references_name
        uav.recover_from_manual(force=True)
        assert uav.state() is State.FLYING_AUTO
        uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)


def test_a_lost_position_ends_the_task_and_is_told_and_nothing_is_sent_into_it(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator, pilot: Transmitter
) -> None:
    """The estimator's failsafe: UAL has no position to fly by, until it is good again."""
    flight.take_off()
    task = uav.go_to_waypoint(flight.beside(-80.0), max_speed_m_s=2.0, blocking=False)
    flight.wait_for_speed(1.0)
    with trouble(pilot, simulator.autopilot, "position failsafe"):
        with pytest.raises(TaskAbortedError) as caught:
            task.wait(PATIENCE_S)
        ended_s = time.monotonic()
        print(f"{simulator.autopilot} without GPS: {caught.value}; {uav.telemetry().state_reason}")
        assert caught.value.metadata["by"] in ("autopilot", "position failsafe")
        flight.wait_for(lambda: health(uav).held_by == "position failsafe", "its failsafe")
        assert wiretap.setpoints(ended_s) == 0
        assert wiretap.orders(ended_s) == []
    flight.wait_for(lambda: uav.state() is not State.UNINITIALIZED, "its position")


def test_no_take_off_into_a_failsafe(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator, pilot: Transmitter
) -> None:
    """The recipe: with the transmitter off on the ground it took off without a safety pilot."""
    flight.be_armed()
    with trouble(pilot, simulator.autopilot, "rc failsafe"):
        flight.wait_for(lambda: health(uav).failsafe == "rc failsafe", "its failsafe", 5.0)
        since_s = time.monotonic()
        with pytest.raises(WrongStateError):
            uav.take_off(HEIGHT_M)
        assert wiretap.orders(since_s) == []
    flight.wait_for_state(State.LANDED_DISARMED)
