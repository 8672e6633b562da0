"""The geofence as geometry: what lies inside, which polylines leave it, and where it lies among the frames."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ual.errors import GeofenceError, WrongStateError
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.values import EarthReference, MotionState, Sample, Snapshot
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.frames.fence import Fence
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.geodesy import EllipsoidProjection
from ual_daemon.settings import ConfigError, FrameSettings, GeofenceSettings, VehicleSettings
from ual_daemon.trajectory import Brake, Motion

# An L: the square from 0 to 10 without its upper right quarter.
L_SHAPE = [(0.0, 0.0), (10.0, 0.0), (10.0, 5.0), (5.0, 5.0), (5.0, 10.0), (0.0, 10.0)]
BAND = (1.0, 20.0)

coordinates = st.floats(-5.0, 15.0)


def at(x: float, y: float, z: float = 5.0) -> Vector3:
    return Vector3(x, y, z)


def is_in_l(x: float, y: float) -> bool:
    return 0.0 <= x <= 10.0 and 0.0 <= y <= 10.0 and not (x > 5.0 and y > 5.0)


def distance_from_edges(x: float, y: float) -> float:
    """Returns the distance of a point from the coordinate of an edge: near it, the answer depends on rounding."""
    return min(abs(v - edge) for v in (x, y) for edge in (0.0, 5.0, 10.0))


@given(coordinates, coordinates, st.floats(-5.0, 30.0))
def test_inside_is_over_the_polygon_and_in_the_band(x: float, y: float, z: float) -> None:
    assume(distance_from_edges(x, y) > 0.01 and all(abs(z - edge) > 0.01 for edge in BAND))
    assert Fence(L_SHAPE, *BAND).is_inside(at(x, y, z)) == (is_in_l(x, y) and BAND[0] < z < BAND[1])


def test_the_edge_belongs_to_the_fence() -> None:
    fence = Fence(L_SHAPE, *BAND)
    assert all(fence.is_inside(at(x, y, 1.0)) for x, y in L_SHAPE)
    assert fence.exit_point([at(0, 0), at(10, 0), at(10, 5)]) is None


@given(coordinates, coordinates, coordinates, coordinates)
def test_a_segment_stays_inside_when_each_of_its_points_does(x0: float, y0: float, x1: float, y1: float) -> None:
    assume(is_in_l(x0, y0))
    steps = [i / 400 for i in range(401)]
    points = [(x0 + (x1 - x0) * s, y0 + (y1 - y0) * s) for s in steps]
    are_in = [is_in_l(x, y) for x, y in points]
    left = Fence(L_SHAPE).exit_point([at(x0, y0), at(x1, y1)])
    if left is None:
        assert all(is_in or distance_from_edges(x, y) < 0.01 for (x, y), is_in in zip(points, are_in, strict=True))
    elif all(are_in):  # it can leave between two points, by less than their distance
        assert min(math.hypot(x - 5.0, y - 5.0) for x, y in points) < 0.1
    else:
        assert left == at(x1, y1)


def test_a_segment_across_an_outer_corner_leaves_though_both_ends_are_inside() -> None:
    assert Fence(L_SHAPE).exit_point([at(9, 4), at(4, 9)]) == at(4, 9)
    assert Fence(L_SHAPE).exit_point([at(9, 4), at(4, 4), at(4, 9)]) is None


def test_a_polyline_that_begins_outside_may_come_in_but_not_leave_again() -> None:
    fence = Fence(L_SHAPE, *BAND)
    assert fence.exit_point([at(-3, 2), at(2, 2)]) is None
    assert fence.exit_point([at(2, 2, 0.0), at(2, 2, 5.0)]) is None  # from the ground into the band
    assert fence.exit_point([at(-3, 2), at(2, 2), at(2, 12)]) == at(2, 12)
    assert fence.exit_point([at(-3, 2), at(-2, 2)]) == at(-2, 2)
    assert fence.exit_point([at(12, 1), at(4, 9)]) == at(4, 9)  # in, out at the corner, and in again
    assert fence.exit_point([at(-3, 2), at(12, 2), at(9, 2)]) == at(12, 2)  # through it between two points
    assert fence.exit_point([at(2, 2, 0.0), at(2, 2, 25.0), at(2, 2, 5.0)]) == at(2, 2, 25.0)
    assert fence.exit_point([at(-3, -3), at(-3, 12), at(2, 9)]) is None  # around it
    assert fence.exit_point([at(-3, 2, 0.0), at(12, 2, 0.0), at(9, 2)]) is None  # below it


def test_points_after_the_exit_point_are_not_read() -> None:
    polyline = iter([at(2, 2), at(12, 2), at(13, 2), at(14, 2)])
    assert Fence(L_SHAPE).exit_point(polyline) == at(12, 2)
    assert next(polyline) == at(13, 2)


@given(st.floats(-1.0, 11.0), st.floats(-1.0, 11.0), st.floats(-1.0, 11.0), st.floats(-math.pi, math.pi))
def test_everything_within_the_clearance_of_a_point_is_inside(x: float, y: float, z: float, heading: float) -> None:
    point = at(x, y, z)
    fence = Fence(L_SHAPE, *BAND)
    clearance_m = fence.clearance_m(point)
    assert fence.is_inside(point) or clearance_m == 0.0
    step_m = 0.999 * clearance_m
    for there in (
        at(x + step_m * math.cos(heading), y + step_m * math.sin(heading), z),
        at(x, y, z + step_m),
        at(x, y, z - step_m),
    ):
        assert fence.is_inside(there) or clearance_m == 0.0


def test_without_a_polygon_only_the_height_counts() -> None:
    fence = Fence((), 1.0, 20.0)
    assert fence.exit_point([at(0, 0, 5.0), at(1e5, 0, 20.0)]) is None
    assert fence.exit_point([at(0, 0, 5.0), at(0, 0, 20.1)]) == at(0, 0, 20.1)
    assert fence.distance_m(at(0, 0, 23.0)) == pytest.approx(3.0, abs=0.01)


# --- Among the frames -------------------------------------------------------------------------------------------------


def resolver(**settings: object) -> FrameResolver:
    return FrameResolver("uav_1", VehicleSettings(**settings))  # type: ignore[arg-type]


def standing_at(point: Vector3, velocity: Vector3 | None = None) -> tuple[Snapshot, Motion]:
    velocity = velocity or Vector3()
    pose, twist = Pose(point, Quaternion.from_yaw(0.0)), Twist(velocity)
    return Snapshot(0.0, motion=MotionState(pose=Sample(pose, 0.0), velocity=Sample(twist, 0.0))), Motion(
        point, 0.0, velocity
    )


def leaves(geofence: GeofencePolicy, polyline: Sequence[Vector3], snapshot: Snapshot) -> bool:
    try:
        geofence.require_inside(polyline, "goal", snapshot)
    except GeofenceError:
        return True
    return False


def test_the_polygon_lies_in_its_frame() -> None:
    field = FrameSettings(frame_id="field", translation=(100.0, 0.0, 2.0), yaw_rad=math.pi / 2)
    settings = GeofenceSettings(frame_id="field", polygon=tuple(L_SHAPE), min_height_m=0.0)
    snapshot, _ = standing_at(Vector3())
    geofence = GeofencePolicy(settings, resolver(frames=(field,), home_pose=(100.0, 0.0, 0.0)))
    # x of the field is y here; z = 0 of the field is 2 m here.
    assert not leaves(geofence, [at(-4.0, 9.0, 2.0)], snapshot)
    assert leaves(geofence, [at(-9.0, 9.0, 2.0)], snapshot)
    assert leaves(geofence, [at(-4.0, 9.0, 1.9)], snapshot)


def test_a_fence_in_odom_moves_with_set_home() -> None:
    frames = resolver()
    geofence = GeofencePolicy(GeofenceSettings(polygon=tuple(L_SHAPE)), frames)
    snapshot, _ = standing_at(Vector3(20.0, 0.0, 0.0))
    assert leaves(geofence, [at(21.0, 1.0)], snapshot)
    frames.set_home(Vector3(20.0, 0.0, 0.0), snapshot, set_z=False)
    assert not leaves(geofence, [at(21.0, 1.0)], snapshot)


@pytest.mark.parametrize("frame_id", ["map", "field"])
@pytest.mark.parametrize("map_origin_geo", [None, (37.0, -6.0, 10.0)])
def test_a_fence_in_map_stays_where_it_was(frame_id: str, map_origin_geo: tuple[float, float, float] | None) -> None:
    """Otherwise any client could move it away, one `set_home` after the other."""
    frames = resolver(frames=(FrameSettings(frame_id="field"),), map_origin_geo=map_origin_geo)
    geofence = GeofencePolicy(GeofenceSettings(frame_id=frame_id, polygon=tuple(L_SHAPE), max_height_m=5.0), frames)
    snapshot = Snapshot(0.0, earth=EarthReference(projection=EllipsoidProjection(37.0, -6.0, 10.0)))
    frames.update(snapshot)
    for hop in range(1, 4):
        frames.set_home(at(9.0 * hop, 4.0, 1.0), snapshot, set_z=True)
        assert leaves(geofence, [at(11.0, 1.0)], snapshot)
        assert leaves(geofence, [at(9.0, 4.0, 5.1)], snapshot)
        assert not leaves(geofence, [at(0.1, 9.9, 4.9)], snapshot)


def test_a_fence_in_a_frame_below_odom_moves_with_odom() -> None:
    field = FrameSettings(frame_id="field", parent_frame_id="uav_1/odom", translation=(100.0, 0.0, 0.0))
    frames = resolver(frames=(field,))
    geofence = GeofencePolicy(GeofenceSettings(frame_id="field", polygon=tuple(L_SHAPE)), frames)
    snapshot, _ = standing_at(Vector3())
    frames.set_home(Vector3(20.0, 0.0, 0.0), snapshot, set_z=False)
    assert not leaves(geofence, [at(121.0, 1.0)], snapshot)
    assert leaves(geofence, [at(101.0, 1.0)], snapshot)


def test_a_geographic_polygon_lies_where_the_autopilot_projects_it() -> None:
    projection = EllipsoidProjection(37.0, -6.0, 10.0)
    corners = [projection.to_geo(Vector3(x, y, 0.0)) for x, y in L_SHAPE]
    polygon_geo = tuple((corner.latitude_deg, corner.longitude_deg) for corner in corners)
    geofence = GeofencePolicy(GeofenceSettings(polygon_geo=polygon_geo), resolver())
    with pytest.raises(WrongStateError, match="where on Earth"):
        geofence.require_inside([at(1, 1)], "goal", Snapshot(0.0))
    known = Snapshot(0.0, earth=EarthReference(projection=projection))
    assert not leaves(geofence, [at(4.9, 9.9), at(0.1, 0.1)], known)
    assert leaves(geofence, [at(5.1, 5.1)], known)


@given(st.floats(0.1, 8.0), st.floats(-math.pi, math.pi))
def test_a_uav_that_may_go_on_can_stop_inside(speed: float, heading: float) -> None:
    velocity = Vector3(speed * math.cos(heading), speed * math.sin(heading), 0.0)
    snapshot, motion = standing_at(at(2.5, 2.5), velocity)
    geofence, limits = GeofencePolicy(GeofenceSettings(polygon=tuple(L_SHAPE)), resolver()), Limits()
    try:
        geofence.require_velocity(velocity, limits, snapshot)
    except GeofenceError:
        return
    stop = Brake(motion, limits).end().position
    assert is_in_l(stop.x, stop.y)


@given(st.floats(0.1, 8.0), st.floats(-math.pi, math.pi), st.floats(0.1, 8.0), st.floats(-math.pi, math.pi))
def test_a_uav_that_may_change_its_velocity_can_stop_inside_or_stops_as_well_as_it_can(
    speed: float, heading: float, commanded: float, commanded_heading: float
) -> None:
    velocity = Vector3(speed * math.cos(heading), speed * math.sin(heading), 0.0)
    snapshot, motion = standing_at(at(2.5, 2.5), velocity)
    geofence, limits = GeofencePolicy(GeofenceSettings(polygon=tuple(L_SHAPE)), resolver()), Limits()
    change = Vector3(commanded * math.cos(commanded_heading), commanded * math.sin(commanded_heading), 0.0)
    try:
        geofence.require_velocity(change, limits, snapshot)
    except GeofenceError:
        return
    stop = Brake(motion, limits).end().position
    assert is_in_l(stop.x, stop.y) or (change - velocity).dot(velocity) < 0.0


def test_a_uav_that_flies_to_the_edge_may_slow_down_or_reverse_but_not_go_aside() -> None:
    geofence, limits = GeofencePolicy(GeofenceSettings(polygon=tuple(L_SHAPE)), resolver()), Limits()
    snapshot, _ = standing_at(at(8.0, 2.0), Vector3(3.0, 0.0, 0.0))  # too fast to stop inside
    for allowed in (Vector3(), Vector3(0.5, 0.0, 0.0), Vector3(-1.0, 0.0, 0.0), Vector3(-3.0, 0.0, 0.0)):
        geofence.require_velocity(allowed, limits, snapshot)
    for refused in (Vector3(0.0, 1.0, 0.0), Vector3(0.0, -0.1, 1.0), Vector3(3.0, 0.0, 0.0), Vector3(-0.1, 2.0, 0.0)):
        with pytest.raises(GeofenceError, match="would leave the geofence"):
            geofence.require_velocity(refused, limits, snapshot)


def test_a_uav_that_stands_at_the_edge_may_go_along_it_and_back_but_not_across_it() -> None:
    snapshot, _ = standing_at(at(9.99, 2.0))
    geofence, limits = GeofencePolicy(GeofenceSettings(polygon=tuple(L_SHAPE)), resolver()), Limits()
    geofence.require_velocity(Vector3(-1.0, 0.0, 0.0), limits, snapshot)
    geofence.require_velocity(Vector3(0.0, 0.5, 0.0), limits, snapshot)
    with pytest.raises(GeofenceError, match="would leave the geofence"):
        geofence.require_velocity(Vector3(0.5, 0.0, 0.0), limits, snapshot)


def test_a_uav_outside_may_only_come_back() -> None:
    snapshot, _ = standing_at(at(60.0, 2.0))
    geofence, limits = GeofencePolicy(GeofenceSettings(polygon=tuple(L_SHAPE)), resolver()), Limits()
    geofence.require_velocity(Vector3(-1.0, 0.0, 0.0), limits, snapshot)
    geofence.require_velocity(Vector3(), limits, snapshot)
    with pytest.raises(GeofenceError):
        geofence.require_velocity(Vector3(1.0, 0.0, 0.0), limits, snapshot)


def test_only_a_trajectory_that_begins_inside_leaves() -> None:
    """A UAV outside brakes where it is."""
    geofence, limits = GeofencePolicy(GeofenceSettings(polygon=tuple(L_SHAPE)), resolver()), Limits()
    for x, leaves_it in ((5.0, False), (9.9, True), (12.0, False), (-3.0, False)):
        snapshot, motion = standing_at(at(x, 2.0), Vector3(1.0, 0.0, 0.0))
        assert geofence.is_left_by(Brake(motion, limits), limits, snapshot) == leaves_it


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        (GeofenceSettings(), "geofence"),
        (GeofenceSettings(polygon=((0.0, 0.0), (1.0, 1.0))), "geofence.polygon"),
        (GeofenceSettings(polygon=((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0))), "geofence"),
        (GeofenceSettings(polygon=((0.0, 0.0), (1.0, 1.0), (2.0, 2.0))), "geofence"),
        (GeofenceSettings(polygon=tuple(L_SHAPE), polygon_geo=((0.0, 0.0),) * 3), "geofence.polygon_geo"),
        (GeofenceSettings(min_height_m=3.0, max_height_m=3.0), "geofence.max_height_m"),
        (GeofenceSettings(frame_id="nowhere", max_height_m=3.0), "geofence.frame_id"),
        (GeofenceSettings(frame_id="uav_1/base_link", max_height_m=3.0), "geofence.frame_id"),
    ],
)
def test_settings_that_make_no_fence_are_refused_at_the_start(settings: GeofenceSettings, key: str) -> None:
    with pytest.raises(ConfigError) as caught:
        GeofencePolicy(settings, resolver())
    assert caught.value.key == key
