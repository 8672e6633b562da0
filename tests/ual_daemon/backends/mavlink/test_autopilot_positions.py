"""Simulated autopilots whose position loses its source in flight: told before they do, and tasks wait for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.ual_daemon.backends.mavlink.test_autopilot_external_poses import MotionCapture, OutdoorFlight, started
from ual.geometry import Pose, Vector3
from ual.types import State, Telemetry

AWAY_M = 40.0
GONE = "no satellite fix (NONE), and the position drifts"
ENDED = "no poses come from outside any more, and the position drifts"


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[OutdoorFlight]:
    with started(str(request.param), OutdoorFlight) as flight:
        flight.wait_for(flight.uav.is_ready, "a state")
        yield flight


def tells(told: Telemetry, text: str) -> bool:
    """Returns whether all tell a text: the reason of the state, the checks that fail, and the task."""
    checks = () if told.health is None else told.health.failing_checks
    is_waiting = told.task is not None and f"waits: {text}" in told.task.description
    return is_waiting and text in told.state_reason and any(text in each for each in checks)


def speed_m_s(told: Telemetry) -> float:
    return 0.0 if told.velocity is None else told.velocity.linear.horizontal_norm()


def fly_off(flight: OutdoorFlight, lose: Callable[[], None], find: Callable[[], None], text: str) -> float:
    """Loses its source on the way until it nearly stands: the go-to waits, and arrives. Returns when it was told.

    Both happen in updates, as a busy computer would else let more time pass than the autopilot flies without a source.
    """
    uav, lost_s = flight.uav, list[float]()
    here = uav.pose().pose
    goal = Pose(here.position + here.orientation.rotate(Vector3(AWAY_M, 0.0, 0.0)), here.orientation)

    def lose_it() -> None:
        lost_s.append(flight.now_s)
        lose()

    task = uav.go_to_waypoint(goal, blocking=False)
    flight.when(lambda told: speed_m_s(told) > 1.0, lose_it)
    flight.when(lambda told: bool(lost_s) and tells(told, text) and speed_m_s(told) < 0.5, find)
    flight.wait_for(task.done, "its arrival")
    task.wait()
    assert "waits" not in task.info().description
    after = [(at_s, told) for at_s, told in list(flight.seen) if at_s > lost_s[0]]
    assert {told.state for _, told in after} == {State.FLYING_AUTO}
    return next(at_s for at_s, told in after if tells(told, text)) - lost_s[0]


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
