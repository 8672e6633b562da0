"""Simulated autopilots whose position loses its source in flight: told before they do, and tasks wait for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.ual_daemon.backends.mavlink.test_autopilot_external_poses import MotionCapture, OutdoorFlight, started
from ual.types import State, Telemetry

AWAY_M = 40.0
GONE = "no satellite fix (NONE), and the position drifts"
ENDED = "no poses come from outside any more, and the position drifts"


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[OutdoorFlight]:
    with started(str(request.param), OutdoorFlight) as flight:
        flight.wait_for(flight.uav.is_ready, "a state")
        yield flight


def first_told_s(flight: OutdoorFlight, since_s: float, text: str) -> float:
    """After how long all tell a text: the reason of the state and the checks that fail."""

    def tells(told: Telemetry) -> bool:
        health = told.health
        checks = () if health is None else health.failing_checks
        return text in told.state_reason and any(text in each for each in checks)

    def found() -> list[float]:
        return [at_s for at_s, told in list(flight.seen) if at_s > since_s and tells(told)]

    flight.wait_for(lambda: bool(found()), text)
    return found()[0] - since_s


def fly_off(flight: OutdoorFlight, lose: Callable[[], None], find: Callable[[], None], text: str) -> float:
    """Loses its source on the way, for 3 s: the go-to waits. Returns after how long that was told."""
    uav = flight.uav
    here = uav.pose().pose
    goal = here.position + (here.orientation.rotate(type(here.position)(AWAY_M, 0.0, 0.0)))
    task = uav.go_to_waypoint(type(here)(goal, here.orientation), blocking=False)
    flight.wait_for(lambda: uav.velocity().twist.linear.horizontal_norm() > 2.0, "its speed")
    lost_s = flight.now_s
    lose()
    told_s = first_told_s(flight, lost_s, text)
    assert f"waits: {text}" in task.info().description
    flight.wait_for(lambda: uav.velocity().twist.linear.horizontal_norm() < 0.2, "standing still")
    assert not task.done()
    assert uav.state() is State.FLYING_AUTO
    find()
    flight.wait_for(task.done, "its arrival")
    task.wait()
    assert "waits" not in task.info().description
    return told_s


def test_a_go_to_waits_while_the_fix_of_satellites_is_lost(flight: OutdoorFlight) -> None:
    flight.take_off()
    flight.let_pass(2.0)
    told_s = fly_off(flight, flight.autopilot.lose_gps, flight.autopilot.find_gps, GONE)
    assert told_s < 1.0


def test_a_go_to_waits_while_the_poses_from_outside_have_ended(flight: OutdoorFlight) -> None:
    source = MotionCapture(flight)
    flight.autopilot.lose_gps()
    flight.let_pass(3.0)
    flight.take_off()

    def switch(is_on: bool) -> Callable[[], None]:
        return lambda: setattr(source, "is_on", is_on)

    assert fly_off(flight, switch(False), switch(True), ENDED) < 0.6
