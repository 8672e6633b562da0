"""The floor and the ceiling with the simulated autopilots: nothing configured, over MAVLink."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ual_daemon.backends.mavlink.test_autopilot_flights import HEIGHT_M, Flight
from ual.errors import GeofenceError
from ual.geometry import Pose, Twist, Vector3
from ual.types import State


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    yield flight
    flight.uav.close()


def test_a_take_off_and_goals_beyond_the_floor_and_the_ceiling_are_refused(flight: Flight) -> None:
    uav = flight.uav
    flight.wait_for_state(State.LANDED_DISARMED)
    assert flight.autopilot.pilot_arm()
    flight.wait_for_state(State.LANDED_ARMED)
    with pytest.raises(GeofenceError, match="ceiling_m: 120"):
        uav.take_off(9.9e6)
    uav.take_off(HEIGHT_M)
    for z, named in ((-5.0, "floor_m: 0, clearance_m: 0.5 in the configuration; z is up"), (150.0, "ceiling_m: 120")):
        with pytest.raises(GeofenceError, match=named):
            uav.go_to_waypoint(Pose.at(1.0, 1.0, z))
    flight.land()


def test_a_velocity_downwards_stops_above_the_ground(flight: Flight) -> None:
    flight.take_off()
    uav, was_refused = flight.uav, False
    until_s = flight.now_s + 20.0
    while flight.now_s < until_s and not was_refused:
        try:
            uav.set_velocity(Twist(Vector3(0.0, 0.0, -1.0)))
        except GeofenceError:
            was_refused = True
        flight.let_pass(0.05)
    flight.let_pass(3.0)
    lowest_m = min(
        each.pose.position.z for _, each in list(flight.seen) if each.pose and each.state is State.FLYING_AUTO
    )
    assert was_refused
    assert uav.state() is State.FLYING_AUTO
    assert lowest_m > -0.1
    flight.land()


def test_a_daemon_that_is_new_in_flight_measures_from_the_autopilots_home(flight: Flight) -> None:
    flight.take_off()
    flight.kill()
    flight.start()
    flight.wait_for_state(State.FLYING_AUTO)
    flight.wait_for(lambda: flight.backend.snapshot().earth.home is not None, "its home and origin")
    with pytest.raises(GeofenceError, match=r"the autopilot's home \(UAL has not seen the take-off\).*z is up"):
        flight.uav.go_to_waypoint(Pose.at(1.0, 1.0, -5.0))
    flight.uav.go_to_waypoint(Pose.at(1.0, 1.0, 2.0))
    flight.land()
