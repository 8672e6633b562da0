from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.trajectory import (
    Brake,
    Chain,
    Line,
    Motion,
    RoundedRun,
    Trajectory,
    Waypoint,
    acceleration_limit,
    path,
    speed_limit,
)

LIMITS = Limits()
SLACK = 1.0 + 1e-6

LIMIT_SETS = st.builds(Limits, *[st.floats(0.3, 15.0)] * 3, *[st.floats(0.3, 5.0)] * 2, st.floats(0.1, 3.0))


def moments(trajectory: Trajectory, count: int = 200) -> Iterator[tuple[float, Motion]]:
    for i in range(count):
        time_s = trajectory.duration_s * i / count
        yield time_s, trajectory.at(time_s)
    yield trajectory.duration_s, trajectory.end()


def distance_from_line(point: Vector3, begin: Vector3, end: Vector3) -> float:
    way, offset = end - begin, point - begin
    if way.norm() < 1e-9:
        return offset.norm()
    along = max(0.0, min(1.0, offset.dot(way) / way.dot(way)))
    return (offset - way * along).norm()


def assert_within_limits(motion: Motion, limits: Limits) -> None:
    v, a = motion.velocity, motion.acceleration
    assert v.horizontal_norm() <= limits.horizontal_speed_m_s * SLACK
    assert -limits.descent_speed_m_s * SLACK <= v.z <= limits.climb_speed_m_s * SLACK
    assert a.horizontal_norm() <= limits.horizontal_acceleration_m_s2 * SLACK + 1e-9
    assert abs(a.z) <= limits.vertical_acceleration_m_s2 * SLACK + 1e-9
    assert abs(motion.yaw_rate_rad_s) <= limits.yaw_rate_rad_s * SLACK


def assert_rests_at(motion: Motion, position: Vector3, yaw_rad: float) -> None:
    assert motion.position == position
    assert wrap_angle(motion.yaw_rad - yaw_rad) == pytest.approx(0.0, abs=1e-6)
    assert motion.velocity.norm() == motion.acceleration.norm() == motion.yaw_rate_rad_s == 0.0


def assert_continuous(trajectory: Trajectory, limits: Limits, extra_m_s: float = 0.0) -> None:
    """Position and velocity never jump: in a short time they change by no more than speed and acceleration allow."""
    step_s = 1e-3
    top_m_s = math.hypot(limits.horizontal_speed_m_s, max(limits.climb_speed_m_s, limits.descent_speed_m_s)) + extra_m_s
    hardest_m_s2 = math.hypot(limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2)
    for time_s, now in moments(trajectory, 300):
        then = trajectory.at(time_s + step_s)
        scale_m = now.position.norm()
        assert (then.position - now.position).norm() <= top_m_s * step_s * 1.01 + 1e-12 * scale_m
        assert (then.velocity - now.velocity).norm() <= 2.0 * hardest_m_s2 * step_s + 1e-6
        turned = abs(wrap_angle(then.yaw_rad - now.yaw_rad))
        assert turned <= (limits.yaw_rate_rad_s + extra_m_s) * step_s * 1.01 + 1e-9


# --- Limits along a direction -----------------------------------------------------------------------------------------


@given(vectors(1.0), LIMIT_SETS)
def test_the_speed_along_a_direction_is_the_largest_within_both_limits(way: Vector3, limits: Limits) -> None:
    assume(way.norm() > 1e-3)
    direction = way / way.norm()
    fastest = direction * speed_limit(direction, limits)
    vertical = limits.climb_speed_m_s if direction.z > 0 else limits.descent_speed_m_s
    used = max(fastest.horizontal_norm() / limits.horizontal_speed_m_s, abs(fastest.z) / vertical)
    assert used == pytest.approx(1.0)
    hardest = direction * acceleration_limit(direction, limits)
    used = max(
        hardest.horizontal_norm() / limits.horizontal_acceleration_m_s2,
        abs(hardest.z) / limits.vertical_acceleration_m_s2,
    )
    assert used == pytest.approx(1.0)


# --- Lines ------------------------------------------------------------------------------------------------------------


@given(vectors(500.0), ANGLES, vectors(500.0), ANGLES, LIMIT_SETS)
def test_a_line_from_rest_is_straight_within_limits_and_ends_at_rest_at_the_goal(
    start: Vector3, start_yaw: float, goal: Vector3, goal_yaw: float, limits: Limits
) -> None:
    line = Line(Motion(start, start_yaw), goal, goal_yaw, limits)
    first = line.at(0.0)
    assert (first.position - start).norm() <= 1e-9
    assert wrap_angle(first.yaw_rad - start_yaw) == pytest.approx(0.0, abs=1e-9)
    assert first.velocity.norm() <= 1e-9
    assert_rests_at(line.end(), goal, goal_yaw)
    assert line.at(line.duration_s + 1000.0) == line.end()
    turn = abs(wrap_angle(goal_yaw - start_yaw))
    for _, motion in moments(line):
        assert distance_from_line(motion.position, start, goal) <= 1e-6
        assert_within_limits(motion, limits)
        # The shortest turn, and never beyond it.
        turned = abs(wrap_angle(motion.yaw_rad - start_yaw))
        left = abs(wrap_angle(goal_yaw - motion.yaw_rad))
        assert turned + left == pytest.approx(turn, abs=1e-6)


