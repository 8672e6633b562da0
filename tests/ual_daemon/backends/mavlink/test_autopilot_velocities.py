"""Velocities with simulated autopilots whose estimate of the velocity is wrong."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.simulators.physics import Vector, minus
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.geometry import Twist, Vector3
from ual.types import State, Telemetry

FLOWN_S = 10.0
REACHED_S = 3.0
WRONG_BY: Vector = (0.3, -0.3, 0.1)


@pytest.fixture(params=["px4", "ardupilot"])
def flight(request: pytest.FixtureRequest) -> Iterator[Flight]:
    flight = Flight(str(request.param))
    flight.take_off()
    yield flight
    flight.uav.close()


@pytest.mark.parametrize("commanded", [Vector3(), Vector3(1.0, 0.0, 0.0)], ids=["0", "1 m/s east"])
def test_a_velocity_leads_where_it_should_though_it_is_estimated_wrongly(flight: Flight, commanded: Vector3) -> None:
    places: list[tuple[float, Vector]] = []

    def on_telemetry(telemetry: Telemetry) -> None:
        if telemetry.state is State.FLYING_AUTO:
            flight.uav.set_velocity(Twist(commanded))
        places.append((flight.now_s, flight.autopilot.body.position))

    unsubscribe = flight.uav.vehicle.subscribe(on_telemetry)
    flight.let_pass(REACHED_S)
    with flight.autopilot.lock:
        flight.autopilot.velocity_error = WRONG_BY
        places.clear()
    flight.let_pass(FLOWN_S)
    unsubscribe()
    (begin_s, begin), (end_s, end) = places[0], places[-1]
    north, east, down = minus(end, begin)
    assert abs(north) < 0.2
    assert abs(east - commanded.x * (end_s - begin_s)) < 0.3
    assert abs(down) < 0.2
    sideways = [place[0] for _, place in places]
    assert max(sideways) - min(sideways) < 0.5
