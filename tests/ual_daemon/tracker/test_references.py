from __future__ import annotations

import math

import pytest

from tests.snapshots import changed
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.values import MotionState, PositionSetpoint, Sample, Snapshot, VelocitySetpoint
from ual_daemon.tracker.drift import DriftCorrection
from ual_daemon.tracker.references import Hold, TrajectoryReference, Velocity, brake, measured_motion
from ual_daemon.trajectory import Motion, StraightTrajectory

LIMITS = Limits()
STEP_S = 0.02


def at(
    position: Vector3,
    time_s: float = 0.0,
    yaw_rad: float = 0.0,
    velocity: Vector3 | None = None,
    yaw_rate_rad_s: float = 0.0,
) -> Snapshot:
    twist = None if velocity is None else Sample(Twist(velocity, Vector3(0.0, 0.0, yaw_rate_rad_s)), time_s)
    return Snapshot(
        time_s=time_s,
        motion=MotionState(pose=Sample(Pose(position, Quaternion.from_yaw(yaw_rad)), time_s), velocity=twist),
    )


def test_a_hold_is_sent_as_it_is_wherever_the_uav_is() -> None:
    hold = Hold(Vector3(1, 2, 3), 0.5)
    for position in (Vector3(), Vector3(100, 0, 0)):
        assert hold.setpoint(at(position)) == PositionSetpoint(Vector3(1, 2, 3), 0.5)
        assert hold.motion(at(position)) == Motion(Vector3(1, 2, 3), 0.5)
    pose = hold.pose()
    assert pose is not None
    assert pose.position == Vector3(1, 2, 3)
    assert pose.yaw_rad == pytest.approx(0.5)


def test_a_velocity_in_the_body_turns_with_the_heading_and_stays_level() -> None:
    velocity = Velocity(Twist(Vector3(1, 0, 0.5), Vector3(0, 0, 0.3)), DriftCorrection(), in_body=True, expires_s=1.0)
    tilted = Pose(Vector3(), Quaternion.from_euler(0.3, -0.2, math.pi / 2))
    setpoint = velocity.setpoint(Snapshot(time_s=0.0, motion=MotionState(pose=Sample(tilted, 0.0))))
    assert isinstance(setpoint, VelocitySetpoint)
    assert tuple(setpoint.velocity) == pytest.approx((0.0, 1.0, 0.5))
    assert setpoint.yaw_rate_rad_s == 0.3
    assert velocity.pose() is None


def test_a_velocity_outside_the_body_is_sent_as_it_is() -> None:
    velocity = Velocity(Twist(Vector3(1, 0, 0)), DriftCorrection(), in_body=False, expires_s=1.0)
    assert velocity.setpoint(at(Vector3(), yaw_rad=1.0)) == VelocitySetpoint(Vector3(1, 0, 0))


def test_the_measured_motion_is_that_of_the_snapshot() -> None:
    snapshot = at(Vector3(1, 2, 3), yaw_rad=0.5, velocity=Vector3(1, 0, 0), yaw_rate_rad_s=0.2)
    found = measured_motion(snapshot)
    assert (found.position, found.velocity, found.yaw_rate_rad_s) == (Vector3(1, 2, 3), Vector3(1, 0, 0), 0.2)
    assert found.yaw_rad == pytest.approx(0.5)
    assert measured_motion(at(Vector3(1, 2, 3))).velocity == Vector3()


def row() -> StraightTrajectory:
    return StraightTrajectory(Motion(Vector3(), 0.0), Vector3(10, 0, 0), 1.0, LIMITS)


def test_a_uav_that_keeps_up_gets_the_trajectory_in_real_time() -> None:
    follow = TrajectoryReference(row(), now_s=0.0)
    position, time_s = Vector3(), 0.0
    while not follow.is_finished:
        time_s += STEP_S
        setpoint = follow.setpoint(at(position, time_s))
        assert isinstance(setpoint, PositionSetpoint)
        position = setpoint.position
        assert follow.time_s == pytest.approx(min(time_s, row().duration_s))
    assert position == Vector3(10, 0, 0)
    pose = follow.pose()
    assert pose is not None
    assert pose.yaw_rad == pytest.approx(1.0)


def test_the_reference_waits_for_a_uav_that_is_stuck_and_goes_on_once_it_moves() -> None:
    follow = TrajectoryReference(row(), now_s=0.0)
    setpoint = None
    for i in range(1, 3000):
        setpoint = follow.setpoint(at(Vector3(), i * STEP_S))
    assert isinstance(setpoint, PositionSetpoint)
    assert not follow.is_finished
    # The reference stands still, not far away, and commands no speed.
    assert 0.5 < setpoint.position.x < 4.5
    assert setpoint.velocity.norm() < 0.01
    waited_s = follow.time_s
    for i in range(3000, 3300):
        setpoint = follow.setpoint(at(setpoint.position, i * STEP_S))
        assert isinstance(setpoint, PositionSetpoint)
    assert follow.time_s > waited_s + 4.0  # after it has sped up, in real time again


def test_a_pause_between_updates_does_not_make_the_reference_jump() -> None:
    follow = TrajectoryReference(row(), now_s=0.0)
    follow.setpoint(at(Vector3(), 5.0))
    assert follow.time_s <= 0.2
    follow.setpoint(at(Vector3(), 4.0))  # nor does a clock that goes back
    assert follow.time_s <= 0.2


def test_without_a_pose_the_reference_waits() -> None:
    follow = TrajectoryReference(row(), now_s=0.0)
    follow.setpoint(changed(at(Vector3(), 0.1), pose=None))
    assert follow.time_s == 0.0


def test_braking_begins_with_the_measured_motion_and_ends_in_a_hold() -> None:
    stop = brake(at(Vector3(5, 5, 5), 100.0, yaw_rad=1.0, velocity=Vector3(1.0, 0.0, 0.0)), LIMITS)
    assert stop.trajectory.at(0.0).velocity == Vector3(1.0, 0.0, 0.0)
    end = stop.trajectory.end().position
    assert (end.y, end.z) == (5.0, 5.0)
    assert 5.2 < end.x < 6.0