@given(vectors(500.0), vectors(500.0), ANGLES, LIMIT_SETS)
def test_a_line_never_goes_back(start: Vector3, goal: Vector3, yaw: float, limits: Limits) -> None:
    line = Line(Motion(start, 0.0), goal, yaw, limits)
    left = [line.length_left_m(time_s) for time_s, _ in moments(line)]
    assert left[0] == pytest.approx((goal - start).norm(), abs=1e-9)
    assert left[-1] == 0.0
    assert all(later <= earlier + 1e-7 for earlier, later in itertools.pairwise(left))


@given(vectors(100.0), vectors(2.0), vectors(1.0), st.floats(-1.0, 1.0), vectors(100.0), ANGLES, LIMIT_SETS)
def test_a_line_from_motion_begins_with_it_and_ends_at_rest_at_the_goal(
    start: Vector3,
    velocity: Vector3,
    acceleration: Vector3,
    yaw_rate: float,
    goal: Vector3,
    goal_yaw: float,
    limits: Limits,
) -> None:
    line = Line(Motion(start, 0.0, velocity, acceleration, yaw_rate), goal, goal_yaw, limits)
    first = line.at(0.0)
    assert (first.position - start).norm() <= 1e-9
    assert (first.velocity - velocity).norm() <= 1e-9
    assert first.yaw_rate_rad_s == pytest.approx(yaw_rate, abs=1e-9)
    assert_rests_at(line.end(), goal, goal_yaw)
    before = line.at(line.duration_s - 1e-6)
    assert (before.position - goal).norm() <= 1e-4
    assert before.velocity.norm() <= 1e-3
    assert_continuous(line, limits, extra_m_s=velocity.norm() + abs(yaw_rate))


@given(vectors(500.0), ANGLES, vectors(500.0), ANGLES, LIMIT_SETS)
def test_a_line_is_continuous(start: Vector3, yaw: float, goal: Vector3, goal_yaw: float, limits: Limits) -> None:
    assert_continuous(Line(Motion(start, yaw), goal, goal_yaw, limits), limits)


@pytest.mark.parametrize("length_m", [10.0, 900.0, 2_000.0, 1e4, 1e5, 1e6, 1e7])
def test_a_line_may_be_very_long(length_m: float) -> None:
    direction = Vector3(0.6, 0.8, 0.0)
    start, goal = Vector3(1.0, 2.0, 3.0), Vector3(1.0, 2.0, 3.0) + direction * length_m
    line = Line(Motion(start, 0.0), goal, 2.0, LIMITS)
    assert line.duration_s == pytest.approx(length_m / LIMITS.horizontal_speed_m_s, abs=3.0)
    assert_rests_at(line.end(), goal, 2.0)
    assert_continuous(line, LIMITS)
    for _, motion in moments(line):
        assert distance_from_line(motion.position, start, goal) <= 1e-6 + 1e-9 * length_m
        assert_within_limits(motion, LIMITS)
    # Both ends are flown at real speed, not only seen from afar.
    for time_s in (1.0, 2.0, line.duration_s - 2.0, line.duration_s - 1.0):
        assert_within_limits(line.at(time_s), LIMITS)
        assert line.at(time_s).velocity.norm() > 0.5


@pytest.mark.parametrize("length_m", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-3, 0.01])
def test_a_line_may_be_very_short(length_m: float) -> None:
    start = Vector3(100.0, -100.0, 50.0)
    goal = start + Vector3(0.6, 0.0, 0.8) * length_m
    line = Line(Motion(start, 1.0), goal, 1.0, LIMITS)
    assert line.duration_s < 1.0
    assert_rests_at(line.end(), goal, 1.0)
    for _, motion in moments(line):
        assert_within_limits(motion, LIMITS)
        assert (motion.position - start).norm() <= length_m + 1e-8


@pytest.mark.parametrize(("begin", "end"), [(3.0, -3.0), (-3.0, 3.0), (0.0, math.pi), (0.1, -math.pi), (2.0, 2.0)])
def test_a_turn_on_the_spot_is_the_shortest(begin: float, end: float) -> None:
    line = Line(Motion(Vector3(1, 1, 1), begin), Vector3(1, 1, 1), end, LIMITS)
    turn = abs(wrap_angle(end - begin))
    assert line.length_m == 0.0
    assert sum(abs(m.yaw_rate_rad_s) for _, m in moments(line)) * line.duration_s / 200 == pytest.approx(turn, rel=0.02)
    assert all(m.position == Vector3(1, 1, 1) for _, m in moments(line))
    assert_rests_at(line.end(), Vector3(1, 1, 1), end)


