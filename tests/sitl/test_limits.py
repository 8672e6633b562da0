"""What keeps a real autopilot within what was asked and what it allows itself: take-off height, its own fence."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from tests.sitl.flights import Flight
from tests.sitl.simulators import Simulator
from ual.errors import GeofenceError, WrongStateError
from ual.geometry import Pose, Twist, Vector3
from ual.types import State
from ual_daemon import UAL

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(240)]

HEIGHT_M = 5.0
BELOW_M = 20.0


def test_the_height_of_a_take_off_counts_from_the_ground_wherever_home_is(flight: Flight, uav: UAL) -> None:
    """With a rangefinder ArduPilot would climb to the sum of both heights."""
    flight.be_armed()
    ground = flight.position()
    has_rangefinder = uav.vehicle.backend.snapshot().has_rangefinder
    flight.set_home(-BELOW_M)
    highest = [ground.z]
    uav.vehicle.subscribe(lambda sample: highest.append(ground.z if sample.pose is None else sample.pose.position.z))
    if has_rangefinder and uav.info().autopilot == "ArduPilot":
        with pytest.raises(WrongStateError, match="with its rangefinder it counts"):
            uav.take_off(HEIGHT_M)
        flight.set_home(0.0)
    uav.take_off(HEIGHT_M)
    assert flight.position().z - ground.z == pytest.approx(HEIGHT_M, abs=0.5)
    assert max(highest) - ground.z < 1.2 * HEIGHT_M + 1.0
    flight.set_home(-HEIGHT_M)


def test_a_second_flight_from_elsewhere_climbs_by_the_home_of_its_own_arming(
    flight: Flight, uav: UAL, simulator: Simulator
) -> None:
    flight.take_off()
    uav.go_to_waypoint(flight.beside(6.0))
    flight.end()
    flight.be_armed()
    ground = flight.position()
    uav.take_off(HEIGHT_M)
    assert flight.position().z - ground.z == pytest.approx(HEIGHT_M, abs=simulator.wanders_m)


RADIUS_M = 30.0


@pytest.fixture
def fence(flight: Flight, simulator: Simulator) -> Iterator[str]:
    """The autopilot's own fence of 30 m around home; the name of its parameter."""
    names = {"ArduPilot": ("FENCE_RADIUS", "FENCE_ENABLE"), "PX4": ("GF_MAX_HOR_DIST", "")}
    radius, enable = names[simulator.autopilot]
    flight.set_home(0.0)  # else it may stand beyond the fence, and cannot be armed
    flight.pilot.set_parameter(radius, RADIUS_M)
    if enable:
        flight.pilot.set_parameter(enable, 1.0)
    yield radius
    if enable:
        flight.pilot.set_parameter(enable, 0.0)
    flight.pilot.set_parameter(radius, 150.0)


def test_a_goal_beyond_its_own_fence_is_refused_and_one_inside_is_reached(
    flight: Flight, uav: UAL, fence: str, simulator: Simulator
) -> None:
    """Without the check a go-to 60 m away got to 46 m, where ArduPilot's fence sent the UAV home."""
    backend = uav.vehicle.backend
    flight.wait_for(lambda: backend.snapshot().own_fence is not None, "its fence")
    flight.take_off()
    begin = flight.position()
    with pytest.raises(GeofenceError, match=f"beyond the autopilot's own fence \\({fence}: 30 m") as caught:
        uav.go_to_waypoint(flight.beside(60.0))
    assert caught.value.metadata["parameter"] == fence
    assert (flight.position() - begin).norm() < simulator.wanders_m
    goal = flight.beside(22.0)
    uav.go_to_waypoint(goal)
    assert (flight.position() - goal.position).norm() < simulator.wanders_m
    refused = False
    for _ in range(200):
        try:
            uav.set_velocity(Twist(Vector3(3.0, 0.0, 0.0)))
        except GeofenceError:
            refused = True
            break
        time.sleep(0.05)
    time.sleep(3.0)
    assert refused
    assert uav.state() is State.FLYING_AUTO
    assert (flight.position() - begin).norm() < RADIUS_M
    uav.go_to_waypoint(Pose.at(begin.x, begin.y, flight.position().z))
