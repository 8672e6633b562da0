"""One point of ``map`` is one place on Earth, for each UAV, whatever its autopilot's own metres are."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import numbers
from tests.ual_daemon.frames.test_local_frame import FIX
from tests.ual_daemon.stepped import at as pose_at
from tests.ual_daemon.stepped import stepped
from ual.geometry import IDENTITY, PointStamped, Pose, PoseStamped, Transform, Twist, TwistStamped, Vector3
from ual.types import AltitudeReference, GeoWaypoint
from ual_daemon.backends.values import Condition, EarthReference, Estimator, MotionState, Sample, Snapshot
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.frames.odom_metres import EarthMetres
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.frames.tree import MAP
from ual_daemon.geodesy import EllipsoidProjection, FlatProjection, Projection, SphereProjection
from ual_daemon.settings import GeofenceSettings, VehicleSettings

KINDS = st.sampled_from([EllipsoidProjection, FlatProjection, SphereProjection])
LATITUDES = st.floats(-75.0, 75.0) | st.sampled_from([0.0, 50.0, 70.0])
LONGITUDES = st.floats(-180.0, 180.0)
NEAR = st.builds(Vector3, numbers(5_000.0), numbers(5_000.0), numbers(200.0))
GOAL = Vector3(300.0, 400.0, 20.0)
MEET_M = 0.01
_ORIGIN = Vector3()


class Placed:
    """The frames of a UAV whose autopilot's local frame has its origin somewhere in ``map``."""

    def __init__(
        self, kind: type[Projection], origin: tuple[float, float, float], place: Vector3, home: Vector3
    ) -> None:
        self.map = EllipsoidProjection(*origin)
        self.projection = kind(*_geo(self.map, place))
        self.frames = FrameResolver("uav_1", VehicleSettings(map_origin_geo=origin))
        self.frames.update(self.at())
        if home != Vector3():
            self.frames.set_home(home, self.at(), set_z=True)

    def at(self, local: Vector3 = _ORIGIN) -> Snapshot:
        return Snapshot(
            1.0,
            motion=MotionState(estimator=Sample(Estimator(True), 1.0), pose=Sample(Pose(local, IDENTITY), 1.0)),
            earth=EarthReference(projection=self.projection),
            condition=Condition(gps=FIX),
        )

    def to_local(self, position: Vector3, frame_id: str = MAP) -> Vector3:
        goal = self.frames.goal(PoseStamped(Pose(position, IDENTITY), frame_id), "waypoint")
        return self.frames.to_local(goal, self.at()).position

    def truth(self, local: Vector3) -> Vector3:
        """Returns the true position of a local one on Earth, in the ``map`` of the documentation."""
        geo = self.projection.to_geo(local)
        assert geo.altitude_amsl_m is not None
        return self.map.to_local(geo.latitude_deg, geo.longitude_deg, geo.altitude_amsl_m)

    def reported(self, local: Vector3) -> Vector3:
        return self.frames.transform(MAP, "uav_1/base_link", self.at(local)).translation


def _geo(projection: Projection, place: Vector3) -> tuple[float, float, float]:
    point = projection.to_geo(place)
    assert point.altitude_amsl_m is not None
    return point.latitude_deg, point.longitude_deg, point.altitude_amsl_m


@given(KINDS, LATITUDES, LONGITUDES, NEAR, NEAR, NEAR)
def test_a_goal_in_map_is_its_position_on_earth_and_is_reported_as_such(
    kind: type[Projection], latitude: float, longitude: float, place: Vector3, home: Vector3, goal: Vector3
) -> None:
    uav = Placed(kind, (latitude, longitude, 30.0), place, home * 0.1)
    local = uav.to_local(goal)
    assert (uav.truth(local) - goal).norm() <= MEET_M
    assert (uav.reported(local) - goal).norm() <= MEET_M
    assert uav.truth(local).z == pytest.approx(goal.z, abs=1e-6)


@given(KINDS, KINDS, LATITUDES, LONGITUDES, NEAR, NEAR, NEAR)
def test_two_uavs_meet(
    kind: type[Projection],
    other: type[Projection],
    latitude: float,
    longitude: float,
    place: Vector3,
    gap: Vector3,
    goal: Vector3,
) -> None:
    """Whatever their autopilots and their homes are."""
    uavs = [Placed(each, (latitude, longitude, 30.0), at, Vector3()) for each, at in ((kind, place), (other, gap))]
    first, second = (uav.truth(uav.to_local(goal)) for uav in uavs)
    assert (first - second).norm() <= 2.0 * MEET_M


@pytest.mark.parametrize("latitude", [0.0, 50.0, 70.0])
@pytest.mark.parametrize("kind", [EllipsoidProjection, FlatProjection, SphereProjection])
def test_uavs_5_km_apart_meet_at_the_point_of_the_report(kind: type[Projection], latitude: float) -> None:
    origin = (latitude, 8.0, 488.0)
    for place in (Vector3(), Vector3(5_000.0, 0.0, 40.0), Vector3(500.0, 0.0, 0.0)):
        uav = Placed(kind, origin, place, Vector3())
        local = uav.to_local(GOAL)
        assert (uav.truth(local) - GOAL).norm() <= MEET_M
        assert (uav.reported(local) - GOAL).norm() <= MEET_M


@given(KINDS, st.floats(-89.0, 89.0), NEAR, NEAR)
def test_metres_of_odom_become_local_and_again_metres_of_odom(
    kind: type[Projection], latitude: float, home: Vector3, position: Vector3
) -> None:
    metres = EarthMetres(kind(latitude, 179.999, 5.0), home)
    assert (metres.to_odom(metres.to_local(position)) - position).norm() <= 0.002
    assert metres.to_odom(home).norm() <= 1e-9


