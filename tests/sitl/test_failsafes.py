"""Failsafes of real autopilots in simulation: each is named, and only force overrides it."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from tests.sitl.flights import HEIGHT_M, PATIENCE_S, Flight
from tests.sitl.simulators import Simulator
from tests.sitl.transmitter import Sticks, Transmitter
from tests.sitl.troubles import CAUSES, NEAR_FENCE_M, Change, changed, trouble
from tests.sitl.wiretap import Wiretap
from ual.errors import RejectedByAutopilotError, TaskAbortedError, WrongStateError
from ual.interface import Task
from ual.types import Health, State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

FAR_M = 40.0
OUT_M, BACK_M_S = 20.0, 2.0
"""Beyond the fence that comes, and still beyond it when the failsafe sets in."""
STICK = 0.6
UNAVOIDED = {"PX4": (), "ArduPilot": (Change("AVOID_ENABLE", 0.0, 3.0),)}
"""ArduPilot stops its pilot before the fence, unless it is told not to."""
LATE_S = 1.0
"""An autopilot acts on its own sensors; the daemon's task must end so soon after the mode has changed."""


@pytest.fixture
def flight(flight: Flight) -> Iterator[Flight]:
    """It lands at the end of a test in any case."""
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


def fly_back_from_afar(flight: Flight) -> Task:
    """Flies out, and begins the way back. A fence that comes then is breached already, and UAL's task leads into it.

    UAL ends a go-to that would leave a new fence (`test_a_new_fence_stops_a_go_to_before_it`), before the failsafe.
    """
    flight.uav.go_to_waypoint(flight.offset(OUT_M))
    return flight.uav.go_to_waypoint(flight.offset(-OUT_M), blocking=False, max_speed_m_s=BACK_M_S)


@pytest.mark.parametrize("cause", CAUSES)
def test_a_failsafe_in_flight_is_named_and_ended_by_force_only(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator, pilot: Transmitter, cause: str
) -> None:
    """The recipe: battery, transmitter and fence were all "taken by the safety pilot", and `recover` cancelled them."""
    flight.take_off()
    task = fly_back_from_afar(flight) if cause == "fence" else uav.go_to_waypoint(flight.offset(FAR_M), blocking=False)
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


def test_a_fence_that_the_pilot_flies_out_of_is_named(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator, pilot: Transmitter
) -> None:
    """UAL does not fence the safety pilot. The autopilot does: its failsafe is told as that, and not as the pilot's."""
    flight.take_off()
    begin = flight.position()
    with changed(pilot, UNAVOIDED[simulator.autopilot]), trouble(pilot, simulator.autopilot, "fence"):
        pilot.take_over()
        flight.wait_for_state(State.FLYING_MANUAL)
        taken_s = time.monotonic()
        pilot.sticks = Sticks(forward=STICK)
        flight.wait_for(lambda: (flight.position() - begin).horizontal_norm() > NEAR_FENCE_M - 1.0, "the fence")
        pilot.sticks = Sticks()  # it glides out; a stick that is held would end the failsafe of PX4
        flight.wait_for(lambda: health(uav).held_by == "fence", "its failsafe", 15.0)
        assert "fence" in uav.telemetry().state_reason
        with pytest.raises(WrongStateError, match="fence") as refused:
            uav.recover_from_manual()
        assert refused.value.metadata["needed"] == "force"
        assert wiretap.setpoints(taken_s) == 0
        assert wiretap.orders(taken_s) == []
        pilot.stand_by()
        if uav.state() is State.FLYING_MANUAL:
            uav.recover_from_manual(force=True)
        uav.land()
    flight.wait_for_state(State.LANDED_DISARMED)


def test_a_lost_position_ends_the_task_and_is_reported_and_nothing_is_sent_into_it(
    flight: Flight, uav: UAL, wiretap: Wiretap, simulator: Simulator, pilot: Transmitter
) -> None:
    """The estimator's failsafe: UAL has no position to fly by, until it is good again."""
    flight.take_off()
    task = uav.go_to_waypoint(flight.offset(-80.0), max_speed_m_s=2.0, blocking=False)
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
