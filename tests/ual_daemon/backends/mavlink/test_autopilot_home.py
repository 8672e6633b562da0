"""Home that is set elsewhere just before it is used: a height above home is that above the home of now."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.physics import plus
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.geometry import Vector3
from ual.types import AltitudeReference, GeoPoint, State

HEIGHT_M = 9.0


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    yield flight
    flight.uav.close()


def set_home(flight: Flight, north_m: float, east_m: float, down_m: float) -> None:
    """A ground station sets home elsewhere."""
    with flight.autopilot.lock:
        home = flight.autopilot.home
        assert home is not None
        flight.autopilot.home = plus(home, (north_m, east_m, down_m))


def above_home_m(flight: Flight) -> float:
    home = flight.autopilot.home
    assert home is not None
    return home[2] - flight.autopilot.position[2]


def here(flight: Flight) -> GeoPoint:
    flight.wait_for(lambda: flight.uav.telemetry().position_geo is not None, "its place on Earth")
    found = flight.uav.telemetry().position_geo
    assert found is not None
    return found


@pytest.mark.parametrize("lower_m", [6.0, -4.0])
def test_a_height_above_home_is_that_above_a_home_that_was_set_just_before(flight: Flight, lower_m: float) -> None:
    """PX4 tells its home every 2 s: "9 m above home" ended at 2.8 m."""
    flight.take_off()
    place = here(flight)
    for moved_m in (lower_m, -lower_m):
        set_home(flight, 0.0, 0.0, moved_m)
        flight.uav.go_to_waypoint_geo(place.latitude_deg, place.longitude_deg, HEIGHT_M, AltitudeReference.HOME)
        assert above_home_m(flight) == pytest.approx(HEIGHT_M, abs=0.6)
    flight.land()


def test_a_height_above_home_where_it_is_already_by_the_home_before(flight: Flight) -> None:
    """It needs no time to get there, in which the new home would be told."""
    flight.take_off()
    place = here(flight)
    flight.uav.go_to_waypoint_geo(place.latitude_deg, place.longitude_deg, HEIGHT_M)
    flight.let_pass(1.0)
    set_home(flight, 0.0, 0.0, 5.0)
    flight.uav.go_to_waypoint_geo(place.latitude_deg, place.longitude_deg, HEIGHT_M)
    assert above_home_m(flight) == pytest.approx(HEIGHT_M, abs=0.6)


def test_the_return_path_leads_to_a_home_that_was_set_just_before(flight: Flight) -> None:
    flight.take_off()
    flight.uav.go_to_waypoint(flight.goal(4.0, 0.0))
    set_home(flight, 0.0, 12.0, 0.0)
    home = flight.autopilot.home
    assert home is not None
    task = flight.uav.return_to_launch(blocking=False)
    flight.wait_for(task.done, "the landing")
    task.wait(0.0)
    assert math.dist(flight.autopilot.position[:2], home[:2]) < 0.7


def test_home_is_requested_when_a_command_relies_on_it_and_not_by_a_dry_run(flight: Flight) -> None:
    flight.take_off()
    flight.let_pass(1.0)
    place = here(flight)

    def requests_made() -> int:
        requests = [
            each
            for each in flight.autopilot.commands
            if each[1] == mavlink.MAV_CMD_REQUEST_MESSAGE and each[2][0] == mavlink.MAVLINK_MSG_ID_HOME_POSITION
        ]
        return len(requests)

    before = requests_made()
    flight.uav.dry_run.go_to_waypoint_geo(place.latitude_deg, place.longitude_deg, HEIGHT_M)
    flight.let_pass(0.5)
    assert requests_made() == before
    flight.uav.go_to_waypoint_geo(place.latitude_deg, place.longitude_deg, HEIGHT_M)
    assert requests_made() == before + 1


def test_a_height_that_contradicts_home_asks_for_it_and_counts_at_once(flight: Flight) -> None:
    flight.take_off()
    flight.let_pass(1.0)
    before_m = flight.backend.snapshot().earth.home_altitude_amsl_m
    assert before_m is not None
    set_home(flight, 0.0, 20.0, 2.0)
    set_s = flight.now_s
    flight.wait_for(lambda: flight.backend.snapshot().earth.home_altitude_amsl_m != before_m, "its new height")
    flight.wait_for(lambda: (flight.backend.snapshot().earth.home or Vector3()).x > 19.0, "its new place")
    assert flight.now_s - set_s < 0.5
    assert flight.backend.snapshot().earth.home_altitude_amsl_m == pytest.approx(before_m - 2.0, abs=0.05)
    assert flight.uav.state() is State.FLYING_AUTO


def test_an_origin_that_goes_back_and_forth_is_logged_when_it_begins_and_once_it_has_settled(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A PX4 without a position filled the log with `origin_doubted` and `home_followed`, up to ten times a second."""
    flight = Flight("px4")
    try:
        flight.wait_for_state(State.LANDED_DISARMED)
        origin = flight.autopilot.projection
        places = [origin.to_geo(Vector3(east_m, 0.0, 0.0)) for east_m in (*(4.0, 0.0) * 10, 8.0)]

        def move() -> None:
            place = places.pop(0)
            moved = replace(origin, latitude_deg=place.latitude_deg, longitude_deg=place.longitude_deg)
            flight.autopilot.projection = moved
            if places:
                flight.autopilot.at(0.3, move)

        with flight.autopilot.lock:
            move()
        flight.let_pass(8.0)
        names = [record.__dict__.get("ual_event") for record in caplog.records]
        assert (names.count("origin_doubted"), names.count("home_followed")) == (1, 1)
        flight.let_pass(12.0)
        followed = [record for record in caplog.records if record.__dict__.get("ual_event") == "home_followed"]
        assert len(followed) == 2
        assert followed[-1].__dict__["ual_fields"]["x"] == pytest.approx(-8.0, abs=0.1)
    finally:
        flight.uav.close()