def test_position_and_heading_arrive_together() -> None:
    line = Line(Motion(Vector3(), 0.0), Vector3(20.0, 0.0, 0.0), 1.0, LIMITS)
    half = line.at(line.duration_s / 2)
    assert half.position.x == pytest.approx(10.0, abs=0.1)
    assert half.yaw_rad == pytest.approx(0.5, abs=0.05)


def test_a_line_is_as_fast_as_the_limits_allow() -> None:
    line = Line(Motion(Vector3(), 0.0), Vector3(16.0, 0.0, 0.0), 0.0, LIMITS)
    assert max(m.velocity.norm() for _, m in moments(line)) == pytest.approx(LIMITS.horizontal_speed_m_s)
    # 10 s at full speed, and what speeding up, slowing down (0.8 s each) and the ramps of the jerk (0.4 s) take.
    assert line.duration_s == pytest.approx(16.0 / 1.6 + 1.6 / 2.0 + 0.4, abs=0.01)


# --- Braking ----------------------------------------------------------------------------------------------------------


@given(vectors(100.0), ANGLES, vectors(20.0), st.floats(-3.0, 3.0), LIMIT_SETS)
def test_braking_ends_at_rest_straight_ahead(
    start: Vector3, yaw: float, velocity: Vector3, yaw_rate: float, limits: Limits
) -> None:
    brake = Brake(Motion(start, yaw, velocity, yaw_rate_rad_s=yaw_rate), limits)
    first, last = brake.at(0.0), brake.end()
    assert (first.position - start).norm() <= 1e-9
    assert (first.velocity - velocity).norm() <= 1e-9
    assert last.velocity.norm() == last.acceleration.norm() == last.yaw_rate_rad_s == 0.0
    assert brake.at(brake.duration_s + 10.0) == last
    assert (last.position - start).norm() == pytest.approx(brake.length_m, abs=1e-9)
    speeds = []
    for _, motion in moments(brake):
        assert distance_from_line(motion.position, start, last.position) <= 1e-6
        speeds.append(motion.velocity.norm())
        assert motion.acceleration.horizontal_norm() <= limits.horizontal_acceleration_m_s2 * SLACK
        assert abs(motion.acceleration.z) <= limits.vertical_acceleration_m_s2 * SLACK
    assert all(later <= earlier + 1e-9 for earlier, later in itertools.pairwise(speeds))
    assert_continuous(brake, limits, extra_m_s=velocity.norm() + abs(yaw_rate))


def test_braking_at_rest_stays() -> None:
    brake = Brake(Motion(Vector3(1, 2, 3), 1.0), LIMITS)
    assert brake.length_m == 0.0
    assert_rests_at(brake.end(), Vector3(1, 2, 3), 1.0)


# --- Paths ------------------------------------------------------------------------------------------------------------


def waypoints(*places: tuple[float, float, float]) -> list[Waypoint]:
    return [Waypoint(Vector3(*place)) for place in places]


def distance_from_path(point: Vector3, points: Sequence[Vector3]) -> float:
    return min(distance_from_line(point, a, b) for a, b in itertools.pairwise(points))


PATHS = st.lists(
    st.builds(Waypoint, vectors(30.0), st.none() | ANGLES),
    min_size=1,
    max_size=6,
)


