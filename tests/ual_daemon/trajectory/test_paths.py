"""Paths through many waypoints: corners, stops, speeds, and what is told of the way."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from tests.ual_daemon.trajectory.trajectories import (
    LIMIT_SETS,
    assert_kept,
    assert_rests_at,
    assert_straight_between_bends,
    distance_from_path,
    moments,
    sampled,
    waypoints,
)
from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.trajectory import Chain, Motion, PathWaypoint, Run, StraightTrajectory, Trajectory, path, speed_limit

LIMITS = Limits()


PATHS = st.lists(
    st.builds(PathWaypoint, vectors(30.0), st.none() | ANGLES, st.none() | st.floats(0.2, 20.0)), min_size=1, max_size=6
)
RADII = st.sampled_from([0.0, 0.05, 1.0, 20.0])


@given(vectors(30.0), ANGLES, PATHS, st.sampled_from([0.0, 0.05, 1.0, 20.0]), LIMIT_SETS)
def test_a_path_from_rest_passes_its_waypoints_within_radius_and_limits(
    start: Vector3, yaw: float, goals: list[PathWaypoint], radius_m: float, limits: Limits
) -> None:
    found = path(Motion(start, yaw), goals, radius_m, limits)
    points = [start, *(goal.position for goal in goals)]
    headings = [yaw]
    for goal in goals:
        headings.append(headings[-1] if goal.yaw_rad is None else goal.yaw_rad)

    assert (found.at(0.0).position - start).norm() <= 1e-9
    assert_rests_at(found.end(), points[-1], headings[-1])
    assert found.at(found.duration_s + 10.0) == found.end()

    closest = [math.inf] * len(points)
    count = 600
    gap_m = found.duration_s / count * speed_limit(Vector3(1, 0, 0), limits) * 2 + 1e-6
    for _, motion in moments(found, count):
        assert distance_from_path(motion.position, points) <= radius_m + 1e-6
        closest = [min(c, (motion.position - point).norm()) for c, point in zip(closest, points, strict=True)]
    # An arc within the radius passes its corner within the radius.
    assert max(closest) <= radius_m + gap_m
    assert_kept(sampled(found), limits)
    assert_straight_between_bends(found)


@given(vectors(30.0), PATHS, st.sampled_from([0.0, 1.0, 20.0]))
def test_the_path_left_only_shrinks_and_waypoints_come_in_order(
    start: Vector3, goals: list[PathWaypoint], radius_m: float
) -> None:
    found = path(Motion(start, 0.0), goals, radius_m, LIMITS)
    left = [found.length_left_m(time_s) for time_s, _ in moments(found)]
    assert left[0] == pytest.approx(found.length_m, abs=1e-6)
    assert left[-1] == pytest.approx(0.0, abs=1e-6)
    assert all(later <= earlier + 1e-6 for earlier, later in itertools.pairwise(left))
    numbers = [found.waypoint_at(time_s) for time_s, _ in moments(found)]
    assert numbers == sorted(numbers)
    assert numbers[-1] == len(goals) - 1
    assert numbers[0] == 0 or goals[0].position == start


@given(vectors(30.0), vectors(30.0), st.floats(0.0, 1.0), PATHS, RADII, LIMIT_SETS)
def test_a_path_that_is_commanded_in_flight_begins_with_that_motion_and_keeps_the_limits(
    start: Vector3, way: Vector3, share: float, goals: list[PathWaypoint], radius_m: float, limits: Limits
) -> None:
    line = StraightTrajectory(Motion(start, 0.0), start + way, 1.0, limits)
    now = line.at(share * line.duration_s)
    found = path(now, goals, radius_m, limits)
    first = found.at(0.0)
    assert (first.velocity - now.velocity).norm() <= 1e-9
    assert (first.acceleration - now.acceleration).norm() <= 1e-9
    assert found.end().position == goals[-1].position
    assert found.end().velocity.norm() == 0.0
    assert_kept(sampled(found), limits, slack=1e-4)
    assert_straight_between_bends(found)


def test_a_path_that_is_commanded_in_flight_bends_to_its_first_leg_without_stopping() -> None:
    start = Motion(Vector3(), 0.0, Vector3(0.0, 1.5, 0.0))
    found = path(start, waypoints((20, 0, 0), (20, 20, 0)), 1.0, LIMITS)
    assert min(m.velocity.norm() for t, m in moments(found) if t < found.duration_s - 2.0) > 0.7
    assert min((m.position - Vector3(20, 0, 0)).norm() for _, m in moments(found, 2000)) <= 1.0


def test_without_a_radius_it_stops_at_each_corner() -> None:
    found = path(Motion(Vector3(), 0.0), waypoints((5, 0, 0), (5, 5, 0), (0, 5, 0)), 0.0, LIMITS)
    assert isinstance(found, Chain)
    slow = [m.position for _, m in moments(found, 2000) if m.velocity.norm() < 0.02]
    for corner in (Vector3(5, 0, 0), Vector3(5, 5, 0)):
        assert min((p - corner).norm() for p in slow) <= 0.02


def test_with_a_radius_it_never_stops_en_route_and_is_faster() -> None:
    goals = waypoints((5, 0, 0), (5, 5, 0), (0, 5, 0))
    rounded = path(Motion(Vector3(), 0.0), goals, 1.0, LIMITS)
    assert isinstance(rounded, Run)
    assert rounded.duration_s < path(Motion(Vector3(), 0.0), goals, 0.0, LIMITS).duration_s
    inner = [m.velocity.norm() for t, m in moments(rounded) if 1.0 < t < rounded.duration_s - 1.0]
    assert min(inner) > 0.5
    # It leaves the leg 1 m before the corner, and no sooner.
    places = [m.position for _, m in moments(rounded, 4000)]
    assert all(abs(p.y) < 1e-9 for p in places if p.x < 4.0 - 1e-6 and p.y < 1.0)
    assert any(p.y > 1e-6 for p in places if p.x < 4.1)


def test_a_waypoint_on_a_straight_path_is_passed_at_full_speed() -> None:
    found = path(Motion(Vector3(), 0.0), waypoints((10, 0, 0), (20, 0, 0)), 1.0, LIMITS)
    speed = next(m.velocity.norm() for _, m in moments(found, 2000) if m.position.x >= 10.0)
    assert speed == pytest.approx(LIMITS.horizontal_speed_m_s)


@pytest.mark.parametrize("radius_m", [0.0, 1.0])
@pytest.mark.parametrize(
    "places",
    [
        [(5, 0, 0), (5, 0, 0), (5, 5, 0)],
        [(0, 0, 0), (0, 0, 0)],
        [(5, 0, 0), (0, 0, 0), (5, 0, 0)],
        [(5, 0, 0), (1, 0.01, 0), (5, 0, 0)],
        [(0, 0, 5), (0, 0, 0), (0, 0, 5)],
        [(1e-4, 0, 0), (2e-4, 1e-4, 0), (3, 3, 3)],
        [(5, 0, 0), (5, 1e-9, 0), (5, 5, 0)],
    ],
)
def test_duplicates_and_reversals_are_executed_with_stops(
    places: list[tuple[float, float, float]], radius_m: float
) -> None:
    found = path(Motion(Vector3(), 0.0), waypoints(*places), radius_m, LIMITS)
    assert_rests_at(found.end(), Vector3(*places[-1]), 0.0)
    assert_kept(sampled(found), LIMITS)
    numbers = [found.waypoint_at(time_s) for time_s, _ in moments(found)]
    assert numbers == sorted(numbers)
    assert numbers[-1] == len(places) - 1
    for place in places:
        assert min((m.position - Vector3(*place)).norm() for _, m in moments(found, 2000)) <= radius_m * 0.5 + 0.01


def test_a_turn_on_the_spot_within_a_path_is_made_standing() -> None:
    goals = [PathWaypoint(Vector3(3, 0, 0)), PathWaypoint(Vector3(3, 0, 0), 2.0), PathWaypoint(Vector3(3, 3, 0))]
    found = path(Motion(Vector3(), 0.0), goals, 1.0, LIMITS)
    for _, motion in moments(found, 1000):
        if motion.yaw_rate_rad_s > 1e-6:
            assert motion.position == Vector3(3, 0, 0)
    assert_rests_at(found.end(), Vector3(3, 3, 0), 2.0)
    assert_kept(sampled(found), LIMITS)


def test_a_heading_that_is_not_passed_is_the_one_before() -> None:
    goals = [PathWaypoint(Vector3(5, 0, 0), 1.0), PathWaypoint(Vector3(5, 5, 0)), PathWaypoint(Vector3(0, 5, 0), -1.0)]
    found = path(Motion(Vector3(), 0.5), goals, 0.0, LIMITS)
    at_corners = [found.at(time_s).yaw_rad for time_s in corner_times(found, [goal.position for goal in goals])]
    assert at_corners == pytest.approx([1.0, 1.0, -1.0], abs=0.01)


def corner_times(found: Trajectory, corners: Sequence[Vector3]) -> list[float]:
    samples = list(moments(found, 2000))
    return [min(samples, key=lambda sample: (sample[1].position - corner).norm())[0] for corner in corners]


def test_a_path_of_many_waypoints_is_as_good_as_one_of_few() -> None:
    circle = [(10 * math.cos(i / 50), 10 * math.sin(i / 50), i / 100) for i in range(1, 315)]
    found = path(Motion(Vector3(10, 0, 0), 0.0), waypoints(*circle), 0.5, LIMITS)
    assert_kept(sampled(found), LIMITS)
    assert found.duration_s == pytest.approx(found.length_m / LIMITS.horizontal_speed_m_s, rel=0.05)
    for _, motion in moments(found, 2000):
        assert motion.position.horizontal_norm() == pytest.approx(10.0, abs=0.05)


def test_corners_keep_the_limits_that_arcs_would_break() -> None:
    found = path(Motion(Vector3(), 0.0), waypoints((5, 0, 0), (5, 5, 0), (0, 5, 5), (0, 0, 0)), 2.0, LIMITS)
    assert_kept(sampled(found), LIMITS)


def test_a_rounded_path_is_about_as_fast_as_one_of_arcs() -> None:
    # Arcs of 1 m radius at 90 % of the acceleration, with a step of it at both ends: 11.3 s (measured before).
    found = path(Motion(Vector3(), 0.0), waypoints((5, 0, 0), (5, 5, 0), (0, 5, 0)), 1.0, LIMITS)
    assert found.duration_s < 11.3


def test_each_leg_keeps_its_own_speed_limit() -> None:
    goals = [
        PathWaypoint(Vector3(10, 0, 0)),
        PathWaypoint(Vector3(20, 0, 0), None, 0.5),
        PathWaypoint(Vector3(20, 10, 0)),
    ]
    found = path(Motion(Vector3(), 0.0), goals, 1.0, LIMITS)
    fastest = [0.0, 0.0, 0.0]
    for time_s, motion in moments(found, 3000):
        leg = found.waypoint_at(time_s)
        if min((motion.position - goal.position).norm() for goal in goals) > 0.01:
            fastest[leg] = max(fastest[leg], motion.velocity.norm())
    assert fastest == pytest.approx([1.6, 0.5, 1.6], abs=0.01)
    single = path(Motion(Vector3(), 0.0), [PathWaypoint(Vector3(10, 0, 0), None, 0.7)], 0.0, LIMITS)
    assert max(m.velocity.norm() for _, m in moments(single)) == pytest.approx(0.7)


def test_points_of_a_recorded_track_are_no_corners() -> None:
    dense = [PathWaypoint(Vector3(0.05 * i, 0.01 * math.sin(i), 0.0)) for i in range(1, 401)]
    found = path(Motion(Vector3(), 0.0), dense, 1.0, LIMITS)
    straight = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(20.0, 0.0, 0.0), 0.0, LIMITS)
    assert found.duration_s < 1.02 * straight.duration_s
    assert_kept(sampled(found), LIMITS)
    # Each waypoint is passed, and told, in its place.
    for time_s, motion in moments(found, 500):
        if 2.0 < time_s < found.duration_s - 2.0:
            assert found.waypoint_at(time_s) == pytest.approx(motion.position.x / 0.05, abs=10.0)


def test_planning_takes_as_long_as_the_path_has_waypoints() -> None:
    def planning_s(count: int) -> float:
        goals = waypoints(*((3.0 * i, 4.0 * (i % 2), 5.0) for i in range(1, count + 1)))
        times = []
        for _ in range(3):
            begin_s = time.process_time()
            path(Motion(Vector3(), 0.0), goals, 1.0, LIMITS)
            times.append(time.process_time() - begin_s)
        return min(times)

    assert planning_s(4000) < 20 * planning_s(500)  # 8 times, and room for a busy machine
