"""Goals in frames that a client moves: following a car. In stepped time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence

import pytest

from tests.ual_daemon.stepped import STEP_S, UPDATE_S, Stepped, at, stepped
from ual.errors import GeofenceError, TaskAbortedError, UnknownFrameError, WrongStateError
from ual.geometry import Pose, PoseStamped, Quaternion, Transform, Twist, Vector3, wrap_angle
from ual.types import Limits, State, TaskStatus
from ual_daemon.backends.values import MotionState, Sample, Snapshot
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import GeofenceSettings, VehicleSettings
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.trajectory import Motion

CAR = "car/base_link"
FAST = {"horizontal_speed_m_s": 8.0, "vertical_speed_m_s": 3.0, "horizontal_acceleration_m_s2": 3.0}
CarPose = Callable[[float], tuple[float, float, float]]
"""x, y and heading of the car at a time."""


class Followed:
    """A UAV in the air, and a car that is driven while time passes; its frame is updated ten times a second."""

    def __init__(self, uav: Stepped, pose: CarPose) -> None:
        self.uav = uav
        self._pose = pose
        self.time_s = 0.0
        self.is_updating = True
        self._update_frame()
        self._update_frame()  # twice, so that it is a frame that moves

    def _update_frame(self) -> None:
        x, y, yaw = self._pose(self.time_s)
        self.uav.vehicle.frame_editor.add(Transform(Vector3(x, y, 0.0), Quaternion.from_yaw(yaw), "map", CAR))

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / STEP_S)):
            self.uav.run(STEP_S)
            self.time_s += STEP_S
            if self.is_updating and round(self.time_s / STEP_S) % 5 == 0:
                self._update_frame()

    def until_done(self, task: VehicleTask, limit_s: float = 90.0) -> None:
        for _ in range(round(limit_s / 0.1)):
            if task.future.done():
                task.future.result()
                return
            self.run(0.1)
        raise AssertionError("not done")

    def distance_m(self, over_m: float = 4.0, behind_m: float = 0.0) -> float:
        """Returns how far the UAV is from its goal above, and behind, the car."""
        x, y, yaw = self._pose(self.time_s)
        goal = Vector3(x - behind_m * math.cos(yaw), y - behind_m * math.sin(yaw), over_m)
        return (self.uav.pose.position - goal).norm()


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped(light=FAST) as it:
        it.fly()
        yield it


def steady(speed_m_s: float) -> CarPose:
    return lambda t: (speed_m_s * t, 5.0, 0.0)


def over_the_car(z: float = 4.0, x: float = 0.0) -> PoseStamped:
    return at(x, 0.0, z, 0.0, CAR)


@pytest.mark.parametrize("car_m_s", [0.0, 0.2])
def test_the_maximum_speed_holds_on_a_diagonal_too(uav: Stepped, car_m_s: float) -> None:
    car = Followed(uav, steady(car_m_s))
    car.run(1.0)
    task = uav.prepare.go_to_waypoint(over_the_car(8.0), max_speed_m_s=0.5).begin()
    uav.keep_samples()
    car.until_done(task)
    assert max(sample.velocity.linear.norm() for sample in uav.samples if sample.velocity) <= 0.52


def test_a_slow_path_to_a_car_does_not_time_out(uav: Stepped) -> None:
    car = Followed(uav, steady(0.0))
    car.run(1.0)
    task = uav.prepare.go_to_waypoint(over_the_car(), max_speed_m_s=0.05).begin()
    car.until_done(task, 150.0)


@pytest.mark.parametrize("speed_m_s", [0.0, 2.0, 5.0])
def test_a_car_at_a_steady_speed_is_met_and_followed_without_lag(uav: Stepped, speed_m_s: float) -> None:
    car = Followed(uav, steady(speed_m_s))
    car.run(1.0)
    task = uav.prepare.go_to_waypoint(over_the_car()).begin()
    car.until_done(task)
    assert task.info().status is TaskStatus.SUCCEEDED
    car.run(3.0)
    distances_m = []
    for _ in range(50):
        car.run(0.1)
        distances_m.append(car.distance_m())
    assert max(distances_m) < 0.1 + 0.02 * speed_m_s


def test_a_goal_behind_a_car_that_turns_is_followed_in_position_and_heading(uav: Stepped) -> None:
    car = Followed(uav, lambda t: (12.0 * math.sin(0.2 * t), 12.0 * (1.0 - math.cos(0.2 * t)), 0.2 * t))
    car.run(0.5)
    car.until_done(uav.prepare.go_to_waypoint(over_the_car(x=-3.0)).begin())
    car.run(2.0)
    for _ in range(100):
        car.run(0.1)
        assert car.distance_m(behind_m=3.0) < 0.7
        assert abs(wrap_angle(uav.pose.yaw_rad - 0.2 * car.time_s)) < 0.15


def test_the_reference_has_no_steps(uav: Stepped) -> None:
    """Not at the beginning, and not where the car stops or is put elsewhere."""
    uav.keep_samples()
    car = Followed(uav, lambda t: (min(3.0 * t, 30.0) + (25.0 if t > 16.0 else 0.0), 5.0, 0.0))
    uav.prepare.go_to_waypoint(over_the_car()).begin()
    car.run(30.0)
    references = [(s.stamp_s, s.reference_pose.position) for s in uav.samples if s.reference_pose]
    speeds = [((b - a) / (t1 - t0), t1) for (t0, a), (t1, b) in itertools.pairwise(references) if t1 - t0 > STEP_S / 2]
    for (v0, t0), (v1, t1) in itertools.pairwise(speeds):
        assert v1.horizontal_norm() <= 8.0 * 1.01
        assert (v1 - v0).horizontal_norm() / (t1 - t0) <= 3.0 * 1.5
    assert car.distance_m() < 0.2


def test_the_uav_waits_when_the_frame_of_the_car_is_updated_no_more(uav: Stepped) -> None:
    car = Followed(uav, steady(3.0))
    car.until_done(uav.prepare.go_to_waypoint(over_the_car()).begin())
    car.is_updating = False
    car.run(5.0)
    rest = uav.pose.position
    car.run(3.0)
    assert (uav.pose.position - rest).norm() < 0.05


def test_a_pose_in_a_moving_frame_is_followed_too_and_another_command_ends_that(uav: Stepped) -> None:
    car = Followed(uav, steady(2.0))
    uav.vehicle.commands.setpoints.set_pose(over_the_car())
    car.run(15.0)
    assert car.distance_m() < 0.2
    car.until_done(uav.prepare.go_to_waypoint(at(0.0, 0.0, 3.0)).begin())
    assert (uav.pose.position - Vector3(0.0, 0.0, 3.0)).norm() < 0.2


def test_it_is_a_task_that_can_be_cancelled(uav: Stepped) -> None:
    car = Followed(uav, steady(2.0))
    task = uav.prepare.go_to_waypoint(over_the_car()).begin()
    car.run(2.0)
    uav.vehicle.commands.cancel(task)
    with pytest.raises(TaskAbortedError):
        task.future.result()
    car.run(4.0)
    rest = uav.pose.position
    car.run(2.0)
    assert (uav.pose.position - rest).norm() < 0.05


def test_a_car_that_leaves_the_geofence_is_followed_to_its_edge() -> None:
    square = ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0))
    with stepped(VehicleSettings(geofence=GeofenceSettings(polygon=square)), light=FAST) as uav:
        uav.fly()
        car = Followed(uav, lambda t: (2.0 * t if t < 11.5 else 46.0 - 2.0 * t, 5.0, 0.0))
        car.until_done(uav.prepare.go_to_waypoint(over_the_car()).begin())
        while car.time_s < 12.0:
            car.run(0.1)
            assert uav.pose.position.x < 20.2
            reference = uav.vehicle.telemetry().reference_pose
            assert reference is not None
            assert reference.position.x <= 20.05
        assert uav.pose.position.x > 14.0
        with pytest.raises(GeofenceError):
            uav.prepare.go_to_waypoint(over_the_car())
        while car.time_s < 21.0:  # it has come back, and is followed again
            car.run(0.1)
        assert car.distance_m() < 0.3


@pytest.mark.parametrize("paused_after_s", [3.0, 4.5, 4.7, 5.0, 6.0])
def test_a_pause_of_this_computer_leads_neither_ahead_nor_out_of_the_geofence(paused_after_s: float) -> None:
    """In 0.9 s the plan went on by 7 m, as one step, and up to 5 m beyond the edge: only 0.2 s of it were admitted."""
    edge_m, limits = 40.0, Limits(horizontal_speed_m_s=8.0)

    def admit(points: Sequence[Vector3], _: Snapshot) -> None:
        if any(point.x > edge_m for point in points):
            raise GeofenceError("beyond the edge")

    def goal(time_s: float) -> Motion:
        return Motion(Vector3(min(edge_m + 5.0, 2.0 + 8.0 * time_s), 0.0, 5.0), 0.0, Vector3(6.0, 0.0, 0.0))

    motion, time_s = Motion(Vector3(0.0, 0.0, 5.0), 0.0), 0.0
    followed = MovingGoal(goal, motion, time_s, lambda: limits, admit)
    for _ in range(round(12.0 / STEP_S)):
        pose, velocity = Pose.at(*motion.position), Twist(motion.velocity)
        now = Snapshot(time_s, motion=MotionState(pose=Sample(pose, time_s), velocity=Sample(velocity, time_s)))
        followed.setpoint(now)
        sent = followed.motion(now)
        assert (sent.position - motion.position).norm() < 1.0
        assert sent.position.x <= edge_m
        motion, time_s = sent, time_s + STEP_S
        if abs(time_s - paused_after_s) < STEP_S / 2:
            time_s += 0.9
    assert motion.position.x > edge_m - 10.0


def test_a_goal_without_a_heading_keeps_the_heading_of_the_uav(uav: Stepped) -> None:
    car = Followed(uav, lambda t: (t, 5.0, 0.3 * t))
    car.until_done(uav.prepare.go_to_waypoint(at(0.0, 0.0, 4.0, None, CAR)).begin())
    assert uav.pose.yaw_rad == pytest.approx(0.0, abs=0.02)


def move_below_the_body(uav: Stepped) -> None:
    uav.vehicle.frame_editor.add(Transform(Vector3(1.0, 0.0, 0.0), Quaternion.from_yaw(0.0), "uav_1/base_link", CAR))


def move_beyond_all_distances(uav: Stepped) -> None:
    uav.vehicle.frame_editor.add(Transform(Vector3(9_999_999.9, 0.0, 0.0), Quaternion.from_yaw(0.0), "map", CAR))


@pytest.mark.parametrize("lose", [move_below_the_body, move_beyond_all_distances])
def test_the_uav_stops_when_the_goal_is_lost_and_the_updates_go_on(
    uav: Stepped, lose: Callable[[Stepped], None], caplog: pytest.LogCaptureFixture
) -> None:
    uav.keep_samples()
    car = Followed(uav, steady(3.0))
    car.run(1.0)
    uav.vehicle.commands.setpoints.set_pose(over_the_car(x=5.0))
    car.run(8.0)
    assert uav.speed > 2.5
    lose(uav)
    at_loss_m, count = uav.pose.position.x, len(uav.samples)
    uav.run(10.0)
    assert uav.speed < 0.05
    assert uav.pose.position.x - at_loss_m < 4.0
    assert len(uav.samples) - count >= 9.0 / UPDATE_S  # a failed update would give no sample
    assert "defect" not in caplog.text


def test_a_goto_fails_with_the_reason_when_its_goal_is_lost_and_the_uav_holds(uav: Stepped) -> None:
    car = Followed(uav, steady(3.0))
    car.run(1.0)
    task = uav.prepare.go_to_waypoint(over_the_car()).begin()
    car.run(1.0)
    move_below_the_body(uav)
    uav.run(UPDATE_S)
    with pytest.raises(WrongStateError, match="base_link"):
        task.future.result(0)
    uav.run(10.0)
    assert uav.speed < 0.05


def test_the_uav_stops_where_the_frame_of_its_goal_is_removed(uav: Stepped) -> None:
    car = Followed(uav, steady(1.0))
    car.run(1.0)
    task = uav.prepare.go_to_waypoint(over_the_car()).begin()
    car.run(1.0)
    car.is_updating = False
    uav.vehicle.frame_editor.remove(CAR)
    with pytest.raises(UnknownFrameError):
        uav.end(task.future)
    uav.run(5.0)
    assert uav.state is State.FLYING_AUTO
    assert uav.speed < 0.05