@given(vectors(30.0), ANGLES, PATHS, st.sampled_from([0.0, 0.05, 1.0, 20.0]), LIMIT_SETS)
def test_a_path_from_rest_passes_its_waypoints_within_radius_and_limits(
    start: Vector3, yaw: float, goals: list[Waypoint], radius_m: float, limits: Limits
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
        assert_within_limits(motion, limits)
        closest = [min(c, (motion.position - point).norm()) for c, point in zip(closest, points, strict=True)]
    # An arc within the radius passes its corner within the radius.
    assert max(closest) <= radius_m + gap_m
    assert_continuous(found, limits)


@given(vectors(30.0), PATHS, st.sampled_from([0.0, 1.0, 20.0]))
def test_the_way_left_only_shrinks_and_waypoints_come_in_order(
    start: Vector3, goals: list[Waypoint], radius_m: float
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


@given(vectors(30.0), vectors(1.0), st.floats(-1.0, 1.0), PATHS, st.sampled_from([0.0, 1.0, 20.0]))
def test_a_path_from_motion_begins_with_it(
    start: Vector3, velocity: Vector3, yaw_rate: float, goals: list[Waypoint], radius_m: float
) -> None:
    assume(velocity.norm() > 0.02)
    found = path(Motion(start, 0.0, velocity, yaw_rate_rad_s=yaw_rate), goals, radius_m, LIMITS)
    assert (found.at(0.0).velocity - velocity).norm() <= 1e-9
    assert found.end().position == goals[-1].position
    assert found.end().velocity.norm() == 0.0
    assert_continuous(found, LIMITS, extra_m_s=velocity.norm() + abs(yaw_rate))


def test_without_a_radius_it_stops_at_each_corner() -> None:
    found = path(Motion(Vector3(), 0.0), waypoints((5, 0, 0), (5, 5, 0), (0, 5, 0)), 0.0, LIMITS)
    assert isinstance(found, Chain)
    slow = [m.position for _, m in moments(found, 2000) if m.velocity.norm() < 0.02]
    for corner in (Vector3(5, 0, 0), Vector3(5, 5, 0)):
        assert min((p - corner).norm() for p in slow) <= 0.02


def test_with_a_radius_it_never_stops_on_the_way_and_is_faster() -> None:
    goals = waypoints((5, 0, 0), (5, 5, 0), (0, 5, 0))
    rounded = path(Motion(Vector3(), 0.0), goals, 1.0, LIMITS)
    assert isinstance(rounded, RoundedRun)
    assert rounded.duration_s < path(Motion(Vector3(), 0.0), goals, 0.0, LIMITS).duration_s
    inner = [m.velocity.norm() for t, m in moments(rounded) if 1.0 < t < rounded.duration_s - 1.0]
    assert min(inner) > 0.5
    # A right angle within 1 m: an arc of 1 m radius, that cuts the corner by 0.41 m.
    nearest = min((m.position - Vector3(5, 0, 0)).norm() for _, m in moments(rounded, 2000))
    assert nearest == pytest.approx(math.sqrt(2) - 1, abs=0.01)


def test_a_waypoint_on_a_straight_way_is_passed_at_full_speed() -> None:
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
def test_duplicates_and_reversals_are_flown_with_stops(
    places: list[tuple[float, float, float]], radius_m: float
) -> None:
    found = path(Motion(Vector3(), 0.0), waypoints(*places), radius_m, LIMITS)
    assert_rests_at(found.end(), Vector3(*places[-1]), 0.0)
    assert_continuous(found, LIMITS)
    numbers = [found.waypoint_at(time_s) for time_s, _ in moments(found)]
    assert numbers == sorted(numbers)
    assert numbers[-1] == len(places) - 1
    for _, motion in moments(found):
        assert_within_limits(motion, LIMITS)
    for place in places:
        assert min((m.position - Vector3(*place)).norm() for _, m in moments(found, 2000)) <= radius_m * 0.5 + 0.01


def test_a_turn_on_the_spot_within_a_path_is_made_standing() -> None:
    goals = [Waypoint(Vector3(3, 0, 0)), Waypoint(Vector3(3, 0, 0), 2.0), Waypoint(Vector3(3, 3, 0))]
    found = path(Motion(Vector3(), 0.0), goals, 1.0, LIMITS)
    for _, motion in moments(found, 1000):
        if motion.yaw_rate_rad_s > 1e-6:
            assert motion.position == Vector3(3, 0, 0)
    assert_rests_at(found.end(), Vector3(3, 3, 0), 2.0)
    assert_continuous(found, LIMITS)


def test_a_heading_that_is_not_given_is_the_one_before() -> None:
    goals = [Waypoint(Vector3(5, 0, 0), 1.0), Waypoint(Vector3(5, 5, 0)), Waypoint(Vector3(0, 5, 0), -1.0)]
    found = path(Motion(Vector3(), 0.5), goals, 0.0, LIMITS)
    at_corners = [found.at(time_s).yaw_rad for time_s in corner_times(found, [goal.position for goal in goals])]
    assert at_corners == pytest.approx([1.0, 1.0, -1.0], abs=0.01)


def corner_times(found: Trajectory, corners: Sequence[Vector3]) -> list[float]:
    samples = list(moments(found, 2000))
    return [min(samples, key=lambda sample: (sample[1].position - corner).norm())[0] for corner in corners]


def test_a_path_of_many_waypoints_is_as_good_as_one_of_few() -> None:
    circle = [(10 * math.cos(i / 50), 10 * math.sin(i / 50), i / 100) for i in range(1, 315)]
    found = path(Motion(Vector3(10, 0, 0), 0.0), waypoints(*circle), 0.5, LIMITS)
    assert_continuous(found, LIMITS)
    assert found.duration_s == pytest.approx(found.length_m / LIMITS.horizontal_speed_m_s, rel=0.2)
    for _, motion in moments(found, 2000):
        assert motion.position.horizontal_norm() == pytest.approx(10.0, abs=0.02)
        assert_within_limits(motion, LIMITS)
