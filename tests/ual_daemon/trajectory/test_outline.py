"""A trajectory as a line of points: near the way, with its ends, and never too many."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from tests.ual_daemon.trajectory.trajectories import LIMIT_SETS, distance_from_path, moments
from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.trajectory import Motion, PathWaypoint, StraightTrajectory, path
from ual_daemon.trajectory.outline import MOST_POINTS, outline

PATHS = st.lists(st.builds(PathWaypoint, vectors(30.0), st.none() | ANGLES), min_size=1, max_size=6)


@given(vectors(30.0), PATHS, st.sampled_from([0.0, 0.5, 3.0]), LIMIT_SETS)
def test_the_path_is_near_its_outline(
    start: Vector3, goals: list[PathWaypoint], radius_m: float, limits: Limits
) -> None:
    found = path(Motion(start, 0.0), goals, radius_m, limits)
    points = outline(found)
    assert (points[0] - start).norm() < 1e-9
    assert points[-1] == found.end().position
    assert all(distance_from_path(motion.position, [points[0], *points]) < 0.1 for _, motion in moments(found, 200))


@given(vectors(30.0), vectors(5.0), LIMIT_SETS)
def test_a_start_in_motion_bends(goal: Vector3, velocity: Vector3, limits: Limits) -> None:
    found = StraightTrajectory(Motion(Vector3(), 0.0, velocity), goal, 0.0, limits)
    points = outline(found)
    assert all(distance_from_path(motion.position, [points[0], *points]) < 0.1 for _, motion in moments(found, 200))


def test_a_path_has_two_points() -> None:
    assert outline(StraightTrajectory(Motion(Vector3(), 0.0), Vector3(5.0, 0.0, 1.0), 1.0, Limits())) == [
        Vector3(),
        Vector3(5.0, 0.0, 1.0),
    ]


def test_what_stays_is_a_position() -> None:
    assert outline(StraightTrajectory(Motion(Vector3(), 0.0), Vector3(), 1.0, Limits())) == [Vector3()]


def test_a_path_of_many_corners_has_a_bounded_number_of_points() -> None:
    goals = [PathWaypoint(Vector3(2.0 * i, 3.0 * math.cos(i), 0.0)) for i in range(3 * MOST_POINTS)]
    points = outline(path(Motion(Vector3(), 0.0), goals, 0.5, Limits()))
    assert MOST_POINTS / 2 < len(points) <= MOST_POINTS + 1
    assert points[-1] == goals[-1].position
