"""A log is read while the UAV flies: whole, and no setpoint comes later because of it."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator

import pytest

from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight, UsualRates
from ual.types import State

CONTENT = random.Random(4).randbytes(150_000)
LATER_S = 0.02
"""No setpoint may come so much later than without a download. The simulation has steps of 10 ms."""


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = UsualRates(request.param)
    files = flight.autopilot.files
    files.files[f"{files.directory}/00000001.BIN"] = CONTENT
    flight.wait_for_state(State.LANDED_DISARMED)
    flight.wait_for(lambda: flight.backend.info().autopilot_version != "", "its version")
    flight.take_off()
    yield flight
    flight.uav.close()


def longest_gap_s(flight: Flight, begin_s: float, end_s: float) -> float:
    """Between two setpoints, as they reach the autopilot."""
    times_s = [each for each in list(flight.autopilot.setpoints_s) if begin_s <= each <= end_s]
    assert len(times_s) > 20
    return max(after - before for before, after in itertools.pairwise(times_s))


def test_no_setpoint_is_later_while_a_log_is_read(flight: Flight) -> None:
    task = flight.uav.go_to_waypoint(flight.goal(400.0, 0.0), max_speed_m_s=4.0, blocking=False)
    flight.let_pass(3.0)
    begin_s = flight.now_s
    flight.let_pass(5.0)
    usual_s = longest_gap_s(flight, begin_s, flight.now_s)
    [log] = flight.uav.logs.get_all()
    begin_s = flight.now_s
    chunks = list(flight.uav.logs.download(log.id))
    read_s = flight.now_s
    assert b"".join(each.data for each in chunks) == CONTENT
    flight.let_pass(8.0)
    assert longest_gap_s(flight, begin_s, read_s) <= usual_s + LATER_S + 1e-6
    assert longest_gap_s(flight, read_s, flight.now_s) <= usual_s + LATER_S + 1e-6
    assert flight.uav.state() is State.FLYING_AUTO
    task.cancel()


def test_the_streams_have_their_usual_rates_before_and_after(flight: Flight) -> None:
    [channel] = flight.autopilot.channels
    usual = dict(channel.intervals_s)
    [log] = flight.uav.logs.get_all()
    during = dict(channel.intervals_s)
    list(flight.uav.logs.download(log.id))
    is_slowed = flight.autopilot.files_slow_streams > 1.0
    assert (during != usual) is is_slowed
    flight.wait_for(lambda: channel.intervals_s == usual, "the usual rates")
    flight.let_pass(20.0)
    assert channel.intervals_s == usual


def test_a_log_that_has_grown_since_it_was_read_is_read_to_its_new_end(flight: Flight) -> None:
    files = flight.autopilot.files
    [log] = flight.uav.logs.get_all()
    *_, last = flight.uav.logs.download(log.id, len(CONTENT) - 1000)
    assert last.sha256
    files.files[f"{files.directory}/00000001.BIN"] = grown = CONTENT + CONTENT[:50_001]
    begin = len(CONTENT) - 100
    assert b"".join(each.data for each in flight.uav.logs.download(log.id, begin)) == grown[begin:]
