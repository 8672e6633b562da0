"""A motion that makes no way ends with its reason within 10 s; one that is only slow does not."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual_daemon.flight.hand_made import Autopilot
from ual.errors import UalError, UalTimeoutError
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Limits, PathHeading, TaskKind
from ual_daemon.backends.values import (
    Condition,
    Control,
    ControlState,
    Estimator,
    Freshness,
    LandedState,
    Mode,
    MotionState,
    PositionSetpoint,
    Sample,
    Snapshot,
)
from ual_daemon.flight.manoeuvres.follow import FollowTrajectory, MakeTracker
from ual_daemon.flight.manoeuvres.follow_moving_goal import FollowMovingGoal
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step
from ual_daemon.flight.manoeuvres.progress_watch import STUCK_TIME_S, Headway
from ual_daemon.flight.state import estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.tracker.pure_pursuit import Pursuit
from ual_daemon.tracker.references import TrajectoryReference
from ual_daemon.trajectory import Motion, PathWaypoint, Trajectory, path

STEP_S = 0.1
WITHIN_S = 10.0
START = Motion(Vector3(1.0, 2.0, 5.0), 0.3)


class FlightTrace:
    """A UAV that follows setpoints with a lag, unless it is held fast; its estimate wanders."""

    def __init__(self, lag_s: float = 0.3, wanders_m: float = 0.0, turns: float = 0.0) -> None:
        self.now_s = 0.0
        self.position, self.yaw_rad = START.position, START.yaw_rad
        self.velocity = Vector3()
        self.lag_s, self.wanders_m, self.turns = lag_s, wanders_m, turns
        self.is_held_fast = self.is_turned_fast = False
        self.status_text = ""
        self.wind = Vector3()
        """Distance by which the wind holds it off its setpoint."""

    def snapshot(self) -> Snapshot:
        now_s, phase = self.now_s, self.turns + self.now_s * 0.3
        wander = Vector3(math.sin(phase), math.cos(1.3 * phase), math.sin(0.7 * phase)) * (self.wanders_m / 2)
        return Snapshot(
            time_s=now_s,
            heard_s=now_s,
            control=ControlState(
                armed=Sample(True, now_s),
                landed=Sample(LandedState.IN_AIR, now_s),
                mode=Sample(Mode("OFFBOARD", Control.REFERENCES), now_s),
            ),
            motion=MotionState(
                estimator=Sample(Estimator(True), now_s),
                pose=Sample(Pose(self.position + wander, Quaternion.from_yaw(self.yaw_rad)), now_s),
                velocity=Sample(Twist(self.velocity), now_s),
            ),
            condition=Condition(status_text=self.status_text),
        )

    def task(self, kind: TaskKind) -> VehicleTask:
        return VehicleTask(kind, "", Autopilot())

    def step(self, manoeuvre: Manoeuvre) -> Step:
        self.now_s += STEP_S
        snapshot = self.snapshot()
        step = manoeuvre.step(snapshot, estimate(snapshot, Freshness()))
        setpoint = step.setpoint
        if isinstance(setpoint, PositionSetpoint):
            share = min(1.0, STEP_S / self.lag_s)
            if not self.is_turned_fast:
                self.yaw_rad += math.remainder(setpoint.yaw_rad - self.yaw_rad, math.tau) * share
            if self.is_held_fast:
                self.velocity = Vector3()
            else:
                moved = (setpoint.position + self.wind - self.position) * share
                self.position, self.velocity = self.position + moved, moved / STEP_S
        return step

    def until_end(self, manoeuvre: Manoeuvre, limit_s: float = 5000.0) -> UalError | None:
        while self.now_s < limit_s:
            step = self.step(manoeuvre)
            if step.has_ended:
                return step.error
        raise AssertionError("it does not end")

    def run(self, manoeuvre: Manoeuvre, duration_s: float) -> None:
        until_s = self.now_s + duration_s
        while self.now_s < until_s:
            assert not self.step(manoeuvre).has_ended

    def ends_after_s(self, manoeuvre: Manoeuvre) -> float:
        """After how long it ends because it makes no way."""
        began_s = self.now_s
        error = self.until_end(manoeuvre)
        assert isinstance(error, UalTimeoutError)
        assert "has made no way for" in str(error)
        assert error.metadata["by"] == "no way"
        return self.now_s - began_s


def follow(
    flown: FlightTrace, trajectory: Trajectory, tracker: MakeTracker = TrajectoryReference, tolerance_m: float = 0.5
) -> FollowTrajectory:
    task, tolerance = flown.task(TaskKind.FOLLOW_PATH), ToleranceSettings(position_m=tolerance_m)
    return FollowTrajectory("follow_path", task, trajectory, tolerance, tracker)


@pytest.mark.parametrize("text", ["", "EKF3 lane switch 1"])
def test_only_what_was_reported_since_it_began_is_reported_as_a_reason(text: str) -> None:
    flown = FlightTrace()
    flown.status_text = "EKF3 IMU0 is using GPS"  # since it has booted
    far = PathWaypoint(START.position + Vector3(80.0, 0.0, 0.0), START.yaw_rad)
    task = follow(flown, path(START, [far], 0.0, at(3.0)))
    flown.run(task, 2.0)
    flown.is_held_fast = True
    flown.run(task, 4.0)
    flown.status_text = text or flown.status_text
    error = flown.until_end(task)
    assert isinstance(error, UalTimeoutError)
    assert "IMU0" not in error.message
    assert (f"; the autopilot says: {text}" if text else "; it stops") in error.message


def at(speed_m_s: float) -> Limits:
    return Limits(horizontal_speed_m_s=speed_m_s, climb_speed_m_s=speed_m_s, descent_speed_m_s=speed_m_s)


offsets = st.builds(Vector3, st.floats(-6.0, 6.0), st.floats(-6.0, 6.0), st.floats(-3.0, 3.0))
legs = st.lists(st.tuples(offsets, st.sampled_from([0.0, 0.0, 3.0, 30.0])), min_size=1, max_size=5)


@given(
    legs=legs,
    speed_m_s=st.floats(0.05, 8.0),
    corner_m=st.sampled_from([0.0, 1.5]),
    heading=st.sampled_from([PathHeading.WAYPOINTS, PathHeading.FIXED, PathHeading.ALONG_PATH]),
    yaw_rad=st.floats(-3.0, 3.0),
    yaw_rate_rad_s=st.floats(0.02, 1.0),
    lag_s=st.floats(0.1, 1.0),
    wanders_m=st.floats(0.0, 0.4),
    turns=st.floats(0.0, 7.0),
    is_pursued=st.booleans(),
)
def test_no_path_that_is_executed_ends_however_slow_it_is_and_however_long_it_holds(
    legs: list[tuple[Vector3, float]],
    speed_m_s: float,
    corner_m: float,
    heading: PathHeading,
    yaw_rad: float,
    yaw_rate_rad_s: float,
    lag_s: float,
    wanders_m: float,
    turns: float,
    *,
    is_pursued: bool,
) -> None:
    place, waypoints = START.position, []
    for offset, hold_s in legs:
        place += offset
        waypoints.append(PathWaypoint(place, yaw_rad, None, hold_s))
    limits = Limits(speed_m_s, speed_m_s, speed_m_s, yaw_rate_rad_s=yaw_rate_rad_s)
    flown = FlightTrace(lag_s, wanders_m, turns)
    tracker: MakeTracker = Pursuit if is_pursued else TrajectoryReference
    trajectory = path(START, waypoints, corner_m, limits, heading)
    assert flown.until_end(follow(flown, trajectory, tracker, 1.0), 10.0 * trajectory.duration_s + 100.0) is None


@pytest.mark.parametrize("tracker", [TrajectoryReference, Pursuit])
@pytest.mark.parametrize("speed_m_s", [0.2, 1.0, 8.0])
@pytest.mark.parametrize("held_after_s", [0.0, 1.0, 6.0])
def test_a_motion_that_is_held_fast_ends_within_10_s(
    tracker: MakeTracker, speed_m_s: float, held_after_s: float
) -> None:
    flown = FlightTrace(wanders_m=0.1)
    manoeuvre = follow(flown, path(START, [PathWaypoint(Vector3(90.0, 2.0, 5.0))], 0.0, at(speed_m_s)), tracker)
    flown.run(manoeuvre, held_after_s)
    flown.is_held_fast = True
    assert STUCK_TIME_S - 0.2 - 0.3 / speed_m_s < flown.ends_after_s(manoeuvre) < WITHIN_S + 0.3 / speed_m_s


def test_one_that_is_held_fast_at_any_time_of_a_path_with_holds_ends_within_10_s_or_is_there() -> None:
    """In a hold, it is where it should be until that has ended."""
    hold_s = 30.0
    waypoints = [PathWaypoint(Vector3(11.0, 2.0, 5.0), None, None, hold_s), PathWaypoint(Vector3(31.0, 2.0, 5.0))]
    for held_after_s in range(0, 45, 3):
        flown = FlightTrace()
        manoeuvre = follow(flown, path(START, waypoints, 0.0, at(2.0)))
        flown.run(manoeuvre, held_after_s)
        flown.is_held_fast = True
        is_there = (flown.position - waypoints[0].position).norm() < 1.5
        assert flown.ends_after_s(manoeuvre) < WITHIN_S + (hold_s if is_there else 0.3)


def test_one_that_is_blown_off_a_hold_and_kept_there_ends() -> None:
    flown = FlightTrace()
    waypoints = [PathWaypoint(Vector3(11.0, 2.0, 5.0), None, None, 600.0), PathWaypoint(Vector3(31.0, 2.0, 5.0))]
    manoeuvre = follow(flown, path(START, waypoints, 0.0, at(2.0)))
    flown.run(manoeuvre, 20.0)
    flown.wind = Vector3(0.0, 5.0)
    assert flown.ends_after_s(manoeuvre) < WITHIN_S + 2.0


def test_wind_that_holds_it_a_little_off_ends_no_hold() -> None:
    flown = FlightTrace()
    waypoints = [PathWaypoint(Vector3(11.0, 2.0, 5.0), None, None, 60.0), PathWaypoint(Vector3(31.0, 2.0, 5.0))]
    manoeuvre = follow(flown, path(START, waypoints, 0.0, at(2.0)))
    flown.run(manoeuvre, 20.0)
    flown.wind = Vector3(0.0, 1.2)
    flown.run(manoeuvre, 40.0)
    flown.wind = Vector3()
    assert flown.until_end(manoeuvre) is None


@pytest.mark.parametrize("tracker", [TrajectoryReference, Pursuit])
def test_a_gust_that_blows_it_far_off_and_ends_does_not_end_the_motion(tracker: MakeTracker) -> None:
    flown = FlightTrace(lag_s=2.0)
    manoeuvre = follow(flown, path(START, [PathWaypoint(Vector3(60.0, 2.0, 5.0))], 0.0, at(3.0)), tracker)
    flown.run(manoeuvre, 4.0)
    flown.wind = Vector3(0.0, 12.0)
    flown.run(manoeuvre, 6.0)
    flown.wind = Vector3()
    assert flown.until_end(manoeuvre) is None


@pytest.mark.parametrize("tracker", [TrajectoryReference, Pursuit])
def test_a_goal_from_which_it_is_held_off_ends_within_10_s_of_coming_no_nearer(tracker: MakeTracker) -> None:
    flown = FlightTrace()
    manoeuvre = follow(flown, path(START, [PathWaypoint(Vector3(11.0, 2.0, 5.0))], 0.0, at(2.0)), tracker)
    flown.wind = Vector3(0.0, 1.3)
    flown.run(manoeuvre, 6.0)
    assert flown.ends_after_s(manoeuvre) < WITHIN_S + 1.0


def test_a_turn_that_does_not_come_ends_within_10_s_and_a_slow_one_does_not() -> None:
    turn = path(START, [PathWaypoint(START.position, -2.8)], 0.0, Limits(yaw_rate_rad_s=0.05))
    assert turn.duration_s > 50.0
    slow = FlightTrace()
    assert slow.until_end(follow(slow, turn)) is None
    flown = FlightTrace()
    flown.is_turned_fast = True
    quick = path(START, [PathWaypoint(START.position, -2.8)], 0.0, Limits(yaw_rate_rad_s=2.0))
    assert flown.ends_after_s(follow(flown, quick)) < WITHIN_S + quick.duration_s


def test_a_pause_counts_for_nothing() -> None:
    flown = FlightTrace()
    manoeuvre = follow(flown, path(START, [PathWaypoint(Vector3(21.0, 2.0, 5.0))], 0.0, at(2.0)))
    assert manoeuvre.task is not None
    flown.run(manoeuvre, 3.0)
    manoeuvre.task.is_paused = True
    flown.run(manoeuvre, 60.0)
    manoeuvre.task.is_paused = False
    assert flown.until_end(manoeuvre) is None


def test_a_time_without_updates_counts_for_nothing() -> None:
    flown = FlightTrace()
    manoeuvre = follow(flown, path(START, [PathWaypoint(Vector3(21.0, 2.0, 5.0))], 0.0, at(2.0)))
    flown.run(manoeuvre, 3.0)
    flown.now_s += 30.0
    assert flown.until_end(manoeuvre) is None


# --- A goal that moves ------------------------------------------------------------------------------------------------


def follow_moving_goal(flown: FlightTrace, goal: Callable[[float], Motion], limits: Limits) -> FollowMovingGoal:
    moving = MovingGoal(goal, START, 0.0, lambda: limits)
    return FollowMovingGoal(
        "go_to_waypoint", flown.task(TaskKind.GO_TO_WAYPOINT), moving, lambda: limits, ToleranceSettings()
    )


@pytest.mark.parametrize("speed_m_s", [0.5, 4.0])
def test_a_goal_that_moves_away_faster_is_chased_on_and_one_that_is_not_followed_ends(speed_m_s: float) -> None:
    def goal(now_s: float) -> Motion:
        return Motion(Vector3(6.0 + speed_m_s * now_s, 2.0, 5.0), 0.0, Vector3(speed_m_s))

    flown = FlightTrace()
    chase = follow_moving_goal(flown, goal, at(0.8 * speed_m_s))
    flown.run(chase, 40.0)
    flown.is_held_fast = True
    assert flown.ends_after_s(chase) < WITHIN_S + 0.3 / speed_m_s


def test_a_goal_that_moves_is_met_at_0_05_m_s() -> None:
    def goal(now_s: float) -> Motion:
        return Motion(Vector3(3.0 + 0.02 * now_s, 2.0, 5.0), 0.3, Vector3(0.02))

    flown = FlightTrace(wanders_m=0.2)
    assert flown.until_end(follow_moving_goal(flown, goal, at(0.05))) is None


def test_a_heading_of_a_moving_goal_that_is_not_taken_ends_within_10_s() -> None:
    flown = FlightTrace()
    flown.is_turned_fast = True
    chase = follow_moving_goal(flown, lambda _: Motion(START.position, 2.0), at(2.0))
    assert flown.ends_after_s(chase) < WITHIN_S + 4.0


# --- The watch itself -------------------------------------------------------------------------------------------------


def test_what_is_left_may_grow_for_a_while_and_counts_again_once_it_falls() -> None:
    watch = Headway()
    for step in range(200):
        way_m = 10.0 + 0.5 * step if step < 70 else 45.0 - 0.5 * (step - 70)
        assert watch.stuck_s(step * 0.1, way_m, 0.0, lambda passed_s: -passed_s) == 0.0
