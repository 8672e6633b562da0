"""Corrections of satellites beside a flight, over simulated links: what receivers get, and what setpoints notice."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import pytest

from tests.rtcm import messages
from tests.simulators import Faults
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import SILENT, Flight
from ual.types import State

LENGTHS = [25, 180, 360, 540, 720, 333, 179]


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(request.param)
    yield flight
    flight.link.up = Faults()
    flight.uav.close()


def test_they_arrive_whole_and_in_order_during_a_flight_and_no_setpoint_comes_later(flight: Flight) -> None:
    flight.take_off()
    sent, receiver, autopilot = messages(LENGTHS * 3), flight.autopilot.receiver, flight.autopilot
    task = flight.uav.go_to_waypoint(flight.goal(12.0, 0.0), blocking=False)
    flight.let_pass(1.0)
    without_s = longest_gap_s(autopilot.setpoints_s, flight.now_s - 0.9)
    began_s = flight.now_s
    status = flight.uav.corrections.stream(iter(sent), "a base")
    flight.wait_for(lambda: receiver.messages == sent, "the messages")
    assert longest_gap_s(autopilot.setpoints_s, began_s) <= without_s + 1e-6
    assert b"".join(receiver.pieces) == b"".join(sent)
    assert status.dropped_count == status.skipped_bytes_count == 0
    gps = flight.uav.telemetry().gps
    assert gps is not None
    assert gps.corrections_age_s is not None
    task.wait(60.0)


def longest_gap_s(times_s: list[float], after_s: float) -> float:
    kept = [each for each in list(times_s) if each >= after_s]
    return max(b - a for a, b in pairwise(kept))


def test_those_for_a_lost_link_are_dropped_and_counted_and_new_ones_arrive_later(flight: Flight) -> None:
    flight.wait_for_state(State.LANDED_DISARMED)
    first, second = messages([300, 400])
    flight.link.down = SILENT
    flight.wait_for(lambda: flight.uav.state() is State.UNINITIALIZED, "the lost link")
    flight.uav.corrections.stream([first])
    flight.wait_for(lambda: flight.uav.corrections.status().dropped_count == 1, "the drop")
    flight.link.down = Faults()
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.uav.corrections.stream([second])
    flight.wait_for(lambda: flight.autopilot.receiver.messages == [second], "the message")
