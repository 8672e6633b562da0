"""A commanded velocity is admitted by numbers and convex parts of the fence: as by the rule itself, never otherwise."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.snapshots import changed
from tests.strategies import vectors
from tests.ual_daemon.flight.policy import exact_rule
from tests.ual_daemon.trajectory.trajectories import LIMIT_SETS
from tests.work.counting import counted
from ual.errors import GeofenceError
from ual.geometry import IDENTITY, Pose, Twist, Vector3
from ual.types import GeoPoint, Limits, State
from ual_daemon.backends.values import (
    AutopilotFence,
    EarthReference,
    FenceLimit,
    LandedState,
    MotionState,
    Sample,
    Snapshot,
    Zone,
)
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.reachable_points import reachable_points
from ual_daemon.flight.state import Estimate
from ual_daemon.frames.fence import Fence
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.geodesy import FlatProjection
from ual_daemon.settings import GeofenceSettings, VehicleSettings
from ual_daemon.tracker.references import Hold
from ual_daemon.trajectory import Motion

ORIGIN = FlatProjection(47.4, 8.5, 488.0)
FLOOR_M, CEILING_M = 0.0, 25.0
L_SHAPE = ((-10.0, -10.0), (20.0, -10.0), (20.0, 5.0), (5.0, 5.0), (5.0, 20.0), (-10.0, 20.0))
CLOSE_M = 1e-6
"""A part of the fence ends so far before the edge; the rule is asked beyond it."""


def geo(x: float, y: float) -> tuple[float, float]:
    place = ORIGIN.to_geo(Vector3(x, y, 0.0))
    return place.latitude_deg, place.longitude_deg


def box(x0: float, y0: float, x1: float, y1: float) -> tuple[tuple[float, float], ...]:
    return tuple(geo(x, y) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


FIELD = Zone("field", True, box(-25.0, -25.0, 25.0, 25.0))
HOLES = tuple(Zone(f"hole {x}", False, box(x, -4.0, x + 3.0, 4.0)) for x in (-12.0, -3.0, 8.0))
POND = Zone("pond", False, (geo(3.0, 14.0),), 5.0)
OWN_FENCES = (
    AutopilotFence(zones=(FIELD, *HOLES, POND)),
    AutopilotFence(zones=(*HOLES, POND)),
    AutopilotFence(FenceLimit(22.0, "RADIUS"), FenceLimit(18.0, "HIGHEST"), FenceLimit(2.0, "LOWEST")),
    AutopilotFence(FenceLimit(22.0, "RADIUS"), zones=HOLES),
    None,
)
CONFIGURED = (GeofenceSettings(polygon=L_SHAPE, min_height_m=1.0, max_height_m=15.0), None)


class Moment(NamedTuple):
    """State when a velocity is commanded."""

    here: Vector3
    own: Vector3
    velocity: Vector3

    def snapshot(self, autopilot_fence: AutopilotFence | None) -> Snapshot:
        return Snapshot(
            0.0,
            autopilot_fence=autopilot_fence,
            motion=MotionState(pose=Sample(Pose(self.here, IDENTITY), 0.0), velocity=Sample(Twist(self.own), 0.0)),
            earth=EarthReference(
                projection=ORIGIN, home_geo=GeoPoint(*geo(0.0, 0.0), 488.0), home_altitude_amsl_m=488.0
            ),
        )


moments = st.builds(
    Moment,
    st.builds(Vector3, st.floats(-28.0, 28.0), st.floats(-28.0, 28.0), st.floats(-1.0, 27.0)),
    vectors(8.0),
    vectors(8.0),
)
steps = st.builds(Moment, vectors(1.5), vectors(1.0), vectors(2.0))


@st.composite
def flights(draw: st.DrawFn) -> list[Moment]:
    """A stream of setpoints: the UAV flies on, and what is commanded changes, or not."""
    flight = [draw(moments)]
    for step in draw(st.lists(steps, max_size=12)):
        last = flight[-1]
        velocity = last.velocity if draw(st.booleans()) else last.velocity + step.velocity
        flight.append(Moment(last.here + step.here, last.own + step.own, velocity))
    return flight


def geofence(settings: GeofenceSettings | None, clearance_m: float = 0.0) -> GeofencePolicy:
    resolver = FrameResolver("uav_1", VehicleSettings(geofence=settings))
    found = GeofencePolicy(settings, resolver, FLOOR_M, CEILING_M, clearance_m)
    ground = changed(Moment(Vector3(), Vector3(), Vector3()).snapshot(None), landed=Sample(LandedState.ON_GROUND, 0.0))
    found.observe(ground, Estimate(State.LANDED_ARMED, ""))
    return found


def is_close(fence: Fence, moment: Moment, limits: Limits) -> bool:
    """Returns whether the answer depends on roundings: a corner of a way is right at an edge."""
    return is_near(fence, *(Vector3(*point) for point in reachable_points(*moment, limits)))


def is_near(fence: Fence, *points: Vector3) -> bool:
    return any(abs(fence.signed_distance_m(point)) < CLOSE_M for point in points)


@pytest.mark.parametrize("settings", CONFIGURED)
@pytest.mark.parametrize("autopilot_fence", OWN_FENCES)
@pytest.mark.parametrize("clearance_m", [0.5, 0.0])
@given(flight=flights(), limits=LIMIT_SETS | st.just(Limits()))
def test_a_velocity_is_admitted_where_the_rule_admits_it_and_nowhere_else(
    settings: GeofenceSettings | None,
    autopilot_fence: AutopilotFence | None,
    clearance_m: float,
    flight: list[Moment],
    limits: Limits,
) -> None:
    tested = geofence(settings, clearance_m)
    for moment in flight:
        snapshot = moment.snapshot(autopilot_fence)
        fence, motion = tested._now(snapshot).low_fence, Motion(moment.here, 0.0, moment.own)
        band = (FLOOR_M + clearance_m, CEILING_M)
        given_m = min(0.1, clearance_m / 2.0)
        expected = exact_rule.is_admitted(fence, band, motion, moment.velocity, limits, given_m)
        for _ in range(2):  # the second time it may be known already
            try:
                tested.require_velocity(moment.velocity, limits, snapshot)
                is_admitted = True
            except GeofenceError:
                is_admitted = False
            assert is_admitted == expected or is_close(fence, moment, limits)


@pytest.mark.parametrize("settings", CONFIGURED)
@pytest.mark.parametrize("autopilot_fence", OWN_FENCES)
@given(flight=flights(), goals=st.lists(vectors(6.0), min_size=13, max_size=13))
def test_a_goal_is_admitted_where_the_straight_path_to_it_is_inside(
    settings: GeofenceSettings | None,
    autopilot_fence: AutopilotFence | None,
    flight: list[Moment],
    goals: list[Vector3],
) -> None:
    """Between velocities, which may lead lower than a goal."""
    tested, limits = geofence(settings, 0.5), Limits()
    for moment, offset in zip(flight, goals, strict=False):
        snapshot, goal = moment.snapshot(autopilot_fence), moment.here + offset
        with suppress(GeofenceError):
            tested.require_velocity(moment.velocity, limits, snapshot)
        expected = tested.fence(snapshot).exit([moment.here, goal]) is None
        for _ in range(2):
            try:
                tested.admit("set_pose", Hold(goal, 0.0), limits, snapshot)
                is_admitted = True
            except GeofenceError:
                is_admitted = False
            assert is_admitted == expected or is_near(tested.fence(snapshot), moment.here, goal)


def test_a_hover_below_the_clearance_is_executed_without_asking_for_polygons_each_time() -> None:
    tested, limits = geofence(CONFIGURED[0], 3.0), Limits()
    low = changed(HIGH, pose=Sample(Pose(Vector3(0.0, 0.0, 1.5), IDENTITY), 0.0))
    tested.require_velocity(Vector3(1.0, 0.0, 0.0), limits, low)
    asked = counted(lambda: tested.require_velocity(Vector3(0.0, 1.0, 0.0), limits, low))
    assert asked.calls < 40
    with pytest.raises(GeofenceError):
        tested.admit("set_pose", Hold(Vector3(1.0, 0.0, 1.5), 0.0), limits, low)


@given(moment=moments, limits=LIMIT_SETS)
def test_the_distance_limit_is_where_the_planned_trajectories_lead(moment: Moment, limits: Limits) -> None:
    if moment.velocity.norm() < 1e-9:
        return
    ways = exact_rule.variants(Motion(moment.here, 0.0, moment.own), moment.velocity, limits)
    expected = (moment.here, ways.commanded[-1], ways.own[-1], *ways.changed[1:])
    for point, planned in zip(reachable_points(*moment, limits), expected, strict=True):
        assert math.dist(point, tuple(planned)) <= 1e-9 * (1.0 + math.dist(tuple(planned), tuple(moment.here)))


# --- What is kept is forgotten when anything changes ------------------------------------------------------------------

HIGH = Moment(Vector3(0.0, 6.0, 10.0), Vector3(), Vector3(0.0, 0.5, 0.0)).snapshot(None)
ON_GROUND = changed(HIGH, landed=Sample(LandedState.ON_GROUND, 0.0), home_geo=None)
BESIDE = Pose(Vector3(0.0, -20.0, 10.0), IDENTITY)
FAR_HOME = GeoPoint(*geo(0.0, -20.0), 488.0)
DISC = AutopilotFence(FenceLimit(22.0, "RADIUS"), FenceLimit(15.0, "HIGHEST"))
CAGE = AutopilotFence(zones=(Zone("cage", True, box(-9.0, -9.0, 9.0, 7.0)),))
CHANGES = {
    "a fence appears": (HIGH, HIGH._replace(autopilot_fence=CAGE)),
    "another fence": (HIGH._replace(autopilot_fence=OWN_FENCES[1]), HIGH._replace(autopilot_fence=CAGE)),
    "home moves": (HIGH._replace(autopilot_fence=DISC), changed(HIGH, autopilot_fence=DISC, home_geo=FAR_HOME)),
    "home sinks": (
        HIGH._replace(autopilot_fence=DISC),
        changed(HIGH, autopilot_fence=DISC, home_altitude_amsl_m=483.0),
    ),
    "it stands elsewhere": (
        changed(ON_GROUND, autopilot_fence=DISC, pose=Sample(BESIDE, 0.0)),
        ON_GROUND._replace(autopilot_fence=DISC),
    ),
    "the origin moves": (
        HIGH._replace(autopilot_fence=CAGE),
        changed(HIGH, autopilot_fence=CAGE, projection=FlatProjection(47.4001, 8.5, 488.0)),
    ),
}


def bounds(fence: Fence) -> tuple[object, ...]:
    probes = [Vector3(x, y, 10.0) for x in range(-30, 31, 3) for y in range(-30, 31, 3)]
    return (fence.lowest_m, fence.highest_m, fence.disc, [fence.is_inside(probe) for probe in probes])


def is_refused(tested: GeofencePolicy, velocity: Vector3, snapshot: Snapshot) -> bool:
    try:
        tested.require_velocity(velocity, Limits(), snapshot)
    except GeofenceError:
        return True
    return False


@pytest.mark.parametrize("change", CHANGES)
def test_what_was_kept_is_forgotten_when_anything_changes(change: str) -> None:
    before, after = CHANGES[change]
    tested, fresh = geofence(None), geofence(None)
    slow = Vector3(0.0, 0.5, 0.0)
    for _ in range(2):
        is_refused(tested, slow, before)
    assert bounds(tested.fence(before)) != bounds(fresh.fence(after))
    assert bounds(tested.fence(after)) == bounds(fresh.fence(after))
    for velocity in (slow, Vector3(0.0, -0.5, 0.0), Vector3(0.0, 0.0, 0.5), Vector3(6.0, 0.0, 0.0)):
        assert is_refused(tested, velocity, after) == is_refused(fresh, velocity, after)


def test_a_part_of_a_fence_is_no_part_of_another_one() -> None:
    tested, north = geofence(None), Vector3(0.0, 2.0, 0.0)
    assert not is_refused(tested, north, HIGH)
    assert is_refused(tested, north, HIGH._replace(autopilot_fence=CAGE))
    assert not is_refused(tested, north, HIGH)


def test_what_was_admitted_outside_of_one_fence_is_not_within_another_one() -> None:
    """Outside of the first it leads back; out of the second it leads."""
    tested = geofence(None)
    first = HIGH._replace(autopilot_fence=AutopilotFence(zones=(Zone("north", True, box(-20.0, 9.0, 20.0, 40.0)),)))
    north = Vector3(0.0, 2.0, 0.0)
    assert not is_refused(tested, north, first)
    assert is_refused(tested, north, HIGH._replace(autopilot_fence=CAGE))


def test_the_floor_and_the_ceiling_follow_the_ground() -> None:
    tested = geofence(None)
    down = Vector3(0.0, 0.0, -1.0)
    assert not is_refused(tested, down, HIGH)
    high = changed(HIGH, pose=Sample(Pose(Vector3(0.0, 0.0, 9.5), IDENTITY), 0.0))
    ground = changed(high, landed=Sample(LandedState.ON_GROUND, 0.0))
    tested.observe(ground, Estimate(State.LANDED_ARMED, ""))
    assert is_refused(tested, down, HIGH)


def test_a_fence_below_map_follows_odom_in_map() -> None:
    frames = FrameResolver("uav_1", VehicleSettings(map_origin_geo=(47.4, 8.5, 488.0)))
    tested = GeofencePolicy(GeofenceSettings(polygon=L_SHAPE, frame_id="map"), frames)
    frames.tree.set_home(Vector3())
    assert tested.fence(HIGH).is_inside(Vector3(19.0, 0.0, 10.0))
    frames.tree.set_home(Vector3(5.0, 0.0, 0.0))  # the autopilot's origin moved, and nothing tied home
    assert not tested.fence(HIGH).is_inside(Vector3(19.0, 0.0, 10.0))
