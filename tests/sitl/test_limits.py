"""Bounds of a real autopilot, by the request and by its own limits: take-off height, its own fence."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from pymavlink.dialects.v20 import all as mavlink

from tests.backend_of import backend_of
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
    has_rangefinder = backend_of(uav).snapshot().condition.has_rangefinder
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
    uav.go_to_waypoint(flight.offset(6.0))
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


def stream_until_refused(uav: UAL, velocity: Vector3) -> None:
    """Streams a velocity until it is refused as leading out of the fence, and lets the UAV come to rest."""
    refused = False
    for _ in range(200):
        try:
            uav.set_velocity(Twist(velocity))
        except GeofenceError:
            refused = True
            break
        time.sleep(0.05)
    time.sleep(3.0)  # as long as a stop may take: it must be inside then, whatever its speed was
    assert refused


def test_a_goal_beyond_its_autopilot_fence_is_refused_and_one_inside_is_reached(
    flight: Flight, uav: UAL, fence: str, simulator: Simulator
) -> None:
    """Without the check a go-to 60 m away got to 46 m, where ArduPilot's fence sent the UAV home."""
    backend = backend_of(uav)
    flight.wait_for(lambda: backend.snapshot().autopilot_fence is not None, "its fence")
    flight.take_off()
    begin = flight.position()
    with pytest.raises(GeofenceError, match=f"beyond the autopilot's own fence \\({fence}: 30 m") as caught:
        uav.go_to_waypoint(flight.offset(60.0))
    assert caught.value.metadata["parameter"] == fence
    assert (flight.position() - begin).norm() < simulator.wanders_m
    goal = flight.offset(22.0)
    uav.go_to_waypoint(goal)
    assert (flight.position() - goal.position).norm() < simulator.wanders_m
    stream_until_refused(uav, Vector3(3.0, 0.0, 0.0))
    assert uav.state() is State.FLYING_AUTO
    assert (flight.position() - begin).norm() < RADIUS_M
    uav.go_to_waypoint(Pose.at(begin.x, begin.y, flight.position().z))


BUILDING_M = ((8.0, -6.0), (8.0, 6.0), (16.0, 6.0), (16.0, -6.0))
"""The corners of what it must not fly over, east and north of where it stands."""
POLYGONS, ALL_KINDS = 4.0, 7.0
"""Values of ArduPilot's FENCE_TYPE."""
READ_S = 40.0
"""ArduPilot tells of an upload by FENCE_TOTAL; PX4 does not, and is asked every 30 s while it is disarmed."""


@pytest.fixture
def building(flight: Flight, uav: UAL, simulator: Simulator) -> Iterator[Vector3]:
    """Position of the UAV, with a polygon to stay out of beside it and a circle around it, uploaded by a ground
    station.
    """
    snapshot = backend_of(uav).snapshot
    flight.wait_for(
        lambda: snapshot().earth.projection is not None and snapshot().motion.pose is not None, "its place on Earth"
    )
    projection, here = snapshot().earth.projection, flight.position()
    assert projection is not None
    corners = [projection.to_geo(here + Vector3(east, north, 0.0)) for east, north in BUILDING_M]
    centre = projection.to_geo(here)
    exclusion = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
    items = [(exclusion, float(len(corners)), corner.latitude_deg, corner.longitude_deg) for corner in corners]
    circle = (mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 60.0, centre.latitude_deg, centre.longitude_deg)
    if simulator.autopilot == "ArduPilot":
        flight.pilot.set_parameter("FENCE_TYPE", POLYGONS)
        flight.pilot.set_parameter("FENCE_ENABLE", 1.0)
    flight.pilot.upload_fence([*items, circle])
    yield here
    flight.pilot.upload_fence([])
    if simulator.autopilot == "ArduPilot":
        flight.pilot.set_parameter("FENCE_ENABLE", 0.0)
        flight.pilot.set_parameter("FENCE_TYPE", ALL_KINDS)


def test_a_path_through_a_polygon_of_its_autopilot_fence_is_refused_and_one_around_it_is_executed(
    flight: Flight, uav: UAL, building: Vector3, simulator: Simulator
) -> None:
    backend = backend_of(uav)

    def zones_count() -> int:
        own = backend.snapshot().autopilot_fence
        return 0 if own is None else len(own.zones)

    flight.wait_for(lambda: zones_count() == 2, "the polygon and the circle", READ_S)
    flight.take_off()
    begin = flight.position()
    words = r"beyond the autopilot's own fence \(exclusion polygon 1 of 1; UAL stays 1 m inside\)"
    with pytest.raises(GeofenceError, match=f"the way to .* leads {words}"):
        uav.go_to_waypoint(Pose.at(building.x + 24.0, building.y, begin.z))
    with pytest.raises(GeofenceError, match=f"is {words}") as caught:
        uav.go_to_waypoint(Pose.at(building.x + 12.0, building.y, begin.z))
    assert caught.value.metadata["zone"] == "exclusion polygon 1 of 1"
    with pytest.raises(GeofenceError, match="inclusion circle 1 of 1"):
        uav.go_to_waypoint(Pose.at(building.x - 59.5, building.y, begin.z))
    assert (flight.position() - begin).norm() < simulator.wanders_m
    around = [Pose.at(building.x + x, building.y + y, begin.z) for x, y in ((5.0, 10.0), (19.0, 10.0), (24.0, 0.0))]
    uav.follow_path(around)
    assert uav.state() is State.FLYING_AUTO
    assert (flight.position() - around[-1].position).norm() < simulator.wanders_m
    stream_until_refused(uav, Vector3(-2.0, 0.0, 0.0))
    assert uav.state() is State.FLYING_AUTO
    assert flight.position().x > building.x + 16.0
    uav.follow_path([*reversed(around[:2]), Pose.at(begin.x, begin.y, begin.z)])
