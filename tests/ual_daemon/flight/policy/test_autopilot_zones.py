"""The zones of the autopilot's own fence: where they lie in the local frame, and what they refuse."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.snapshots import changed
from ual.errors import GeofenceError, WrongStateError
from ual.geometry import IDENTITY, Pose, Twist, Vector3
from ual.types import GeoPoint, Limits
from ual_daemon.backends.values import AutopilotFence, EarthReference, FenceLimit, MotionState, Sample, Snapshot, Zone
from ual_daemon.flight.policy.autopilot_fence import breach_text
from ual_daemon.flight.policy.autopilot_zones import local_zones
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.frames.area import Area
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.geodesy import FlatProjection, Projection, SphereProjection
from ual_daemon.settings import GeofenceSettings, VehicleSettings

LATITUDE, LONGITUDE = 47.4, 8.5
FLAT = FlatProjection(LATITUDE, LONGITUDE, 488.0)
SPHERE = SphereProjection(LATITUDE, LONGITUDE, 488.0)
LIMITS = Limits()


def geo(x: float, y: float, projection: Projection = FLAT) -> tuple[float, float]:
    point = projection.to_geo(Vector3(x, y, 0.0))
    return point.latitude_deg, point.longitude_deg


def box(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    return tuple(geo(x, y) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


BUILDING = Zone("exclusion polygon 1 of 1", False, box(10.0, -5.0, 20.0, 5.0))
FIELD = Zone("inclusion polygon 1 of 1", True, box(-50.0, -50.0, 50.0, 50.0))
POND = Zone("exclusion circle 1 of 1", False, (geo(0.0, 30.0),), 8.0)
OWN = AutopilotFence(zones=(FIELD, BUILDING, POND))


def snapshot(x: float, y: float, own: AutopilotFence = OWN, projection: Projection | None = FLAT) -> Snapshot:
    return Snapshot(
        0.0,
        autopilot_fence=own,
        motion=MotionState(pose=Sample(Pose(Vector3(x, y, 5.0), IDENTITY), 0.0)),
        earth=EarthReference(projection=projection),
    )


def geofence(settings: GeofenceSettings | None = None) -> GeofencePolicy:
    return GeofencePolicy(settings, FrameResolver("uav_1", VehicleSettings(geofence=settings)))


def at(x: float, y: float) -> Vector3:
    return Vector3(x, y, 5.0)


# --- Where they lie ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("projection", [FLAT, SPHERE])
@given(east_km=st.floats(-12.0, 12.0), north_km=st.floats(-12.0, 12.0))
def test_sides_are_straight_in_latitude_and_longitude(projection: Projection, east_km: float, north_km: float) -> None:
    low, high = geo(-10_000.0, -10_000.0, projection), geo(10_000.0, 10_000.0, projection)
    zone = Zone("large", True, (low, (low[0], high[1]), high, (high[0], low[1])))
    area = Area((), local_zones((zone,), projection))
    x, y = 1000.0 * east_km, 1000.0 * north_km
    latitude_deg, longitude_deg = geo(x, y, projection)
    from_edge_m = 111_000.0 * min(
        *(abs(latitude_deg - each) for each in (low[0], high[0])),
        *(abs(longitude_deg - each) * math.cos(math.radians(LATITUDE)) for each in (low[1], high[1])),
    )
    assume(from_edge_m > 0.05)
    is_in = low[0] < latitude_deg < high[0] and low[1] < longitude_deg < high[1]
    assert area.has((x, y)) == is_in


@pytest.mark.parametrize("is_inclusion", [True, False])
@pytest.mark.parametrize("projection", [FLAT, SPHERE])
@given(heading=st.floats(-math.pi, math.pi), reach=st.floats(0.5, 1.5))
def test_a_circle_is_round_where_it_is_and_on_the_safe_side(
    projection: Projection, is_inclusion: bool, heading: float, reach: float
) -> None:
    centre, radius_m = geo(9_000.0, 9_000.0, projection), 4_000.0
    zone = Zone("circle", is_inclusion, (centre,), radius_m)
    area = Area((), local_zones((zone,), projection))
    around = type(projection)(*centre, 0.0)
    place = around.to_geo(Vector3(math.cos(heading), math.sin(heading), 0.0) * (reach * radius_m))
    local = projection.to_local(place.latitude_deg, place.longitude_deg, 0.0)
    is_admitted = area.has((local.x, local.y))
    is_right = (reach < 1.0) == is_inclusion
    assert is_right or not is_admitted or abs(reach - 1.0) < 1e-6
    assert not is_right or is_admitted or abs(reach - 1.0) < 0.0013


# --- What they refuse -------------------------------------------------------------------------------------------------


def test_goals_and_variants_are_refused_with_the_name_of_the_zone() -> None:
    fence, now = geofence(), snapshot(0.0, 0.0)
    fence.require_inside([at(0.0, 0.0), at(8.9, 0.0)], "go", now)
    fence.require_inside([at(0.0, 0.0), at(8.0, 12.0), at(22.0, 12.0), at(25.0, 0.0)], "go", now)
    with pytest.raises(GeofenceError, match=r"own fence \(exclusion polygon 1 of 1; UAL stays 1 m inside\)") as caught:
        fence.require_goal_inside(at(9.1, 0.0), "go", now)
    assert caught.value.metadata["zone"] == "exclusion polygon 1 of 1"
    with pytest.raises(
        GeofenceError, match=r"the way to .* leads beyond the autopilot's own fence \(exclusion polygon"
    ):
        fence.require_inside([at(0.0, 0.0), at(25.0, 0.0)], "go", now)
    with pytest.raises(GeofenceError, match="exclusion circle 1 of 1"):
        fence.require_goal_inside(at(0.0, 22.0), "go", now)
    with pytest.raises(GeofenceError, match="inclusion polygon 1 of 1"):
        fence.require_goal_inside(at(49.5, 0.0), "go", now)


def test_exclusions_alone_refuse_no_far_goal() -> None:
    own = AutopilotFence(zones=(BUILDING,))
    geofence().require_inside([at(0.0, 0.0), at(-1e5, 0.0)], "go", snapshot(0.0, 0.0, own))


def test_zones_hold_with_the_limits_around_home_and_the_configured_fence() -> None:
    own = AutopilotFence(FenceLimit(30.0, "FENCE_RADIUS"), zones=(BUILDING,))
    fence = geofence(GeofenceSettings(polygon=((-20.0, -20.0), (40.0, -20.0), (40.0, 20.0), (-20.0, 20.0))))
    now = changed(snapshot(0.0, 0.0, own), home_geo=GeoPoint(*geo(0.0, 0.0)), home_altitude_amsl_m=488.0)
    fence.require_goal_inside(at(25.0, 0.0), "go", now)
    for goal, text in ((at(35.0, 0.0), "FENCE_RADIUS"), (at(15.0, 0.0), "exclusion"), (at(0.0, 25.0), "geofence")):
        with pytest.raises(GeofenceError, match=text):
            fence.require_goal_inside(goal, "go", now)
    with pytest.raises(WrongStateError, match="where its home is"):
        fence.fence(snapshot(0.0, 0.0, own))


def test_without_a_position_on_earth_nothing_can_be_checked() -> None:
    with pytest.raises(WrongStateError, match="where on Earth"):
        geofence().require_goal_inside(at(1.0, 0.0), "go", snapshot(0.0, 0.0, projection=None))


def test_the_geometry_is_made_anew_only_when_something_has_changed() -> None:
    fence = geofence()
    first = fence.fence(snapshot(0.0, 0.0))
    assert fence.fence(snapshot(3.0, 0.0, AutopilotFence(zones=(FIELD, BUILDING, POND)))) is first
    moved = FlatProjection(LATITUDE + 1e-4, LONGITUDE, 488.0)
    assert fence.fence(snapshot(0.0, 0.0, projection=moved)) is not first
    assert fence.fence(snapshot(0.0, 0.0, AutopilotFence(zones=(FIELD,)))).is_inside(at(15.0, 0.0))


def test_a_velocity_must_let_it_stop_before_a_zone_and_lead_out_of_one_by_itself() -> None:
    fence = geofence()

    def require(x: float, velocity: Vector3) -> None:
        fence.require_velocity(velocity, LIMITS, snapshot(x, 0.0))

    require(0.0, Vector3(1.0, 0.0, 0.0))
    with pytest.raises(GeofenceError, match="exclusion polygon 1 of 1"):
        require(8.0, Vector3(2.0, 0.0, 0.0))
    require(8.9, Vector3(-2.0, 0.0, 0.0))
    require(10.0, Vector3(-1.0, 0.0, 0.0))  # it is inside, by 2 m with the reserve
    require(20.0, Vector3(1.0, 0.0, 0.0))
    with pytest.raises(GeofenceError, match="exclusion polygon 1 of 1"):
        require(10.0, Vector3(1.0, 0.0, 0.0))


@pytest.mark.parametrize("x", [0.0, 20.5])
def test_a_velocity_may_not_lead_faster_through_a_zone(x: float) -> None:
    """`x` is before the building, or still beside it, within the reserve."""
    wall = Zone("exclusion polygon 2 of 2", False, box(x + 4.0, -5.0, x + 6.0, 5.0))
    now = snapshot(x, 0.0, AutopilotFence(zones=(BUILDING, wall) if x else (wall,)))
    now = changed(now, velocity=Sample(Twist(Vector3(4.0, 0.0, 0.0)), 0.0))
    for allowed in (Vector3(0.1, 0.0, 0.0), Vector3(-1.0, 0.0, 0.0)):
        geofence().require_velocity(allowed, LIMITS, now)
    for refused in (Vector3(4.0, 0.0, 0.0), Vector3(8.0, 0.0, 0.0)):  # the latter could stop behind it
        with pytest.raises(GeofenceError, match="exclusion polygon"):
            geofence().require_velocity(refused, LIMITS, now)


def test_nothing_is_admitted_where_the_zones_leave_no_room() -> None:
    other = Zone("inclusion polygon 2 of 2", True, box(200.0, 0.0, 300.0, 50.0))
    now = snapshot(0.0, 0.0, AutopilotFence(zones=(FIELD, other)))
    with pytest.raises(GeofenceError, match="inclusion polygon 2 of 2"):
        geofence().require_goal_inside(at(1.0, 0.0), "go", now)
    with pytest.raises(GeofenceError, match="inclusion polygon 2 of 2"):
        geofence().require_velocity(Vector3(1.0, 0.0, 0.0), LIMITS, now)
    geofence().require_velocity(Vector3(), LIMITS, now)  # a stop


def test_united_inclusions_are_one_area() -> None:
    other = Zone("inclusion polygon 2 of 2", True, box(50.0, -50.0, 150.0, 50.0))
    apart, united = AutopilotFence(zones=(FIELD, other)), AutopilotFence(zones=(FIELD, other), unites_inclusions=True)
    way = [at(0.0, 0.0), at(140.0, 0.0)]
    geofence().require_inside(way, "go", snapshot(0.0, 0.0, united))
    with pytest.raises(GeofenceError, match="inclusion polygon 2 of 2"):
        geofence().require_goal_inside(at(0.0, 0.0), "go", snapshot(0.0, 0.0, apart))
    with pytest.raises(GeofenceError, match="its 2 inclusions together"):
        geofence().require_goal_inside(at(160.0, 0.0), "go", snapshot(0.0, 0.0, united))


def test_a_breach_names_the_zone_and_has_no_reserve() -> None:
    assert breach_text(snapshot(15.0, 0.0)) == "it is beyond the autopilot's own fence (exclusion polygon 1 of 1)"
    assert breach_text(snapshot(9.5, 0.0)) == ""
    assert breach_text(snapshot(15.0, 0.0, projection=None)) == ""
    moving = changed(snapshot(15.0, 0.0), velocity=Sample(Twist(Vector3()), 0.0))
    assert "exclusion" in breach_text(moving)
