"""Lines and braking."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from random import Random

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from tests.strategies import ANGLES, vectors
from tests.ual_daemon.trajectory.trajectories import (
    LIMIT_SETS,
    STEP_S,
    assert_kept,
    assert_rests_at,
    assert_straight_between_bends,
    died_out,
    moments,
    path_distance,
    sampled,
)
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits
from ual_daemon.trajectory import Brake, Motion, StraightTrajectory, Trajectory, acceleration_limit, speed_limit
from ual_daemon.trajectory.envelope import RAMP_S, speed_share

LIMITS = Limits()
BENT_SLACK = 1e-4
"""The velocities of a bend are looked at in some places only: how much they may be over in between."""


def time_optimal_s(length_m: float, speed: float, acceleration: float, jerk: float) -> float:
    """The shortest time from rest to rest along a line, from the equations of motion.

    Jerk +j, 0, -j makes a change of speed by v in v / a + a / j if the limit a is reached (v >= a^2 / j), else in
    2 sqrt(v / j). Its way is that of the mean speed.
    """
    to_full_s = speed / acceleration + acceleration / jerk
    if speed < acceleration**2 / jerk:
        to_full_s = 2 * math.sqrt(speed / jerk)
    if length_m >= speed * to_full_s:
        return length_m / speed + to_full_s
    if length_m >= 2 * acceleration**3 / jerk**2:  # it is reached: v^2 / a + v a / j = length
        ramp_s = acceleration / jerk
        peak = acceleration / 2 * (math.sqrt(ramp_s**2 + 4 * length_m / acceleration) - ramp_s)
        return 2 * (peak / acceleration + ramp_s)
    return 4 * math.pow(length_m / 2 / jerk, 1 / 3)


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
def test_a_path_from_rest_is_straight_within_limits_and_ends_at_rest_at_the_goal(
    start: Vector3, start_yaw: float, goal: Vector3, goal_yaw: float, limits: Limits
) -> None:
    line = StraightTrajectory(Motion(start, start_yaw), goal, goal_yaw, limits)
    first = line.at(0.0)
    assert (first.position - start).norm() <= 1e-9
    assert wrap_angle(first.yaw_rad - start_yaw) == pytest.approx(0.0, abs=1e-9)
    assert first.velocity.norm() <= 1e-9
    assert_rests_at(line.end(), goal, goal_yaw)
    assert line.at(line.duration_s + 1000.0) == line.end()
    assert_kept(sampled(line), limits)
    turn = abs(wrap_angle(goal_yaw - start_yaw))
    for _, motion in moments(line):
        assert path_distance(motion.position, start, goal) <= 1e-6
        # The shortest turn, and never beyond it.
        turned = abs(wrap_angle(motion.yaw_rad - start_yaw))
        left = abs(wrap_angle(goal_yaw - motion.yaw_rad))
        assert turned + left == pytest.approx(turn, abs=1e-6)


@given(vectors(500.0), vectors(500.0), LIMIT_SETS)
def test_a_path_is_as_fast_as_its_limits_allow(start: Vector3, goal: Vector3, limits: Limits) -> None:
    way = goal - start
    assume(way.norm() > 1e-3)
    direction = way / way.norm()
    acceleration = acceleration_limit(direction, limits)
    best_s = time_optimal_s(way.norm(), speed_limit(direction, limits), acceleration, acceleration / RAMP_S)
    assert StraightTrajectory(Motion(start, 1.0), goal, 1.0, limits).duration_s == pytest.approx(best_s, rel=1e-6)


@given(vectors(50.0), ANGLES, LIMIT_SETS)
def test_the_heading_ends_with_the_path(goal: Vector3, yaw: float, limits: Limits) -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), goal, yaw, limits)
    assume(goal.norm() > 0.1)
    assume(abs(yaw) > 0.1)
    assume(line.duration_s < 600.0)
    before = line.at(line.duration_s * 0.95)
    assert before.position != goal
    assert wrap_angle(before.yaw_rad - yaw) != 0.0


@given(vectors(500.0), vectors(500.0), ANGLES, LIMIT_SETS)
def test_a_path_never_goes_back(start: Vector3, goal: Vector3, yaw: float, limits: Limits) -> None:
    line = StraightTrajectory(Motion(start, 0.0), goal, yaw, limits)
    left = [line.length_left_m(time_s) for time_s, _ in moments(line)]
    assert left[0] == pytest.approx((goal - start).norm(), abs=1e-9)
    assert left[-1] == 0.0
    assert all(later <= earlier + 1e-7 for earlier, later in itertools.pairwise(left))


@given(vectors(100.0), vectors(2.0), vectors(1.0), st.floats(-1.0, 1.0), vectors(100.0), ANGLES, LIMIT_SETS)
def test_a_path_from_any_motion_begins_with_it_keeps_the_limits_and_ends_at_rest_at_the_goal(
    start: Vector3,
    velocity: Vector3,
    acceleration: Vector3,
    yaw_rate: float,
    goal: Vector3,
    goal_yaw: float,
    limits: Limits,
) -> None:
    line = StraightTrajectory(
        Motion(start, 0.0, velocity, acceleration, yaw_rate, yaw_rate / 2), goal, goal_yaw, limits
    )
    first = line.at(0.0)
    assert (first.position - start).norm() <= 1e-9
    assert (first.velocity - velocity).norm() <= 1e-9
    assert (first.acceleration - acceleration).norm() <= 1e-9
    assert first.yaw_rate_rad_s == pytest.approx(yaw_rate, abs=1e-9)
    assert first.yaw_acceleration_rad_s2 == pytest.approx(yaw_rate / 2, abs=1e-9)
    assert_rests_at(line.end(), goal, goal_yaw)
    before = line.at(line.duration_s - 1e-6)
    assert (before.position - goal).norm() <= 1e-4
    assert before.velocity.norm() <= 1e-3
    assert_kept(sampled(line), limits, slack=BENT_SLACK)
    assert_straight_between_bends(line)


@given(vectors(30.0), st.floats(-1.0, 1.0), vectors(30.0), LIMIT_SETS)
def test_a_path_from_a_motion_along_it_or_back_is_straight_behind_its_bend(
    goal: Vector3, share: float, aside: Vector3, limits: Limits
) -> None:
    assume(goal.norm() > 0.01)
    direction = goal / goal.norm()
    velocity = direction * (share * speed_limit(direction, limits)) + aside * 1e-3
    line = StraightTrajectory(Motion(Vector3(), 0.0, velocity), goal, 0.0, limits)
    assert_straight_between_bends(line)
    begin_s, end_s = next(iter(line.bends_s()))
    assert end_s - begin_s <= line.duration_s


@pytest.mark.parametrize("spread_m", [0.3, 3.0, 30.0])
@settings(max_examples=2)
@given(LIMIT_SETS, st.integers(0, 1_000_000))
def test_goals_changed_every_300_ms_for_a_minute_make_no_step_beyond_the_limits(
    spread_m: float, limits: Limits, seed: int
) -> None:
    random = Random(seed)
    now, sent = Motion(Vector3(), 0.0), []
    for _ in range(200):
        goal = now.position + Vector3(*(random.uniform(-spread_m, spread_m) for _ in range(3)))
        choice: Trajectory = StraightTrajectory(now, goal, random.uniform(-math.pi, math.pi), limits)
        if random.random() < 0.1:
            choice = Brake(now, limits)  # aborted in the middle
        sent += [choice.at(index * STEP_S) for index in range(15)]
        now = choice.at(15 * STEP_S)
    assert_kept(sent, limits, slack=BENT_SLACK)


@given(vectors(30.0), st.floats(0.0, 1.0), LIMIT_SETS, st.floats(0.2, 0.9), st.floats(0.3, 1.0))
def test_limits_that_are_lowered_in_flight_are_come_back_to_without_a_step(
    goal: Vector3, share: float, limits: Limits, slower: float, gentler: float
) -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), goal, 1.0, limits)
    now = line.at(share * line.duration_s)
    lower = Limits(
        limits.horizontal_speed_m_s * slower,
        limits.climb_speed_m_s * slower,
        limits.descent_speed_m_s * slower,
        limits.horizontal_acceleration_m_s2 * gentler,
        limits.vertical_acceleration_m_s2 * gentler,
        limits.yaw_rate_rad_s * slower,
    )
    onward = StraightTrajectory(now, goal, 1.0, lower)
    assert (onward.at(0.0).velocity - now.velocity).norm() <= 1e-9
    assert (onward.at(0.0).acceleration - now.acceleration).norm() <= 1e-9
    sent = sampled(onward)
    assert_kept(sent, lower, slack=BENT_SLACK)
    shares = [speed_share(died_out(motion, lower), lower) for motion in sent]
    inside = next((index for index, used in enumerate(shares) if used <= 1.0), 0)
    assert max(shares[inside:]) <= 1.0 + BENT_SLACK  # back within them for good


@given(vectors(30.0), st.floats(0.0, 1.0), LIMIT_SETS)
@example(Vector3(0.0, 2.0, 0.0), 0.25, Limits(1.9375, 1.0, 1.0, 5.0, 1.0, 1.0))  # was 0.24 s longer
def test_a_goal_that_is_reported_again_changes_nothing(goal: Vector3, share: float, limits: Limits) -> None:
    assume(goal.norm() > 0.01)
    line = StraightTrajectory(Motion(Vector3(), 1.0), goal, 1.0, limits)
    told_s = share * line.duration_s
    again = StraightTrajectory(line.at(told_s), goal, 1.0, limits)
    assert again.duration_s == pytest.approx(line.duration_s - told_s, abs=1e-3)
    direction = goal / goal.norm()
    assert max((motion.position - goal).dot(direction) for _, motion in moments(again)) <= 1e-6


@given(vectors(30.0), st.floats(0.0, 1.0), vectors(0.05))
def test_a_goal_that_is_moved_a_little_is_not_overshot(goal: Vector3, share: float, moved: Vector3) -> None:
    assume(goal.norm() > 1.0)
    line = StraightTrajectory(Motion(Vector3(), 1.0), goal, 1.0, LIMITS)
    onward = StraightTrajectory(line.at(share * line.duration_s), goal + moved, 1.0, LIMITS)
    direction = goal / goal.norm()
    furthest = max((motion.position - goal).dot(direction) for _, motion in moments(onward))
    assert furthest <= 2 * moved.norm() + 1e-6


@pytest.mark.parametrize("length_m", [10.0, 900.0, 2_000.0, 1e4, 1e5, 1e6, 1e7])
def test_a_path_may_be_very_long(length_m: float) -> None:
    direction = Vector3(0.6, 0.8, 0.0)
    start, goal = Vector3(1.0, 2.0, 3.0), Vector3(1.0, 2.0, 3.0) + direction * length_m
    line = StraightTrajectory(Motion(start, 0.0), goal, 2.0, LIMITS)
    assert line.duration_s == pytest.approx(length_m / LIMITS.horizontal_speed_m_s, abs=3.0)
    assert_rests_at(line.end(), goal, 2.0)
    assert_kept(sampled(line), LIMITS)
    ending = [line.at(line.duration_s - 10.0 + index * STEP_S) for index in range(505)]
    assert_kept(ending, LIMITS)
    for _, motion in moments(line):
        assert path_distance(motion.position, start, goal) <= 1e-6 + 1e-9 * length_m
    # Both ends are flown at real speed, not only seen from afar.
    for time_s in (1.0, 2.0, line.duration_s - 2.0, line.duration_s - 1.0):
        assert line.at(time_s).velocity.norm() > 0.5


@pytest.mark.parametrize("length_m", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-3, 0.01])
def test_a_path_may_be_very_short(length_m: float) -> None:
    start = Vector3(100.0, -100.0, 50.0)
    goal = start + Vector3(0.6, 0.0, 0.8) * length_m
    line = StraightTrajectory(Motion(start, 1.0), goal, 1.0, LIMITS)
    assert line.duration_s < 1.0
    assert_rests_at(line.end(), goal, 1.0)
    assert_kept(sampled(line), LIMITS)
    for _, motion in moments(line):
        assert (motion.position - start).norm() <= length_m + 1e-8


@pytest.mark.parametrize(("begin", "end"), [(3.0, -3.0), (-3.0, 3.0), (0.0, math.pi), (0.1, -math.pi), (2.0, 2.0)])
def test_a_turn_on_the_spot_is_the_shortest(begin: float, end: float) -> None:
    line = StraightTrajectory(Motion(Vector3(1, 1, 1), begin), Vector3(1, 1, 1), end, LIMITS)
    turn = abs(wrap_angle(end - begin))
    assert line.length_m == 0.0
    assert sum(abs(m.yaw_rate_rad_s) for _, m in moments(line)) * line.duration_s / 200 == pytest.approx(turn, rel=0.02)
    assert all(m.position == Vector3(1, 1, 1) for _, m in moments(line))
    assert_rests_at(line.end(), Vector3(1, 1, 1), end)


def test_position_and_heading_arrive_together() -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(20.0, 0.0, 0.0), 1.0, LIMITS)
    half = line.at(line.duration_s / 2)
    assert half.position.x == pytest.approx(10.0, abs=0.1)
    assert half.yaw_rad == pytest.approx(0.5, abs=0.05)


def test_a_short_path_waits_for_its_turn() -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(0.5, 0.0, 0.0), 3.0, LIMITS)
    assert line.at(line.duration_s * 0.99).position != Vector3(0.5, 0.0, 0.0)
    assert line.at(line.duration_s / 2).yaw_rad == pytest.approx(1.5, abs=0.05)


def test_a_path_keeps_a_speed_limit_of_its_own() -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(10.0, 0.0, 5.0), 0.0, LIMITS, max_speed_m_s=0.5)
    assert max(m.velocity.norm() for _, m in moments(line)) == pytest.approx(0.5)


def test_a_start_in_motion_bends_to_the_path_without_stopping() -> None:
    start = Motion(Vector3(), 0.0, Vector3(0.0, 1.5, 0.0))
    line = StraightTrajectory(start, Vector3(30.0, 0.0, 0.0), 0.0, LIMITS)
    assert min(m.velocity.norm() for t, m in moments(line) if t < line.duration_s / 2) > 0.9
    straight = [m.position for t, m in moments(line) if t > 3.0]
    assert max(path_distance(p, straight[0], Vector3(30.0, 0.0, 0.0)) for p in straight) <= 1e-6


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
        assert path_distance(motion.position, start, last.position) <= 1e-6
        speeds.append(motion.velocity.norm())
    assert all(later <= earlier + 1e-9 for earlier, later in itertools.pairwise(speeds))
    assert_kept(sampled(brake), limits)


@given(vectors(50.0), st.floats(0.0, 1.0), LIMIT_SETS)
def test_braking_goes_on_from_the_acceleration_within_the_limits(goal: Vector3, share: float, limits: Limits) -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), goal, 1.0, limits)
    now = line.at(share * line.duration_s)
    brake = Brake(now, limits)
    assert (brake.at(0.0).acceleration - now.acceleration).norm() <= 1e-9
    assert_kept(sampled(brake), limits, slack=BENT_SLACK)
    # A brake that is begun again goes on as it was.
    again = Brake(brake.at(brake.duration_s / 3), limits)
    assert (again.end().position - brake.end().position).norm() <= 1e-3 * (1.0 + brake.length_m)


def test_braking_at_rest_stays() -> None:
    brake = Brake(Motion(Vector3(1, 2, 3), 1.0), LIMITS)
    assert brake.length_m == 0.0
    assert_rests_at(brake.end(), Vector3(1, 2, 3), 1.0)


def test_a_turn_that_is_beyond_its_limit_is_slowed_without_a_step() -> None:
    limits = replace(LIMITS, yaw_rate_rad_s=0.3)
    start = Motion(Vector3(), 0.0, yaw_rate_rad_s=1.0, yaw_acceleration_rad_s2=-0.5)
    for trajectory in (Brake(start, limits), StraightTrajectory(start, Vector3(5.0, 0.0, 0.0), 2.0, limits)):
        assert_kept(sampled(trajectory), limits)


def test_a_turn_that_cannot_be_drawn_out_is_made_as_fast_as_it_can() -> None:
    """Ruckig finds none that takes a minute from this motion, which a go-to that was replaced near its end had."""
    now = Motion(
        Vector3(2.9998791739818564, 0.0, 0.0),
        0.31783158392293936,
        Vector3(0.006899767897103004, 0.0, 0.0),
        Vector3(-0.2626740926909821, 0.0, 0.0),
        0.011039628635364916,
        -0.42027854830557165,
    )
    line = StraightTrajectory(now, Vector3(96.0, 0.0, 0.0), 0.3180249055519686, LIMITS)
    assert_rests_at(line.end(), Vector3(96.0, 0.0, 0.0), 0.3180249055519686)
    assert_kept(sampled(line), LIMITS, slack=BENT_SLACK)


def test_a_motion_that_is_planned_anew_all_the_time_takes_no_longer() -> None:
    random, longer_s = Random(1), []
    for _ in range(60):
        limits = Limits(*(random.choice((1.0, 1.9375, 3.0, random.uniform(0.5, 6.0))) for _ in range(6)))
        goal = Vector3(*(random.choice((0.0, 2.0, random.uniform(-20.0, 20.0))) for _ in range(3)))
        line: Trajectory = StraightTrajectory(Motion(Vector3(), 1.0), goal, 1.0, limits)
        turn: Trajectory = StraightTrajectory(Motion(goal, 0.0), goal, random.uniform(-3.0, 3.0), limits)
        for whole in (line, turn):
            for share in range(1, 16):
                end, on, at_s = whole.at(whole.duration_s), whole, share / 16 * whole.duration_s
                for _ in range(4):
                    left_s = on.duration_s - at_s
                    on = StraightTrajectory(on.at(at_s), end.position, end.yaw_rad, limits)
                    longer_s.append(on.duration_s - left_s)
                    at_s = on.duration_s / 8
    assert max(longer_s) <= 0.01  # some were 9 s longer