@pytest.mark.parametrize("far_m", [9_990.0, 10_010.0, 60_000.0])
def test_far_away_they_are_exact(far_m: float) -> None:
    projection = FlatProjection(60.0, 8.0, 5.0)
    found = EarthMetres(projection, Vector3()).to_odom(Vector3(far_m, -far_m, 3.0))
    geo = projection.to_geo(Vector3(far_m, -far_m, 3.0))
    there = EllipsoidProjection(60.0, 8.0, 5.0).to_local(geo.latitude_deg, geo.longitude_deg, 8.0)
    assert (found - there).norm() <= 0.001


@pytest.mark.parametrize("kind", [FlatProjection, SphereProjection])
def test_geographic_goals_are_reported_at_their_position_in_map(kind: type[Projection]) -> None:
    uav = Placed(kind, (50.0, 8.0, 30.0), Vector3(), Vector3())
    latitude, longitude, altitude = _geo(uav.map, GOAL)
    goal = GeoWaypoint(latitude, longitude, altitude, altitude_reference=AltitudeReference.AMSL)
    assert (uav.reported(uav.frames.geo_to_local(goal, uav.at()).position) - GOAL).norm() <= MEET_M


def test_velocities_and_headings_in_map_turn_by_the_convergence_of_the_meridians() -> None:
    """East of the origin, north of ``map`` is east of the autopilot's north."""
    uav = Placed(FlatProjection, (70.0, 8.0, 30.0), Vector3(5_000.0, 0.0, 0.0), Vector3())
    turn_rad = 5_000.0 * math.tan(math.radians(70.0)) / 6_390_000.0
    twist, frame_id = uav.frames.velocity(TwistStamped(Twist(Vector3(0.0, 1.0, 0.0)), MAP), "velocity")
    local = uav.frames.velocity_to_local(twist, frame_id, uav.at()).linear
    assert math.atan2(local.x, local.y) == pytest.approx(turn_rad, rel=0.01)
    goal = uav.frames.goal(PoseStamped(Pose(GOAL, IDENTITY), MAP), "waypoint")
    assert uav.frames.to_local(goal, uav.at()).yaw_rad == pytest.approx(-turn_rad, rel=0.01)


def test_a_frame_that_moves_in_map_is_followed_at_its_position_on_earth() -> None:
    uav = Placed(FlatProjection, (50.0, 8.0, 30.0), Vector3(5_000.0, 0.0, 0.0), Vector3())
    for time_s in (0.0, 0.1, 0.2):
        uav.frames.tree.add(Transform(GOAL + Vector3(time_s, 0.0, 0.0), IDENTITY, MAP, "ship"), time_s)
    goal = uav.frames.point(PointStamped(Vector3(), "ship"), "point")
    motion = uav.frames.moving_to_local(goal, 0.2, 0.0)
    assert (uav.truth(motion.position) - GOAL - Vector3(0.2, 0.0, 0.0)).norm() <= MEET_M
    assert motion.velocity.norm() > 0.0


def test_poses_from_outside_in_map_are_at_their_position_on_earth() -> None:
    uav = Placed(FlatProjection, (50.0, 8.0, 30.0), Vector3(2_000.0, 0.0, 0.0), Vector3())
    local = uav.frames.external_pose(PoseStamped(Pose(GOAL, IDENTITY), MAP), 1.0)
    assert (uav.truth(local.position) - GOAL).norm() <= MEET_M


@pytest.mark.parametrize("kind", [FlatProjection, SphereProjection])
def test_a_fence_in_map_is_one_position_on_earth(kind: type[Projection]) -> None:
    polygon = ((-900.0, -900.0), (900.0, -900.0), (900.0, 900.0), (-900.0, 900.0))
    settings = GeofenceSettings(polygon=polygon, frame_id=MAP, min_height_m=0.0, max_height_m=50.0)
    for place in (Vector3(), Vector3(-5_000.0, 0.0, 10.0)):
        uav = Placed(kind, (50.0, 8.0, 30.0), place, Vector3())
        fence = GeofencePolicy(settings, uav.frames).fence(uav.at())
        assert fence.lowest_m == pytest.approx(-place.z)
        for (x, y), corner in zip(polygon, fence.corners, strict=True):
            assert (uav.truth(Vector3(*corner, -place.z)) - Vector3(x, y, 0.0)).norm() <= 2.0 * MEET_M


@pytest.mark.parametrize("latitude", [0.0, 50.0, 70.0])
def test_simulated_uavs_whose_local_frames_are_5_km_apart_meet(latitude: float) -> None:
    origin = EllipsoidProjection(latitude, 8.0, 20.0)
    settings = VehicleSettings(map_origin_geo=(latitude, 8.0, 20.0), pose_frame_id=MAP)
    told, truths = [], []
    for place in (Vector3(), Vector3(5_000.0, 0.0, 0.0)):
        start = [320.0 - place.x, 410.0, 0.0]
        with stepped(settings, light={"origin_geo": list(_geo(origin, place)), "start": start}) as uav:
            uav.fly()
            uav.end(uav.prepare.go_to_waypoint(pose_at(300.0, 400.0, 20.0, None, MAP)).begin().future)
            uav.run(3.0)
            there = uav.vehicle.telemetry().position_geo
            assert there is not None
            assert there.altitude_amsl_m is not None
            truths.append(origin.to_local(there.latitude_deg, there.longitude_deg, there.altitude_amsl_m))
            told.append(uav.pose.position)
    assert (truths[0] - truths[1]).norm() <= 0.05
    for truth, said in zip(truths, told, strict=True):
        assert (truth - said).norm() <= 0.05
