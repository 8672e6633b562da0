"""Heading of the nose on a path."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from tests.ual_daemon.trajectory.trajectories import (
    LIMIT_SETS,
    assert_kept,
    assert_rests_at,
    moments,
    sampled,
    waypoints,
)
from ual.errors import InvalidArgumentError
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits, PathHeading
from ual_daemon.trajectory import Motion, PathWaypoint, StraightTrajectory, Trajectory, path

LIMITS = Limits()
SQUARE = waypoints((10, 0, 0), (10, 10, 0), (0, 10, 0), (0, 0, 0))
PATHS = st.lists(st.builds(PathWaypoint, vectors(20.0), st.none() | ANGLES), min_size=1, max_size=6)


def off(motion: Motion, yaw_rad: float) -> float:
    return abs(wrap_angle(motion.yaw_rad - yaw_rad))


def along(motion: Motion) -> float:
    return math.atan2(motion.velocity.y, motion.velocity.x)


def facing(motion: Motion, point: Vector3) -> float:
    return math.atan2(point.y - motion.position.y, point.x - motion.position.x)


@given(
    st.sampled_from(PathHeading),
    vectors(20.0),
    ANGLES,
    vectors(20.0),
    st.floats(0.0, 1.0),
    PATHS,
    st.sampled_from([0.0, 0.05, 1.0, 20.0]),
    vectors(20.0),
    st.none() | st.integers(0, 5),
    LIMIT_SETS,
)
def test_every_heading_keeps_the_limits_from_any_start(
    heading: PathHeading,
    start: Vector3,
    yaw: float,
    way: Vector3,
    share: float,
    goals: list[PathWaypoint],
    radius_m: float,
    point: Vector3,
    over: int | None,
    limits: Limits,
) -> None:
    line = StraightTrajectory(Motion(start, yaw), start + way, 1.0, limits)
    now = line.at(share * line.duration_s)
    if over is not None:  # right above the point
        point = goals[over % len(goals)].position
    found = path(now, goals, radius_m, limits, heading, point)
    first, last = found.at(0.0), found.end()
    assert (first.position - now.position).norm() <= 1e-9
    assert wrap_angle(first.yaw_rad - now.yaw_rad) == pytest.approx(0.0, abs=1e-9)
    assert first.yaw_rate_rad_s == pytest.approx(now.yaw_rate_rad_s, abs=1e-9)
    assert_rests_at(last, goals[-1].position, last.yaw_rad)
    assert_kept(sampled(found), limits, slack=1e-4)


@pytest.mark.parametrize("radius_m", [0.0, 1.0])
def test_by_waypoints_it_turns_in_step_with_each_leg(radius_m: float) -> None:
    goals = [
        PathWaypoint(Vector3(10, 0, 0), 1.0),
        PathWaypoint(Vector3(10, 10, 0)),
        PathWaypoint(Vector3(0, 10, 0), -1.0),
    ]
    found = path(Motion(Vector3(), 0.5), goals, radius_m, LIMITS)
    for goal, yaw in zip(goals, (1.0, 1.0, -1.0), strict=True):
        nearest = min((m for _, m in moments(found, 4000)), key=lambda m: (m.position - goal.position).norm())
        assert off(nearest, yaw) <= 0.05
    halfway = min((m for _, m in moments(found, 4000)), key=lambda m: (m.position - Vector3(5, 0, 0)).norm())
    assert halfway.yaw_rad == pytest.approx(0.75, abs=0.05)


def test_a_leg_that_is_too_short_for_its_turn_is_executed_slower() -> None:
    turning = [PathWaypoint(Vector3(2.0 * i, 0, 0), 2.0 * (i % 2)) for i in range(1, 6)]
    found = path(Motion(Vector3(), 0.0), turning, 0.5, LIMITS)
    straight = path(Motion(Vector3(), 0.0), [PathWaypoint(goal.position) for goal in turning], 0.5, LIMITS)
    assert found.duration_s > 1.5 * straight.duration_s
    assert_kept(sampled(found), LIMITS)


def test_a_fixed_heading_stays_and_a_turn_that_the_start_is_in_ends() -> None:
    goals = [PathWaypoint(goal.position, 2.0) for goal in SQUARE]
    for radius_m in (0.0, 1.0):
        found = path(Motion(Vector3(), 0.5), goals, radius_m, LIMITS, PathHeading.FIXED)
        assert all(off(m, 0.5) == 0.0 for _, m in moments(found))
        turning = Motion(Vector3(), 0.5, yaw_rate_rad_s=0.8)
        found = path(turning, goals, radius_m, LIMITS, PathHeading.FIXED)
        assert 0.05 < off(found.end(), 0.5) < 1.0
        assert all(off(m, found.end().yaw_rad) == 0.0 for t, m in moments(found) if t > 2.0)


@pytest.mark.parametrize("radius_m", [0.0, 1.0])
def test_along_the_path_the_nose_points_where_it_flies(radius_m: float) -> None:
    found = path(Motion(Vector3(), 2.0), SQUARE, radius_m, LIMITS, PathHeading.ALONG_PATH)
    fast = [m for _, m in moments(found, 2000) if m.velocity.norm() > 0.05]
    assert max(off(m, along(m)) for m in fast) <= (0.6 if radius_m else 1e-6)
    straight = [m for m in fast if abs(m.acceleration.dot(Vector3(-m.velocity.y, m.velocity.x))) < 1e-9]
    assert len(straight) > len(fast) / 2
    assert sum(off(m, along(m)) <= 0.02 for m in straight) >= 0.8 * len(straight)


def test_along_the_path_it_turns_standing_where_it_starts() -> None:
    found = path(Motion(Vector3(), 2.0), SQUARE, 1.0, LIMITS, PathHeading.ALONG_PATH)
    begun = next(m for _, m in moments(found, 2000) if m.velocity.norm() > 1e-3)
    assert off(begun, 0.0) <= 1e-6
    assert list(found.stops_s) == []  # a turn where it stands is no waypoint to wait at


def test_along_a_vertical_leg_the_heading_stays() -> None:
    up = waypoints((5, 0, 0), (5, 0, 5), (5, 5, 5))
    found = path(Motion(Vector3(), 0.0), up, 0.5, LIMITS, PathHeading.ALONG_PATH)
    for _, motion in moments(found):
        if abs(motion.velocity.z) > 0.5 and motion.velocity.horizontal_norm() < 1e-6:
            assert motion.yaw_rad == pytest.approx(0.0, abs=1.6)
    middle = min((m for _, m in moments(found, 2000)), key=lambda m: abs(m.position.z - 2.5))
    assert middle.yaw_rad == pytest.approx(0.0, abs=0.05)


def test_along_a_circle_of_many_waypoints_it_turns_evenly() -> None:
    circle = [(8 * math.cos(i / 40), 8 * math.sin(i / 40), 0.0) for i in range(1, 251)]
    start = Motion(Vector3(8, 0, 0), math.pi / 2)
    found = path(start, waypoints(*circle), 1.0, LIMITS, PathHeading.ALONG_PATH)
    for time_s, motion in moments(found, 500):
        if 3.0 < time_s < found.duration_s - 3.0:
            assert off(motion, along(motion)) <= 0.15
    assert found.duration_s == pytest.approx(found.length_m / LIMITS.horizontal_speed_m_s, rel=0.1)


def test_the_point_of_interest_is_always_faced() -> None:
    point = Vector3(5, 4, 20)
    start = Motion(Vector3(), math.atan2(4, 5))
    for radius_m in (0.0, 1.0):
        found = path(start, SQUARE, radius_m, LIMITS, PathHeading.POINT_OF_INTEREST, point)
        assert max(off(m, facing(m, point)) for _, m in moments(found, 1000)) <= 1e-6


def test_a_start_that_points_elsewhere_turns_to_the_point_within_its_limits() -> None:
    point = Vector3(5, 5, 0)
    found = path(Motion(Vector3(), -2.0), SQUARE, 1.0, LIMITS, PathHeading.POINT_OF_INTEREST, point)
    late = [m for t, m in moments(found, 1000) if t > 6.5]
    assert max(off(m, facing(m, point)) for m in late) <= 1e-6


@pytest.mark.parametrize("aside_m", [0.0, 1e-4, 0.01, 0.3])
def test_above_the_point_it_turns_smoothly_and_faces_it_again_soon(aside_m: float) -> None:
    point = Vector3(10, aside_m, 0)
    goals = waypoints((20, 0, 5))
    start = Motion(Vector3(0, 0, 5), math.atan2(aside_m, 10))
    found = path(start, goals, 1.0, LIMITS, PathHeading.POINT_OF_INTEREST, point)
    assert_kept(sampled(found), LIMITS)
    away = [m for _, m in moments(found, 1000) if abs(m.position.x - 10) > 8.0]
    assert max(off(m, facing(m, point)) for m in away) <= 1e-6


@given(vectors(20.0), ANGLES, PATHS, vectors(10.0))
def test_a_path_to_the_point_itself_ends_and_stands_still(
    start: Vector3, yaw: float, goals: list[PathWaypoint], point: Vector3
) -> None:
    assume((start - point).norm() > 0.1)
    found = path(Motion(start, yaw), [*goals, PathWaypoint(point)], 1.0, LIMITS, PathHeading.POINT_OF_INTEREST, point)
    assert_rests_at(found.end(), point, found.end().yaw_rad)
    assert_kept(sampled(found), LIMITS)


def test_a_point_of_interest_must_be_specified() -> None:
    with pytest.raises(InvalidArgumentError, match="point_of_interest"):
        path(Motion(Vector3(), 0.0), SQUARE, 1.0, LIMITS, PathHeading.POINT_OF_INTEREST)


def test_all_headings_take_the_same_manner() -> None:
    places: list[list[Vector3]] = []
    for heading in (PathHeading.WAYPOINTS, PathHeading.FIXED, PathHeading.POINT_OF_INTEREST):
        found: Trajectory = path(Motion(Vector3(), 0.0), SQUARE, 1.0, LIMITS, heading, Vector3(5, 5, 0))
        places.append([m.position for _, m in moments(found, 50)])
    assert places[0] == places[1] == places[2]
