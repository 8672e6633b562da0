"""Waiting for a UAV that lags: smooth, whatever the UAV does."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from random import Random

import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from tests.strategies import vectors
from tests.ual_daemon.trajectory.trajectories import LIMIT_SETS, STEP_S, assert_kept, waypoints
from ual.geometry import Pose, Quaternion, Vector3
from ual.types import Limits, PathHeading
from ual_daemon.backends.values import MotionState, Sample, Setpoint, Snapshot
from ual_daemon.tracker.references import TrajectoryReference
from ual_daemon.tracker.time_scaling import TimeScaling, scaled
from ual_daemon.trajectory import Brake, Motion, PathWaypoint, StraightTrajectory, Trajectory, path

LIMITS = Limits()
SLACK = 2e-3
"""By how much a change of the time scale may exceed a limit between the motions that are checked."""


def sent_motions(trajectory: Trajectory, lag: Random, duration_s: float) -> list[Motion]:
    """Returns the motions that are sent to a UAV that falls behind, catches up, and is measured with noise."""
    follow = TrajectoryReference(trajectory, 0.0)
    behind_m, target_m, sent = 0.0, 0.0, [trajectory.at(0.0)]
    snapshot = Snapshot(time_s=0.0)
    for index in range(1, int(duration_s / STEP_S)):
        if lag.random() < 0.01:
            target_m = lag.choice([0.0, 0.0, 1.0, 3.0, 8.0])
        behind_m += 0.02 * (target_m - behind_m)
        noise = Vector3(*(lag.gauss(0.0, 0.1) for _ in range(3)))
        position = follow.motion(snapshot).position + Vector3(-behind_m, 0.0, 0.0) + noise
        pose = Sample(Pose(position, Quaternion.from_yaw(0.0)), index * STEP_S)
        snapshot = Snapshot(time_s=index * STEP_S, motion=MotionState(pose=pose))
        follow.setpoint(snapshot)
        sent.append(follow.motion(snapshot))
    return sent


@settings(max_examples=10)
@given(vectors(60.0), st.integers(0, 10_000), LIMIT_SETS)
def test_a_straight_that_waits_keeps_its_limits(goal: Vector3, seed: int, limits: Limits) -> None:
    assert_kept(
        sent_motions(StraightTrajectory(Motion(Vector3(), 0.0), goal, 2.0, limits), Random(seed), 20.0),
        limits,
        slack=SLACK,
    )


@settings(max_examples=15)
@given(
    st.lists(st.builds(PathWaypoint, vectors(15.0)), min_size=2, max_size=5),
    st.integers(0, 10_000),
    st.sampled_from([0.0, 1.0, 5.0]),
    st.sampled_from(PathHeading),
    LIMIT_SETS,
)
def test_a_path_that_waits_keeps_its_limits(
    goals: list[PathWaypoint], seed: int, radius_m: float, heading: PathHeading, limits: Limits
) -> None:
    found = path(Motion(Vector3(), 0.0), goals, radius_m, limits, heading, Vector3(5.0, 5.0, 0.0))
    assert_kept(sent_motions(found, Random(seed), 20.0), limits, slack=SLACK)


@pytest.mark.parametrize("wait_s", [0.3, 2.0, 5.9, 6.5, 7.0, 12.0])
def test_it_stops_at_any_time_and_goes_on_soon_enough(wait_s: float) -> None:
    found = path(Motion(Vector3(), 0.0), waypoints((10, 0, 0), (10, 10, 0), (0, 10, 0)), 1.0, LIMITS)
    scaling = TimeScaling(found)
    for _ in range(round(wait_s / STEP_S)):
        scaling.advance(STEP_S, math.inf, 1.0)
    for _ in range(300):
        scaling.advance(STEP_S, math.inf, 0.0)
    stopped_s = scaling.time_s
    assert scaling.motion.velocity.norm() <= 1e-9
    assert stopped_s - wait_s <= 4.5
    for _ in range(250):
        scaling.advance(STEP_S, math.inf, 1.0)
    assert scaling.time_s >= min(found.duration_s, stopped_s + 2.5)


FAST = Limits(horizontal_speed_m_s=10.0, horizontal_acceleration_m_s2=1.5)
"""Limits of a new ArduCopter: it accelerates for longer than a slow UAV flies."""


@pytest.mark.parametrize("length_m", [10.0, 30.0, 100.0])
@pytest.mark.parametrize("yaw_rad", [0.0, 2.0])
@pytest.mark.parametrize("share", [0.1, 0.2, 0.3, 0.4, 0.5, 0.8])
def test_it_stops_as_soon_as_straight_ahead_also_where_it_still_accelerates(
    share: float, yaw_rad: float, length_m: float
) -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(length_m, 0.0, 0.0), yaw_rad, FAST)
    scaling, sent = TimeScaling(line), [line.at(0.0)]
    while scaling.time_s < share * line.duration_s:
        scaling.advance(STEP_S, math.inf, 1.0)
        sent.append(scaling.motion)
    fastest = Brake(replace(scaling.motion, yaw_rate_rad_s=0.0), FAST).end().position.x
    for _ in range(round(line.duration_s / STEP_S)):
        scaling.advance(STEP_S, math.inf, 0.0)
        sent.append(scaling.motion)
    assert scaling.motion.velocity == Vector3()
    assert scaling.motion.position.x <= min(length_m, fastest + 0.3)
    assert_kept(sent, FAST, slack=SLACK)


def test_velocity_and_acceleration_are_the_derivatives_of_the_position_while_the_scale_changes() -> None:
    line = StraightTrajectory(Motion(Vector3(), 0.0), Vector3(30.0, 0.0, 0.0), 1.0, LIMITS)
    scaling, step_s = TimeScaling(line), 1e-3
    motions = []
    for index in range(6000):
        scaling.advance(step_s, math.inf, 1.0 if index < 2000 else 0.4)
        motions.append(scaling.motion)
    for before, now, after in zip(motions, motions[1:], motions[2:], strict=False):
        velocity = (after.position - before.position) / (2 * step_s)
        acceleration = (after.velocity - before.velocity) / (2 * step_s)
        assert (velocity - now.velocity).norm() <= 1e-5
        assert (acceleration - now.acceleration).norm() <= 1e-2
    assert motions[-1].velocity.x == pytest.approx(0.4 * 1.6)


def test_a_motion_in_real_time_is_not_changed() -> None:
    motion = Motion(Vector3(), 0.0, Vector3(1, 0, 0), Vector3(0, 1, 0), 0.5, 0.1)
    assert scaled(motion, 1.0, 0.0) is motion
    assert scaled(motion, 0.5, 0.0).acceleration == Vector3(0, 0.25, 0)
    assert scaled(motion, 0.5, -0.2).acceleration == Vector3(-0.2, 0.25, 0)


def paused_motions(follow: TrajectoryReference, spans: list[tuple[float, float]]) -> list[Motion]:
    """Returns the motions that are sent to a UAV that never lags, which flies and is paused by turns; then it flies to
    the end.
    """
    snapshot, sent, now_s = Snapshot(time_s=0.0), [follow.trajectory.at(0.0)], 0.0

    def run(duration_s: float) -> None:
        nonlocal snapshot, now_s
        for _ in range(round(duration_s / STEP_S)):
            now_s += STEP_S
            pose = Sample(Pose(follow.motion(snapshot).position, Quaternion.from_yaw(0.0)), now_s)
            snapshot = Snapshot(time_s=now_s, motion=MotionState(pose=pose))
            follow.setpoint(snapshot)
            sent.append(follow.motion(snapshot))

    for flying_s, paused_s in [*spans, (0.0, 40.0)]:
        follow.is_stopping = False
        run(flying_s)
        follow.is_stopping = True
        run(paused_s)
    assert sent[-1].velocity.norm() <= 1e-9  # 40 s are enough to stop, whatever it flies
    assert abs(sent[-1].yaw_rate_rad_s) <= 1e-9
    follow.is_stopping = False
    run(min(120.0, 5.0 * follow.trajectory.duration_s + 20.0))
    return sent


@settings(max_examples=25, phases=[Phase.explicit, Phase.generate])  # a failing path shrinks too slowly
@example(  # a stop that braked so hard at its end that its time went back
    [
        PathWaypoint(Vector3(1.3083922749333823, -0.19923241986130513, 1.0)),
        PathWaypoint(Vector3(3.0, 0.35, 14.852242116456612)),
        PathWaypoint(Vector3(-2.0, 0.0, 0.0)),
    ],
    [(0.06808755611244345, 1.9093882271943183)],
    1.0,
    PathHeading.WAYPOINTS,
    Limits(10.402278515667643, 0.4, 0.30000000000000004, 1.9249100329739768, 0.99999, 1.8526259842789052),
)
@given(
    st.lists(st.builds(PathWaypoint, vectors(15.0)), min_size=1, max_size=5),
    st.lists(st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 6.0)), min_size=1, max_size=4),
    st.sampled_from([0.0, 1.0, 5.0]),
    st.sampled_from(PathHeading),
    LIMIT_SETS,
)
def test_a_pause_keeps_the_path_and_the_limits_and_is_completed(
    goals: list[PathWaypoint], spans: list[tuple[float, float]], radius_m: float, heading: PathHeading, limits: Limits
) -> None:
    found = path(Motion(Vector3(), 0.0), goals, radius_m, limits, heading, Vector3(5.0, 5.0, 0.0))
    follow = Recorded(found, 0.0)
    sent = paused_motions(follow, spans)
    assert_kept(sent, limits, slack=SLACK)
    assert all(after >= before - 1e-9 for before, after in itertools.pairwise(follow.times_s))  # it never goes back
    for motion, time_s in zip(sent[1:], follow.times_s, strict=True):
        assert motion.position == found.at(time_s).position  # nor off its path
    if found.duration_s < 15.0:
        assert follow.is_finished


class Recorded(TrajectoryReference):
    """Records the times on the trajectory."""

    def __init__(self, trajectory: Trajectory, now_s: float) -> None:
        super().__init__(trajectory, now_s)
        self.times_s: list[float] = []

    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        found = super().setpoint(snapshot)
        self.times_s.append(self.time_s)
        return found
