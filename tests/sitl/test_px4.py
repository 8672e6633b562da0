"""Flights of the class interface with a real PX4 in simulation. Minutes long, in real time: `pytest -m sitl`."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.sitl.flights import (
    Flight,
    Simulator,
    arm_and_disarm,
    be_refused_to_disarm_in_the_air,
    fly_with_the_pilot_taking_over,
    restart_in_the_air,
)
from tests.sitl.pilot import SafetyPilot

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(240)]

# Its sensors wander in its simulator, and its velocity is wrong after an acceleration, by the simulator's truth.
PX4 = Simulator("PX4", "POSCTL", wanders_m=1.0, estimate_m_s=0.4)


@pytest.fixture
def flight(px4_url: str, pilot: SafetyPilot) -> Iterator[Flight]:
    flight = Flight(px4_url, pilot)
    yield flight
    flight.close()


def test_a_whole_flight_with_the_pilot_taking_over_in_the_middle(flight: Flight) -> None:
    fly_with_the_pilot_taking_over(flight, PX4)


def test_it_arms_and_disarms_where_that_is_allowed(flight: Flight) -> None:
    arm_and_disarm(flight)


def test_disarming_in_the_air_is_refused_by_the_autopilot(flight: Flight) -> None:
    be_refused_to_disarm_in_the_air(flight, "TEMPORARILY_REJECTED")


def test_a_daemon_that_is_new_in_the_middle_of_a_flight_tells_the_truth_and_can_take_over(
    flight: Flight, px4_url: str
) -> None:
    restart_in_the_air(flight, px4_url, "AUTO.LOITER")
