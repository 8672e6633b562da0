"""Returning home, pausing and holding with simulated autopilots, in the vehicle's time."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.conftest import LIMIT_S
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, Flight
from ual.errors import TaskAbortedError, WrongStateError
from ual.geometry import Vector3
from ual.interface import Task
from ual.types import State, TaskKind, TaskStatus, Telemetry

LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    yield flight
    flight.uav.close()


def away_m(flight: Flight, home: Vector3) -> float:
    return (flight.uav.pose().pose.position - home).horizontal_norm()


def test_it_returns_to_the_autopilots_home_and_takes_off_again(flight: Flight) -> None:
    flight.take_off()
    home = flight.uav.pose().pose.position
    flight.uav.go_to_waypoint(flight.goal(12.0, -9.0))
    begun_s = flight.now_s
    again: list[Task] = []

    def take_off_again() -> None:
        again.append(flight.uav.take_off(HEIGHT_M, blocking=False))

    # At once, while it is still armed: in the update that ends its return.
    flight.when(lambda told: told.state is State.LANDED_ARMED and told.task is None, take_off_again)
    task = flight.uav.return_to_launch(6.0)
    info = task.info()
    assert info.status is TaskStatus.SUCCEEDED
    assert "the autopilot's home at 6." in info.description.replace("5.9", "6.0")
    assert away_m(flight, home) < 0.5
    assert flight.states_since(begun_s)[:2] == [State.FLYING_AUTO, State.LANDING]
    heights = [t.pose.position.z for time_s, t in list(flight.seen) if time_s >= begun_s and t.pose is not None]
    assert max(heights) == pytest.approx(home.z - HEIGHT_M + 6.0, abs=0.5)
    flight.wait_for(lambda: bool(again), "its take-off")
    again[0].wait(LIMIT_S)
    flight.wait_for_state(State.FLYING_AUTO)
    flight.land()
    with pytest.raises(WrongStateError, match="arm it before"):
        flight.uav.take_off(HEIGHT_M)


def test_a_new_daemon_that_has_not_observed_the_take_off_returns_home(flight: Flight) -> None:
    flight.take_off()
    home = flight.uav.pose().pose.position
    flight.uav.go_to_waypoint(flight.goal(8.0, 0.0))
    flight.kill()
    flight.start()
    flight.wait_for_state(State.FLYING_AUTO)
    flight.wait_for(lambda: flight.backend.snapshot().earth.home_geo is not None, "its home")
    flight.wait_for(lambda: flight.backend.snapshot().earth.projection is not None, "its origin")
    flight.uav.return_to_launch(HEIGHT_M + 1.0)
    assert away_m(flight, home) < 0.5


def test_the_pilot_takes_over_during_the_return_and_in_the_landing(flight: Flight) -> None:
    flight.take_off()
    for state in (State.FLYING_AUTO, State.LANDING):
        flight.uav.go_to_waypoint(flight.goal(6.0, 0.0))

        def is_moment(telemetry: Telemetry, state: State = state) -> bool:
            task, velocity = telemetry.task, telemetry.velocity
            is_returning = task is not None and task.kind is TaskKind.RETURN_TO_LAUNCH
            return is_returning and telemetry.state is state and velocity is not None and velocity.linear.norm() > 0.5

        flight.when(is_moment, flight.autopilot.pilot_take_over)
        task = flight.uav.return_to_launch(4.0, blocking=False)
        with pytest.raises(TaskAbortedError, match="the safety pilot took over"):
            task.wait(LIMIT_S)
        flight.wait_for_state(State.FLYING_MANUAL)
        flight.uav.recover_from_manual()
    flight.land()


def test_a_path_with_a_hold_is_paused_twice_and_completed(flight: Flight) -> None:
    flight.take_off()
    uav, corner, end = flight.uav, flight.goal(10.0, 0.0), flight.goal(10.0, 10.0)
    started_s = flight.now_s
    task = uav.follow_path([corner, end], holds_s=[5.0, 0.0], blocking=False)
    for is_there in (2.0, 9.9):  # on the first leg, and in the hold
        flight.wait_for(lambda x=is_there: away_m(flight, end.position - Vector3(10.0, 10.0, 0.0)) > x, "the way")  # type: ignore[misc]
        uav.pause()
        flight.let_pass(6.0)
        held = uav.pose().pose.position
        flight.let_pass(10.0)
        assert (uav.pose().pose.position - held).norm() < 0.2
        assert abs(held.y - corner.position.y) < 0.4
        assert task.info().is_paused
        uav.resume()
    assert task.wait(LIMIT_S).status is TaskStatus.SUCCEEDED
    assert (uav.pose().pose.position - end.position).norm() < 0.6
    assert flight.now_s - started_s > 2 * 16.0 + 5.0
    flight.land()
