"""Effects of the autopilots' parameters in flight: their cruise, and the time for which PX4 waits for setpoints."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.conftest import LIMIT_S
from tests.simulators.px4 import OFFBOARD, RTL, Px4
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.errors import UalError

Fly = Callable[..., Flight]


@pytest.fixture
def fly() -> Iterator[Fly]:
    """Starts the flight of a PX4 with these parameters, 3 m above the ground."""
    flights: list[Flight] = []

    def started(**parameters: float) -> Flight:
        flight = Flight("px4")
        flights.append(flight)
        flight.kill()
        flight.autopilot.parameters.update(parameters)
        flight.start()
        flight.take_off()
        return flight

    yield started
    for flight in flights:
        flight.uav.close()


def px4_of(flight: Flight) -> Px4:
    assert isinstance(flight.autopilot, Px4)
    return flight.autopilot


def fastest_m_s(flight: Flight, max_speed_m_s: float | None = None) -> float:
    began_s = flight.now_s
    flight.uav.go_to_waypoint(flight.goal(60.0, 0.0), max_speed_m_s=max_speed_m_s)
    speeds = [each.velocity.linear.norm() for at_s, each in list(flight.seen) if at_s >= began_s and each.velocity]
    return max(speeds)


def test_a_goal_is_executed_at_the_cruise_of_the_autopilot_unless_another_speed_is_requested(fly: Fly) -> None:
    flight = fly(MPC_XY_CRUISE=5.0)
    flight.wait_for(lambda: flight.backend.info().cruise_speed_m_s == 5.0, "its cruise")
    assert flight.uav.info().limits.horizontal_speed_m_s == 12.0
    assert fastest_m_s(flight) == pytest.approx(5.0, abs=0.4)
    flight.uav.go_to_waypoint(flight.goal(-60.0, 0.0))
    assert fastest_m_s(flight, 8.0) == pytest.approx(8.0, abs=0.5)
    began_s = flight.now_s
    flight.uav.follow_path([flight.goal(-60.0, 0.0), flight.goal(-60.0, 60.0)], leg_speeds_m_s=[0.0, 7.0])
    along = [(each.velocity.linear, at_s) for at_s, each in list(flight.seen) if at_s >= began_s and each.velocity]
    assert max(-velocity.x for velocity, _ in along) == pytest.approx(5.0, abs=0.4)
    assert max(velocity.y for velocity, _ in along) == pytest.approx(7.0, abs=0.5)


@pytest.mark.parametrize("kind", ["the daemon", "the link"])
def test_px4_is_not_pulled_back_after_a_pause_that_was_too_long_for_it(fly: Fly, kind: str) -> None:
    flight = fly(COM_OF_LOSS_T=0.3)
    flight.wait_for(lambda: flight.backend.freshness.link_s < 0.31, "its limit")
    task = flight.uav.go_to_waypoint(flight.goal(50.0, 0.0), blocking=False)
    flight.let_pass(1.0)
    with flight.autopilot.lock:
        began_s = flight.now_s
        if kind == "the daemon":
            flight.backend.connection.pause_s = 0.6
        else:
            flight.link.down = flight.link.up = type(flight.link.down)(is_silent=True)
    if kind == "the link":
        flight.let_pass(0.6)
        flight.link.down = flight.link.up = type(flight.link.down)()
    with pytest.raises(UalError):
        task.wait(LIMIT_S)
    flight.let_pass(2.0)
    assert px4_of(flight).intention == OFFBOARD  # setpoints would bring it back at once
    assert px4_of(flight).mode == RTL
    assert [each for each in flight.autopilot.setpoints_s if each > began_s + 0.5] == []
