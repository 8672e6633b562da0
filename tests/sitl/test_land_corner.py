"""A landing before a corner of the fence: it first brakes along its way, as the autopilot brakes straight ahead."""

from __future__ import annotations

import math
from collections.abc import Iterator

import pytest

from tests.sitl.flights import Flight
from tests.sitl.transmitter import Transmitter
from tests.sitl.wiretap import Wiretap
from ual.geometry import Pose, Vector3
from ual.types import State
from ual_daemon import UAL
from ual_daemon.settings import GeofenceSettings, VehicleSettings

pytestmark = [pytest.mark.sitl, pytest.mark.timeout(300)]

HEIGHT_M = 6.0
OVERRUN_M = 0.6
"""An ArduCopter that brakes is up to 0.8 m ahead of its reference, which comes to rest at the edge."""
CORNER_M, SLOPE, BESIDE_M = 60.0, math.tan(math.radians(30.0)), 1.5


def _edge_m(x: float) -> float:
    return max(0.0, (x - CORNER_M) * SLOPE) - BESIDE_M


def _inside_m(point: Vector3) -> float:
    """Returns how far it is from the edge, outside negative."""
    return (point.y - _edge_m(point.x)) * (math.cos(math.atan(SLOPE)) if point.x > CORNER_M else 1.0)


@pytest.fixture
def fenced(wiretap: Wiretap) -> Iterator[UAL]:
    edge = [(x, _edge_m(x)) for x in (-6.0, CORNER_M, 200.0)]
    polygon = ((-40.0, -40.0), (-6.0, -40.0), *edge, (200.0, 200.0), (-40.0, 200.0))
    settings = VehicleSettings(geofence=GeofenceSettings(polygon=polygon))
    with UAL("mavlink", "uav_1", url=wiretap.url, settings=settings, allow_arming=True) as uav:
        yield uav


def test_a_landing_before_a_corner_of_the_fence_stays_inside(fenced: UAL, pilot: Transmitter) -> None:
    flight = Flight(fenced, pilot)
    flight.be_armed()
    fenced.take_off(HEIGHT_M)
    fenced.go_to_waypoint(Pose.at(0.0, 0.0, HEIGHT_M))
    path = [Pose.at(CORNER_M, 0.0, HEIGHT_M), Pose.at(CORNER_M + 60.0, 60.0 * SLOPE, HEIGHT_M)]
    fenced.follow_path(path, corner_radius_m=30.0, blocking=False)
    flight.wait_for(lambda: flight.position().x >= 50.0, "the corner")
    speed_m_s = fenced.velocity().twist.linear.horizontal_norm()
    landing = fenced.land(blocking=False)
    inside_m, reference_m = [math.inf], [math.inf]

    def is_down() -> bool:
        told = fenced.telemetry()
        if told.pose is not None:
            inside_m[0] = min(inside_m[0], _inside_m(told.pose.position))
        if told.reference_pose is not None:
            reference_m[0] = min(reference_m[0], _inside_m(told.reference_pose.position))
        return told.state is State.LANDED_DISARMED

    flight.wait_for(is_down, "its landing", 60.0)
    landing.wait(5.0)
    print(
        f"{pilot.autopilot}: {speed_m_s:.2f} m/s at the command; {inside_m[0]:.2f} m inside at least, "
        f"its reference {reference_m[0]:.2f} m"
    )
    assert reference_m[0] >= 0.0
    assert inside_m[0] > -OVERRUN_M
