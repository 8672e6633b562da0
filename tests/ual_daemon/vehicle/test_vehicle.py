"""The vehicle above the light backend: commands, tasks, references, the safety pilot, faults. In stepped time."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

import pytest

from tests.ual_daemon.stepped import STEP_S, UPDATE_S, Stepped, at, stepped
from ual.errors import (
    GeofenceError,
    InvalidArgumentError,
    LinkLostError,
    RejectedByAutopilotError,
    TaskAbortedError,
    UalError,
    UalTimeoutError,
    UnknownFrameError,
    WrongStateError,
)
from ual.geometry import IDENTITY, Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3
from ual.simulation import (
    AckLate,
    AckLost,
    Command,
    CommandRefused,
    EstimatorJumps,
    LinkLost,
    MotorsWeak,
    PositionLost,
)
from ual.types import AltitudeReference, GeoPoint, State, TaskKind, TaskStatus
from ual_daemon.backends.base import BackendOptions
from ual_daemon.backends.light import LightBackend
from ual_daemon.backends.values import PositionSetpoint, Setpoint, Snapshot
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.settings import FrameSettings, LimitSettings, VehicleSettings
from ual_daemon.tracker.references import Hold
from ual_daemon.vehicle.refusal_log import RefusalLog
from ual_daemon.vehicle.vehicle import Vehicle


def velocity(x: float, y: float = 0.0, z: float = 0.0, yaw_rate_rad_s: float = 0.0, frame_id: str = "") -> TwistStamped:
    return TwistStamped(Twist(Vector3(x, y, z), Vector3(0.0, 0.0, yaw_rate_rad_s)), frame_id)


def failure(task: VehicleTask) -> UalError:
    error = task.future.exception(timeout=0)
    assert isinstance(error, UalError)
    return error


# --- Take-off and landing ---------------------------------------------------------------------------------------------


def test_a_flight_goes_through_its_states(uav: Stepped) -> None:
    uav.keep_samples()
    uav.run(UPDATE_S)
    uav.arm()
    uav.end(uav.prepare.take_off(3.0).begin().future)
    uav.end(uav.prepare.land().begin().future)
    uav.until(lambda: uav.state is State.LANDED_DISARMED)
    assert uav.states == [
        State.LANDED_DISARMED,
        State.LANDED_ARMED,
        State.TAKING_OFF,
        State.FLYING_AUTO,
        State.LANDING,
        State.LANDED_ARMED,
        State.LANDED_DISARMED,
    ]


@pytest.mark.parametrize("height_m", [0.5, 3.0, 20.0])
def test_take_off_ends_within_5_percent_of_its_height_and_slow(uav: Stepped, height_m: float) -> None:
    uav.keep_samples()
    uav.arm()
    task = uav.prepare.take_off(height_m).begin()
    assert task.info().status is TaskStatus.RUNNING
    uav.end(task.future)
    assert abs(uav.pose.position.z - height_m) <= max(0.1, 0.05 * height_m)
    assert uav.speed < 0.25
    assert max(s.pose.position.z for s in uav.samples if s.pose) <= height_m * 1.02
    assert task.info().status is TaskStatus.SUCCEEDED
    assert task.info().progress == 1.0


@pytest.mark.parametrize("height_m", [0.05, 0.1, 0.2])
def test_a_low_take_off_ends_in_the_air(uav: Stepped, height_m: float) -> None:
    """The ground is within the tolerance of a low height."""
    uav.arm()
    uav.end(uav.prepare.take_off(height_m).begin().future)
    assert uav.state is State.FLYING_AUTO
    assert uav.pose.position.z == pytest.approx(height_m, abs=0.03)


def test_take_off_height_is_above_the_ground_under_the_uav() -> None:
    with stepped(light={"start": [5.0, -2.0, 0.0]}) as uav:
        uav.fly(2.0)
        p = uav.pose.position
        assert (p.x, p.y) == pytest.approx((5.0, -2.0), abs=0.01)
        assert p.z == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("height_m", [0.0, -1.0, math.nan, math.inf, 2e7, "three"])
def test_take_off_refuses_impossible_heights(uav: Stepped, height_m: float) -> None:
    uav.arm()
    with pytest.raises(InvalidArgumentError, match="height_m"):
        uav.prepare.take_off(height_m).begin()
    uav.run(1.0)
    assert uav.pose.position.z == 0.0


def test_take_off_and_land_cannot_be_replaced_nor_cancelled(uav: Stepped) -> None:
    uav.arm()
    climb = uav.prepare.take_off(3.0).begin()
    for command in (
        lambda: uav.prepare.take_off(1.0).begin(),
        lambda: uav.vehicle.commands.cancel(climb),
        uav.vehicle.commands.abort,
        uav.prepare.land,
    ):
        with pytest.raises(WrongStateError):
            command()
    uav.end(climb.future)
    descent = uav.prepare.land().begin()
    for command in (uav.prepare.land, lambda: uav.vehicle.commands.cancel(descent), uav.vehicle.commands.abort):
        with pytest.raises(WrongStateError):
            command()
    with pytest.raises(WrongStateError, match=r"LANDING|land is under way"):
        uav.prepare.go_to_waypoint(at(1, 1, 1)).begin()
    uav.end(descent.future)


@pytest.mark.parametrize("phase", ["take_off", "land"])
def test_the_safety_pilot_aborts_take_off_and_landing(uav: Stepped, phase: str) -> None:
    uav.arm()
    task = uav.prepare.take_off(5.0).begin()
    if phase == "land":
        uav.end(task.future)
        task = uav.prepare.land().begin()
    uav.run(1.5)
    uav.sim.pilot_take_over()
    uav.run(2 * STEP_S)
    assert isinstance(failure(task), TaskAbortedError)
    assert failure(task).metadata["by"] == "safety pilot"
    assert uav.is_in(State.FLYING_MANUAL)


# --- Go-tos and paths -------------------------------------------------------------------------------------------------


def test_go_to_is_straight_with_a_synchronized_heading_and_does_not_overshoot(flying: Stepped) -> None:
    flying.keep_samples()
    task = flying.prepare.go_to_waypoint(at(4, 2, 5, math.pi / 2)).begin()
    flying.end(task.future)
    start, goal = Vector3(0, 0, 3), Vector3(4, 2, 5)
    length = (goal - start).norm()
    along = (goal - start) / length
    for sample in flying.samples:
        assert sample.pose is not None
        way = sample.pose.position - start
        assert (way - along * way.dot(along)).norm() < 0.05
        assert way.dot(along) < length + 0.05
        # The heading turns in proportion to the distance.
        if 0.3 * length < way.dot(along) < 0.7 * length:
            turned = sample.pose.yaw_rad / (math.pi / 2)
            assert turned == pytest.approx(way.dot(along) / length, abs=0.15)
    assert (flying.pose.position - goal).norm() < 0.05
    assert flying.pose.yaw_rad == pytest.approx(math.pi / 2, abs=0.02)


def test_go_to_turns_the_smaller_angle(flying: Stepped) -> None:
    flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3, math.radians(170))).begin().future)
    flying.keep_samples()
    flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3, math.radians(-170))).begin().future)
    assert all(abs(s.pose.yaw_rad) > math.radians(168) for s in flying.samples if s.pose)


def test_a_goal_without_orientation_keeps_the_heading(flying: Stepped) -> None:
    flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3, 1.0)).begin().future)
    flying.end(flying.prepare.go_to_waypoint(at(2, 0, 3)).begin().future)
    assert flying.pose.yaw_rad == pytest.approx(1.0, abs=0.02)


def test_a_goal_at_the_present_pose_succeeds_at_once(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(0, 0, 3)).begin()
    flying.end(task.future, limit_s=3.0)
    assert task.info().status is TaskStatus.SUCCEEDED


def test_goals_in_other_frames(flying: Stepped) -> None:
    vehicle = flying.vehicle
    vehicle.frame_editor.add(Transform(Vector3(10, 0, 0), Quaternion.from_yaw(math.pi / 2), "map", "dock"))
    flying.end(flying.prepare.go_to_waypoint(at(1, 7, 3, 0.0, "dock")).begin().future)
    assert tuple(flying.pose.position) == pytest.approx((3, 1, 3), abs=0.03)
    assert flying.pose.yaw_rad == pytest.approx(math.pi / 2, abs=0.02)
    flying.end(flying.prepare.go_to_waypoint(at(2, 0, 1, None, "uav_1/base_link")).begin().future)  # ahead and up
    assert tuple(flying.pose.position) == pytest.approx((3, 3, 4), abs=0.03)


def test_the_autopilot_is_at_a_geographic_goal_in_the_end(flying: Stepped) -> None:
    origin = flying.vehicle.backend.snapshot().earth.projection
    assert origin is not None
    goal = origin.to_geo(Vector3(5, 4, 6))
    for reference, altitude in (
        (AltitudeReference.HOME, 6.0),
        (AltitudeReference.AMSL, 16.0),
        (AltitudeReference.ELLIPSOID, 65.5),
    ):
        task = flying.prepare.go_to_waypoint_geo(goal.latitude_deg, goal.longitude_deg, altitude, reference).begin()
        flying.end(task.future)
        there = flying.vehicle.telemetry().position_geo
        assert there is not None
        assert there.latitude_deg == pytest.approx(goal.latitude_deg, abs=3e-7)
        assert there.longitude_deg == pytest.approx(goal.longitude_deg, abs=3e-7)
        assert there.altitude_home_m == pytest.approx(6.0, abs=0.03)


@pytest.mark.parametrize(("latitude", "longitude"), [(91, 0), (-91, 0), (0, 181), (math.nan, 0), (0, math.inf)])
def test_impossible_geographic_goals_are_refused(flying: Stepped, latitude: float, longitude: float) -> None:
    with pytest.raises(InvalidArgumentError, match="itude_deg"):
        flying.prepare.go_to_waypoint_geo(latitude, longitude, 5.0).begin()


def test_a_path_stops_at_each_waypoint_or_rounds_corners(flying: Stepped) -> None:
    flying.keep_samples()
    corners = [at(3, 0, 3), at(3, 3, 3), at(0, 3, 3)]
    task = flying.prepare.follow_path(corners).begin()
    flying.end(task.future)
    stopped = min((s.pose.position - Vector3(3, 0, 3)).norm() for s in flying.samples if s.pose)
    assert stopped < 0.02
    assert task.info().waypoint_index == 2
    flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3)).begin().future)
    flying.keep_samples()
    flying.end(flying.prepare.follow_path(corners, corner_radius_m=1.0).begin().future)
    nearest = min((s.pose.position - Vector3(3, 0, 3)).norm() for s in flying.samples if s.pose)
    assert 0.2 < nearest < 1.0
    assert tuple(flying.pose.position) == pytest.approx((0, 3, 3), abs=0.03)


def test_at_a_stop_the_reference_waits_until_the_uav_has_stopped() -> None:
    sluggish = {"response_s": 1.5}
    with stepped(light=sluggish) as uav:
        uav.fly()
        uav.keep_samples()
        corner = Vector3(3, 0, 3)
        uav.end(uav.prepare.follow_path([at(3, 0, 3), at(3, 3, 3)]).begin().future)
        near = [s for s in uav.samples if s.pose and (s.pose.position - corner).norm() < 0.5]
        assert min(s.velocity.linear.norm() for s in near if s.velocity) <= 0.5


def test_an_empty_path_is_refused(flying: Stepped) -> None:
    with pytest.raises(InvalidArgumentError, match="waypoints"):
        flying.prepare.follow_path([]).begin()


def test_the_limits_of_the_user_hold() -> None:
    slow = VehicleSettings(limits=LimitSettings(horizontal_speed_m_s=0.5, climb_speed_m_s=0.4))
    with stepped(slow) as uav:
        uav.keep_samples()
        uav.arm()
        uav.end(uav.prepare.take_off(2.0).begin().future)
        uav.end(uav.prepare.go_to_waypoint(at(2, 0, 2)).begin().future)
        uav.vehicle.commands.setpoints.set_velocity(velocity(1.5))
        uav.run(0.4)
        speeds = [s.velocity.linear for s in uav.samples if s.velocity]
        assert max(v.horizontal_norm() for v in speeds) <= 0.5 + 0.01
        assert max(v.z for v in speeds) <= 0.4 + 0.01


def test_a_moving_start_bends_smoothly_to_a_new_goal(flying: Stepped) -> None:
    flying.keep_samples()
    first = flying.prepare.go_to_waypoint(at(6, 0, 3)).begin()
    flying.run(2.0)
    second = flying.prepare.go_to_waypoint(at(3, 4, 3)).begin()
    assert isinstance(failure(first), TaskAbortedError)
    assert failure(first).metadata["by"] == "go_to_waypoint"
    flying.end(second.future)
    positions = [s.pose.position for s in flying.samples if s.pose]
    steps = [(b - a).norm() for a, b in itertools.pairwise(positions)]
    assert max(steps) <= 1.6 * UPDATE_S * 1.05
    assert tuple(flying.pose.position) == pytest.approx((3, 4, 3), abs=0.03)


# --- References -------------------------------------------------------------------------------------------------------


def test_a_velocity_moves_and_then_its_watchdog_stops_and_holds(flying: Stepped) -> None:
    for _ in range(20):
        flying.vehicle.commands.setpoints.set_velocity(velocity(1.0, 0.5))
        flying.run(0.1)
    v = flying.vehicle.telemetry().velocity
    assert v is not None
    assert (v.linear.x, v.linear.y) == pytest.approx((1.0, 0.5), abs=0.05)
    at_end = flying.pose.position
    flying.run(0.6)
    flying.until(lambda: flying.speed < 0.01, limit_s=5.0)
    assert (flying.pose.position - at_end).norm() < 1.12 * (0.5 + 1.2)
    rest = flying.pose.position
    flying.run(5.0)
    assert (flying.pose.position - rest).norm() < 0.03
    assert flying.is_in(State.FLYING_AUTO)


def test_a_velocity_beyond_the_limits_is_scaled_and_keeps_its_direction(flying: Stepped) -> None:
    for _ in range(20):
        flying.vehicle.commands.setpoints.set_velocity(velocity(30.0, 40.0, 0.0))
        flying.run(0.1)
    v = flying.vehicle.telemetry().velocity
    assert v is not None
    assert v.linear.horizontal_norm() == pytest.approx(1.6, abs=0.03)
    assert math.atan2(v.linear.y, v.linear.x) == pytest.approx(math.atan2(4, 3), abs=0.01)


def test_setpoints_that_a_caller_streams_are_not_sent_twice(flying: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    flying.update_each_step()
    sent: list[Setpoint] = []
    backend, snapshot = flying.vehicle.backend, flying.vehicle.backend.snapshot
    monkeypatch.setattr(backend, "send", sent.append)
    # The setpoints of the caller come in the middle between two updates.
    monkeypatch.setattr(backend, "snapshot", lambda: snapshot().at(backend.clock.now_s() + STEP_S / 2))
    for _ in range(20):
        flying.vehicle.commands.setpoints.set_velocity(velocity(1.0))
        flying.run(STEP_S)
    assert len(sent) == 20
    flying.run(10 * STEP_S)  # without a new one the updates send it
    assert len(sent) == 30


def test_a_velocity_in_the_body_turns_with_it(flying: Stepped) -> None:
    flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3, math.pi / 2)).begin().future)
    for _ in range(10):
        flying.vehicle.commands.setpoints.set_velocity(velocity(1.0, frame_id="uav_1/base_link"))
        flying.run(0.1)
    v = flying.vehicle.telemetry().velocity
    assert v is not None
    assert (v.linear.x, v.linear.y) == pytest.approx((0.0, 1.0), abs=0.1)
    for _ in range(10):
        flying.vehicle.commands.setpoints.set_velocity(velocity(1.0, yaw_rate_rad_s=0.8, frame_id="uav_1/base_link"))
        flying.run(0.1)
    later = flying.vehicle.telemetry().velocity
    assert later is not None
    assert later.linear.x < -0.3


def test_a_velocity_in_a_turned_frame(flying: Stepped) -> None:
    turned = Transform(Vector3(), Quaternion.from_yaw(math.pi / 2), "map", "street")
    flying.vehicle.frame_editor.add(turned)
    for _ in range(10):
        flying.vehicle.commands.setpoints.set_velocity(velocity(1.0, frame_id="street"))
        flying.run(0.1)
    assert flying.pose.position.y > 0.3
    assert abs(flying.pose.position.x) < 0.05


def test_set_pose_is_held_and_is_the_reference(flying: Stepped) -> None:
    flying.vehicle.commands.setpoints.set_pose(at(1, 1, 3, 1.0))
    reference = flying.vehicle.telemetry().reference_pose
    assert reference is not None
    assert tuple(reference.position) == pytest.approx((1, 1, 3))
    flying.run(10.0)
    assert tuple(flying.pose.position) == pytest.approx((1, 1, 3), abs=0.02)
    assert flying.pose.yaw_rad == pytest.approx(1.0, abs=0.02)


def test_a_reference_replaces_a_task(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(1.0)
    flying.vehicle.commands.setpoints.set_velocity(velocity(0.0, 1.0))
    assert "replaced by set_velocity" in str(failure(task))
    assert task.info().status is TaskStatus.ABORTED


AGAIN: dict[str, Callable[[Stepped], object]] = {
    "abort": lambda uav: uav.vehicle.commands.abort(),
    "go_to_waypoint": lambda uav: uav.prepare.go_to_waypoint(at(20, 0, 3)).begin(),
    "go_to_waypoint in a moving frame": lambda uav: uav.prepare.go_to_waypoint(at(0, 0, 3, frame_id="boat")).begin(),
    "set_pose in a moving frame": lambda uav: uav.vehicle.commands.setpoints.set_pose(at(0, 0, 3, frame_id="boat")),
}


@pytest.mark.parametrize("command", AGAIN)
def test_what_is_commanded_again_between_all_updates_takes_no_longer(flying: Stepped, command: str) -> None:
    """Each begins with the motion of the update before, and so at that time."""
    passed_s, give = [], AGAIN[command]
    for is_again in (False, True):
        flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3)).begin().future)
        for _ in range(2):  # one that is given again moves
            boat = Transform(Vector3(20.0, 0.0, 0.0), IDENTITY, "uav_1/odom", "boat")
            flying.vehicle.frame_editor.add(boat)
        (AGAIN["go_to_waypoint"] if command == "abort" else give)(flying)
        flying.until(lambda: flying.speed > 1.5)
        passed_s.append(0.0)
        while not (flying.pose.position.x > 19.5 or flying.speed < 0.1):
            if is_again or (command == "abort" and passed_s[-1] == 0.0):
                give(flying)
            flying.run(STEP_S)
            passed_s[-1] += STEP_S
    assert passed_s[1] == pytest.approx(passed_s[0], abs=3 * UPDATE_S)


def test_abort_brakes_and_freeze_returns_to_the_position_of_the_abort(flying: Stepped) -> None:
    for freeze in (False, True):
        flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3)).begin().future)
        task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
        flying.run(2.5)
        where = flying.pose.position
        flying.vehicle.commands.abort(freeze)
        assert "cancelled" in str(failure(task))
        flying.run(8.0)
        assert flying.speed < 0.01
        gone = flying.pose.position.x - where.x
        assert gone == pytest.approx(0.0, abs=0.03) if freeze else 0.3 < gone < 1.5


def test_cancelling_a_task_holds_and_later_cancels_do_nothing(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(1.0)
    flying.vehicle.commands.cancel(task)
    assert failure(task).metadata["by"] == "cancel"
    flying.vehicle.commands.cancel(task)
    flying.run(5.0)
    other = flying.prepare.go_to_waypoint(at(0, 0, 3)).begin()
    flying.vehicle.commands.cancel(task)
    flying.vehicle.commands.abort(task_id=task.id)
    assert other.info().status is TaskStatus.RUNNING
    flying.end(other.future)


# --- Preconditions ----------------------------------------------------------------------------------------------------

FLYING: dict[str, Callable[[Stepped], object]] = {
    "land": lambda uav: uav.prepare.land().begin(),
    "go_to_waypoint": lambda uav: uav.prepare.go_to_waypoint(at(1, 1, 1)).begin(),
    "go_to_waypoint_geo": lambda uav: uav.prepare.go_to_waypoint_geo(37.4, -6.0, 5.0).begin(),
    "follow_path": lambda uav: uav.prepare.follow_path([at(1, 1, 1)]).begin(),
    "set_pose": lambda uav: uav.vehicle.commands.setpoints.set_pose(at(1, 1, 1)),
    "set_velocity": lambda uav: uav.vehicle.commands.setpoints.set_velocity(velocity(1.0)),
    "abort": lambda uav: uav.vehicle.commands.abort(),
}
OTHERS: dict[str, Callable[[Stepped], object]] = {
    "take_off": lambda uav: uav.prepare.take_off(3.0).begin(),
    "recover_from_manual": lambda uav: uav.vehicle.commands.recover_from_manual().begin(),
    "set_home": lambda uav: uav.vehicle.commands.set_home(),
    "arm": lambda uav: uav.vehicle.commands.arm(),
    "disarm": lambda uav: uav.vehicle.commands.disarm(),
}


@pytest.mark.parametrize("command", [*FLYING, "take_off", "recover_from_manual", "disarm"])
def test_not_allowed_while_disarmed(uav: Stepped, command: str) -> None:
    with pytest.raises(WrongStateError) as refused:
        (FLYING | OTHERS)[command](uav)
    assert refused.value.state == "LANDED_DISARMED"
    assert refused.value.metadata["needed"] in str(refused.value)


@pytest.mark.parametrize("command", [*FLYING, "recover_from_manual", "arm"])
def test_not_allowed_while_armed_on_the_ground(uav: Stepped, command: str) -> None:
    uav.arm()
    with pytest.raises(WrongStateError, match="LANDED_ARMED"):
        (FLYING | OTHERS)[command](uav)


@pytest.mark.parametrize("command", OTHERS)
def test_not_allowed_while_flying(flying: Stepped, command: str) -> None:
    with pytest.raises(WrongStateError, match="FLYING_AUTO"):
        OTHERS[command](flying)


@pytest.mark.parametrize("command", [*FLYING, "take_off", "set_home", "arm", "disarm"])
def test_not_allowed_while_the_safety_pilot_flies(flying: Stepped, command: str) -> None:
    flying.sim.pilot_take_over()
    flying.run(STEP_S)
    with pytest.raises(WrongStateError, match="FLYING_MANUAL"):
        (FLYING | OTHERS)[command](flying)


NAN = math.nan
BAD_POSES = {
    "not a number": Pose(Vector3(NAN, 0, 3)),
    "infinite": Pose(Vector3(0, math.inf, 3)),
    "too far": Pose(Vector3(2e7, 0, 3)),
    "no rotation": Pose(Vector3(1, 1, 3), Quaternion(1, 1, 1, 1)),
    "zero norm": Pose(Vector3(1, 1, 3), Quaternion(1e-200, 0, 0, 0)),
    "denormal": Pose(Vector3(1, 1, 3), Quaternion(5e-324, 5e-324, 0, 0)),
    "quaternion not a number": Pose(Vector3(1, 1, 3), Quaternion(0, 0, 0, NAN)),
}


@pytest.mark.parametrize("bad", BAD_POSES)
def test_impossible_poses_are_refused_and_nothing_moves(flying: Stepped, bad: str) -> None:
    before = flying.pose
    goal = PoseStamped(BAD_POSES[bad])
    for command in (
        flying.prepare.go_to_waypoint,
        flying.vehicle.commands.setpoints.set_pose,
        lambda g: flying.prepare.follow_path([at(1, 1, 1), g]),
    ):
        with pytest.raises(InvalidArgumentError, match="pose"):
            command(goal)
    flying.run(1.0)
    assert (flying.pose.position - before.position).norm() < 0.03


@pytest.mark.parametrize(
    "bad",
    [velocity(NAN), velocity(0, math.inf), velocity(1001.0), velocity(0, 0, 0, NAN), velocity(900, 900)],
)
def test_impossible_velocities_are_refused_and_nothing_moves(flying: Stepped, bad: TwistStamped) -> None:
    with pytest.raises(InvalidArgumentError, match="velocity"):
        flying.vehicle.commands.setpoints.set_velocity(bad)
    flying.run(1.0)
    assert flying.speed < 0.02


def test_unknown_frames_are_refused_and_the_known_ones_listed(flying: Stepped) -> None:
    for command in (
        lambda: flying.prepare.go_to_waypoint(at(1, 1, 1, None, "nowhere")).begin(),
        lambda: flying.vehicle.commands.setpoints.set_pose(at(1, 1, 1, None, "nowhere")),
        lambda: flying.vehicle.commands.setpoints.set_velocity(velocity(1, frame_id="nowhere")),
        lambda: flying.prepare.follow_path([at(1, 1, 1, None, "nowhere")]).begin(),
        lambda: flying.vehicle.transform("nowhere"),
        lambda: flying.vehicle.frame_editor.add(Transform(frame_id="nowhere", child_frame_id="here")),
    ):
        with pytest.raises(UnknownFrameError, match=r"known are map, uav_1/") as refused:
            command()
        assert "uav_1/odom" in refused.value.metadata["known"]


def test_values_of_the_wrong_type_are_refused(flying: Stepped) -> None:
    for command in (
        lambda: flying.prepare.go_to_waypoint((1, 2, 3)).begin(),  # type: ignore[arg-type]
        lambda: flying.vehicle.commands.setpoints.set_velocity((1, 2, 3)),  # type: ignore[arg-type]
        lambda: flying.vehicle.commands.setpoints.set_pose(PoseStamped(Pose((1, 2)))),  # type: ignore[arg-type]
    ):
        with pytest.raises(InvalidArgumentError):
            command()


@pytest.mark.parametrize("part", ["gimbals", "missions"])
def test_a_defect_of_what_is_next_to_flying_does_not_end_the_flight(
    flying: Stepped, part: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The UAV got no more setpoints, and clients no more samples."""

    def fail(_: Snapshot) -> None:
        raise RuntimeError("a defect")

    broken = getattr(flying.vehicle, part)
    monkeypatch.setattr(broken, "update", fail)
    monkeypatch.setattr(flying.vehicle.gimbals, "due_s", -math.inf)
    flying.keep_samples()
    flying.end(flying.prepare.go_to_waypoint(at(3, 0, 3)).begin().future)
    assert flying.pose.position.x == pytest.approx(3.0, abs=0.3)
    assert flying.samples


def test_an_unknown_task_is_an_invalid_argument(uav: Stepped) -> None:
    with pytest.raises(InvalidArgumentError, match="task_id"):
        uav.vehicle.task("go_to_waypoint-0")


def test_a_refusal_is_logged_once_although_the_age_in_it_grows(caplog: pytest.LogCaptureFixture) -> None:
    refusals = RefusalLog()
    for age_s in (4.7, 4.8, 4.9):
        refusals.log_refusal("set_pose", LinkLostError(f"nothing heard from the autopilot for {age_s} s"))
    assert len(caplog.messages) == 1


def test_refusals_and_state_changes_are_logged(uav: Stepped, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    with pytest.raises(WrongStateError):
        uav.prepare.land().begin()
    for _ in range(100):  # a stream of refused setpoints does not flood the log
        with pytest.raises(WrongStateError):
            uav.vehicle.commands.setpoints.set_velocity(velocity(1.0))
    uav.arm()
    events = [getattr(record, "ual_event", None) for record in caplog.records]
    assert events.count("refused") < 5
    assert "state" in events


# --- The safety pilot and faults --------------------------------------------------------------------------------------


def test_the_safety_pilot_takes_over_and_recover_takes_back(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(1.0)
    flying.sim.pilot_take_over()
    flying.run(2 * STEP_S)
    assert failure(task).metadata["by"] == "safety pilot"
    assert flying.is_in(State.FLYING_MANUAL)
    flying.sim.pilot_move_sticks(forward=0.5, up=0.2)
    flying.run(2.0)
    assert flying.speed > 0.5  # the pilot flies, and UAL does not interfere
    flying.end(flying.vehicle.commands.recover_from_manual().begin(), limit_s=2.0)
    assert flying.is_in(State.FLYING_AUTO)
    flying.run(5.0)
    rest = flying.pose.position
    flying.run(3.0)
    assert (flying.pose.position - rest).norm() < 0.01


def test_the_safety_pilot_gives_back_and_the_uav_holds(flying: Stepped) -> None:
    flying.sim.pilot_take_over()
    flying.sim.pilot_move_sticks(left=1.0)
    flying.run(2.0)
    flying.sim.pilot_give_back()
    flying.run(5.0)
    assert flying.is_in(State.FLYING_AUTO)
    assert flying.speed < 0.01


def test_a_lost_link_ends_the_task_and_comes_back_as_manual(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(1.0)
    fault = flying.sim.begin_fault(LinkLost())
    flying.until(task.future.done, limit_s=2.0)
    assert isinstance(failure(task), LinkLostError)
    assert flying.is_in(State.UNINITIALIZED)
    with pytest.raises(LinkLostError):
        flying.prepare.go_to_waypoint(at(0, 0, 3)).begin()
    flying.run(2.0)
    flying.sim.end_fault(fault)
    flying.run(2 * STEP_S)
    assert flying.is_in(State.FLYING_MANUAL)  # the autopilot held by itself when no setpoints came
    flying.end(flying.vehicle.commands.recover_from_manual().begin())


def test_a_lost_position_is_uninitialized_and_says_why(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(1.0)
    flying.sim.begin_fault(PositionLost(), duration_s=1.0)
    flying.run(3 * STEP_S)
    assert isinstance(failure(task), TaskAbortedError)
    assert flying.is_in(State.UNINITIALIZED)
    assert "position" in flying.vehicle.telemetry().state_reason
    with pytest.raises(WrongStateError, match="position"):
        flying.prepare.land().begin()
    flying.run(1.5)
    assert flying.is_in(State.FLYING_MANUAL)


@pytest.mark.parametrize(
    ("fault", "begin"),
    [
        (Command.ARM, lambda uav: uav.vehicle.commands.arm()),
        (Command.TAKE_OFF, lambda uav: uav.prepare.take_off(3.0).begin().future),
        (Command.LAND, lambda uav: uav.prepare.land().begin().future),
        (Command.TAKE_CONTROL, lambda uav: uav.vehicle.commands.recover_from_manual().begin()),
    ],
)
def test_refusals_carry_the_text_of_the_autopilot(
    uav: Stepped, fault: Command, begin: Callable[[Stepped], object]
) -> None:
    if fault is Command.TAKE_OFF:
        uav.arm()
    elif fault is not Command.ARM:
        uav.fly()
    if fault is Command.TAKE_CONTROL:
        uav.sim.pilot_take_over()
        uav.run(STEP_S)
    before = uav.state
    uav.sim.begin_fault(CommandRefused(fault, "Arm: Accels inconsistent"))
    future = begin(uav)
    with pytest.raises(RejectedByAutopilotError, match="Accels inconsistent"):
        uav.end(future)  # type: ignore[arg-type]
    uav.run(0.5)
    assert uav.state is before


@pytest.mark.parametrize("fault", [AckLost(), AckLate(delay_s=2.0)])
def test_a_flight_needs_no_acknowledgements(uav: Stepped, fault: AckLost | AckLate) -> None:
    uav.sim.begin_fault(fault)
    uav.end(uav.vehicle.commands.arm())
    uav.end(uav.prepare.take_off(2.0).begin().future)
    uav.sim.pilot_take_over()
    uav.run(STEP_S)
    uav.end(uav.vehicle.commands.recover_from_manual().begin())
    uav.end(uav.prepare.land().begin().future)


def test_a_command_without_answer_and_effect_times_out(uav: Stepped) -> None:
    future = uav.vehicle.commands.arm()
    uav.sim.begin_fault(LinkLost())
    uav.vehicle.backend.disarm()
    uav.sim.end_fault()
    uav.run(STEP_S)
    uav.end(future)
    uav.sim.pilot_disarm()
    uav.sim.begin_fault(CommandRefused(Command.ARM))
    uav.sim.begin_fault(AckLost(Command.ARM))
    with pytest.raises(UalTimeoutError, match="did not answer"):
        uav.end(uav.vehicle.commands.arm())


def test_weak_motors_still_arrive(flying: Stepped) -> None:
    flying.sim.begin_fault(MotorsWeak(0.3))
    flying.end(flying.prepare.go_to_waypoint(at(6, 3, 5)).begin().future)
    assert tuple(flying.pose.position) == pytest.approx((6, 3, 5), abs=0.25)


def test_motors_without_power_time_out_and_the_error_names_the_distance(flying: Stepped) -> None:
    flying.run(5.0)  # at rest: without power it would coast on
    flying.sim.begin_fault(MotorsWeak(1e-6))
    task = flying.prepare.go_to_waypoint(at(6, 0, 3)).begin()
    with pytest.raises(UalTimeoutError, match=r"6\.00 m"):
        flying.end(task.future)
    assert task.info().status is TaskStatus.FAILED


def test_a_go_to_arrives_in_wind(flying: Stepped) -> None:
    flying.keep_samples()
    flying.sim.set_wind(Vector3(0, 3.0, 0))
    flying.end(flying.prepare.go_to_waypoint(at(6, 0, 3)).begin().future)
    assert max(abs(s.pose.position.y) for s in flying.samples if s.pose) < 0.15


def test_estimator_jumps_end_well(flying: Stepped) -> None:
    flying.sim.begin_fault(EstimatorJumps(Vector3(0.5, 0.5, 0), 3.0), duration_s=8.0)
    flying.end(flying.prepare.go_to_waypoint(at(6, 0, 3)).begin().future)


# --- Home, frames, telemetry ------------------------------------------------------------------------------------------


def test_set_home_moves_odom() -> None:
    with stepped(light={"start": [5.0, 2.0, 0.0]}) as uav:
        assert tuple(uav.pose.position) == (5, 2, 0)
        uav.vehicle.commands.set_home()
        assert tuple(uav.pose.position) == (0, 0, 0)
        uav.fly(3.0)
        uav.end(uav.prepare.go_to_waypoint(at(1, 0, 3)).begin().future)
        local = uav.vehicle.backend.snapshot().motion.pose
        assert local is not None
        assert tuple(local.value.position) == pytest.approx((6, 2, 3), abs=0.03)


def test_a_goal_says_how_high_it_is_above_the_ground_where_home_has_another_height() -> None:
    with stepped(light={"start": [5.0, 2.0, -2.5]}) as uav:
        uav.vehicle.commands.set_home()
        assert tuple(uav.pose.position) == (0, 0, -2.5)
        uav.fly(3.0)
        task = uav.prepare.go_to_waypoint(at(1, 0, 3)).begin()
        assert task.description.endswith("(5.5 m above the ground of the take-off)")


def test_home_pose_positions_odom_in_map() -> None:
    settings = VehicleSettings(home_pose=(10.0, 20.0, 1.0), pose_frame_id="map")
    with stepped(settings) as uav:
        sample = uav.vehicle.telemetry()
        assert sample.frame_id == "map"
        assert sample.pose is not None
        assert tuple(sample.pose.position) == (10, 20, 1)
        assert sample.odometry is not None
        assert tuple(sample.odometry.pose.position) == (0, 0, 0)
        uav.fly(2.0)
        uav.end(uav.prepare.go_to_waypoint(at(12, 20, 3, None, "map")).begin().future)
        assert tuple(uav.pose.position) == pytest.approx((12, 20, 3), abs=0.03)


def test_map_origin_geo_positions_odom_in_map() -> None:
    settings = VehicleSettings(map_origin_geo=(37.4117, -6.0023, 8.0))
    with stepped(settings) as uav:
        home = uav.vehicle.transform("map", "uav_1/odom").translation
        assert home.x == pytest.approx(88.5, abs=0.2)
        assert home.y == pytest.approx(0.0, abs=0.01)
        assert home.z == pytest.approx(2.0)


def test_a_map_origin_beyond_the_distance_limit_is_reported_and_its_goals_are_refused(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """As where latitude and longitude were swapped."""
    with stepped(VehicleSettings(map_origin_geo=(-6.0023, 37.4117, 8.0))) as uav:
        uav.fly(2.0)
        (told,) = [record for record in caplog.records if vars(record).get("ual_event") == "home_pose"]
        assert told.levelno == logging.WARNING
        assert "are latitude and longitude swapped" in vars(told)["ual_fields"]["why"]
        with pytest.raises(GeofenceError, match="beyond its reach"):
            uav.prepare.go_to_waypoint(at(12, 20, 3, None, "map"))


def test_frames_of_the_configuration_are_there() -> None:
    camera = FrameSettings(frame_id="uav_1/camera", parent_frame_id="uav_1/base_link", translation=(0.1, 0.0, -0.05))
    with stepped(VehicleSettings(frames=(camera,))) as uav:
        uav.fly(2.0)
        there = uav.vehicle.transform("map", "uav_1/camera").translation
        assert tuple(there) == pytest.approx((0.1, 0.0, 1.95), abs=0.1)
        assert {frame.frame_id for frame in uav.vehicle.frames()} == {
            "map",
            "uav_1/odom",
            "uav_1/base_link",
            "uav_1/gimbal_0",
            "uav_1/camera",
        }


def test_telemetry_agrees_with_itself(flying: Stepped) -> None:
    flying.keep_samples()
    flying.end(flying.prepare.go_to_waypoint(at(2, 1, 3, 1.0)).begin().future)
    task = flying.prepare.go_to_waypoint(at(5, 1, 3)).begin()
    flying.run(1.0)
    sample = flying.vehicle.telemetry()
    assert sample.pose is not None
    assert sample.odometry is not None
    assert sample.transform is not None
    assert sample.velocity is not None
    assert sample.odometry.pose == sample.pose
    assert sample.transform.translation == sample.pose.position
    in_body = sample.odometry.twist.linear
    assert tuple(sample.pose.orientation.rotate(in_body)) == pytest.approx(tuple(sample.velocity.linear))
    assert sample.task is not None
    assert (sample.task.id, sample.task.kind) == (task.id, TaskKind.GO_TO_WAYPOINT)
    assert sample.task.distance_left_m == pytest.approx(3.0 - (sample.pose.position.x - 2.0), abs=0.1)
    sequences = [s.sequence for s in flying.samples]
    assert sequences == sorted(set(sequences))
    stamps = [s.stamp_s for s in flying.samples]
    assert stamps == sorted(stamps)


# --- The end ----------------------------------------------------------------------------------------------------------


def test_shutdown_cancels_a_go_to_and_leaves_the_autopilot_holding(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(1.0)
    done = flying.vehicle.prepare_shutdown()
    assert failure(task).metadata["by"] == "shutdown"
    flying.end(done, limit_s=2.0)
    assert flying.vehicle.telemetry().flight_mode == "HOLD"
    with pytest.raises(WrongStateError, match="shutting down"):
        flying.vehicle.commands.recover_from_manual().begin()


def test_a_command_that_was_prepared_before_the_shutdown_does_not_begin_after_it(flying: Stepped) -> None:
    begins: list[Callable[[], object]] = [
        flying.prepare.go_to_waypoint(at(9, 0, 3)).begin,
        lambda: flying.vehicle.commands.setpoints.set_pose(at(9, 0, 3)),
        flying.prepare.land().begin,
    ]
    flying.vehicle.prepare_shutdown()
    for begin in begins:
        with pytest.raises(WrongStateError, match="shutting down"):
            begin()
    flying.run(1.0)
    assert flying.vehicle.telemetry().flight_mode == "HOLD"
    assert flying.vehicle.telemetry().task is None


def test_a_hold_that_is_not_answered_is_not_repeated_once_the_safety_pilot_flies(
    flying: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer: Future[None] = Future()  # never comes
    monkeypatch.setattr(flying.vehicle.backend, "hold", lambda: answer)
    done = flying.vehicle.prepare_shutdown()
    flying.run(0.1)
    assert not done.done()
    flying.sim.pilot_take_over()
    flying.end(done, limit_s=1.0)
    assert answer.cancelled()


def test_the_hold_is_sent_once_even_if_an_update_comes_while_it_is_sent(
    flying: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[Future[None]] = []

    def hold() -> Future[None]:
        sent.append(Future())
        if len(sent) < 5:
            flying.run(STEP_S)  # as the thread of the updates may, on a busy computer
        return sent[-1]

    monkeypatch.setattr(flying.vehicle.backend, "hold", hold)
    flying.vehicle.prepare_shutdown()
    assert len(sent) == 1


def test_shutdown_of_a_stepped_simulation_needs_no_step(flying: Stepped) -> None:
    assert flying.vehicle.prepare_shutdown().done()
    assert flying.vehicle.telemetry().flight_mode == "HOLD"


@pytest.mark.parametrize("phase", ["take_off", "land"])
def test_shutdown_lets_take_off_and_landing_end(uav: Stepped, phase: str) -> None:
    uav.arm()
    task = uav.prepare.take_off(3.0).begin()
    if phase == "land":
        uav.end(task.future)
        task = uav.prepare.land().begin()
    uav.run(1.0)
    done = uav.vehicle.prepare_shutdown()
    assert not done.done()
    uav.end(task.future)
    uav.end(done, limit_s=10.0)


def test_close_ends_what_still_runs(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(0.5)
    flying.vehicle.close()
    assert isinstance(failure(task), TaskAbortedError)


def test_a_defect_in_a_manoeuvre_ends_it_and_the_uav_stops(flying: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    task = flying.prepare.go_to_waypoint(at(9, 0, 3)).begin()
    flying.run(1.5)
    with monkeypatch.context() as patch:
        patch.setattr("ual_daemon.flight.manoeuvres.follow.why_not_ours", lambda *_: 1 / 0)
        flying.run(STEP_S)
    assert failure(task).reason == "INTERNAL"
    flying.run(3.0)
    assert flying.speed < 0.01
    assert flying.is_in(State.FLYING_AUTO)


def test_a_defect_in_a_reference_stops_the_uav_and_updates_go_on(
    flying: Stepped, monkeypatch: pytest.MonkeyPatch
) -> None:
    flying.keep_samples()
    flying.vehicle.commands.setpoints.set_pose(at(9, 0, 3))
    flying.run(1.5)
    with monkeypatch.context() as patch:
        patch.setattr("ual_daemon.tracker.references.Hold.setpoint", lambda *_: 1 / 0)
        count = len(flying.samples)
        flying.run(STEP_S)
    assert len(flying.samples) > count
    flying.run(3.0)
    assert flying.speed < 0.01
    assert flying.pose.position.x < 8.0
    assert flying.is_in(State.FLYING_AUTO)


def test_only_one_thread_at_a_time_calls_a_reference(flying: Stepped, monkeypatch: pytest.MonkeyPatch) -> None:
    has_reference: list[bool] = []

    def setpoint(hold: Hold, snapshot: Snapshot) -> PositionSetpoint:
        has_reference.append(flying.vehicle._flight._current_reference() is hold)
        return PositionSetpoint(hold.motion(snapshot).position, 0.0)

    monkeypatch.setattr(Hold, "setpoint", setpoint)
    flying.vehicle.commands.setpoints.set_pose(at(1, 0, 3))
    assert has_reference == [False]  # by the caller, before the update thread has the reference
    flying.run(UPDATE_S)
    assert has_reference == [False, True]


def test_a_simulated_world_that_ends_with_the_daemon_has_no_home_of_before(tmp_path: Path) -> None:
    file = HomeFile(tmp_path / "uav_1.home")
    file.write("PX4 1 ab", GeoPoint(47.0, 8.0, 400.0), None, 1)  # a real UAV had the same namespace
    backend = LightBackend(BackendOptions("uav_1", settings={"speed_factor": 0}))
    vehicle = Vehicle(backend, home_file=HomeFile(tmp_path / "uav_1.home"))
    vehicle.open()
    try:
        vehicle.simulation().step(0.1)
        assert vehicle.telemetry().frame_lost == ""
        assert vehicle.telemetry().pose is not None
    finally:
        vehicle.close()


def test_a_jump_of_the_estimate_ends_a_go_to_and_the_uav_holds_where_it_is(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(20, 0, 3)).begin()
    flying.run(3.0)
    flying.sim.begin_fault(EstimatorJumps(Vector3(0.0, 5.0, 0.0), 1000.0))
    with pytest.raises(TaskAbortedError, match=r"jumped by 5\.0 m") as caught:
        flying.end(task.future)
    assert caught.value.metadata["by"] == "estimator"
    flying.run(5.0)
    assert flying.state is State.FLYING_AUTO
    assert flying.pose.position.y == pytest.approx(5.0, abs=0.1)  # it has not flown back to y = 0
    assert flying.speed < 0.05


def test_a_velocity_goes_on_when_the_estimate_jumps(flying: Stepped) -> None:
    flying.sim.begin_fault(EstimatorJumps(Vector3(0.0, 5.0, 0.0), 1000.0))
    for _ in range(20):
        flying.vehicle.commands.setpoints.set_velocity(TwistStamped(Twist(Vector3(1.0, 0.0, 0.0))))
        flying.run(0.1)
    assert flying.pose.position.x > 1.0


def test_a_pose_that_was_set_is_left_when_the_estimate_jumps(flying: Stepped) -> None:
    flying.vehicle.commands.setpoints.set_pose(at(0.0, 0.0, 3.0))
    flying.run(2.0)
    flying.sim.begin_fault(EstimatorJumps(Vector3(0.0, 5.0, 0.0), 1000.0))
    flying.run(5.0)
    assert flying.pose.position.y == pytest.approx(5.0, abs=0.1)


def test_a_landing_goes_on_when_the_estimate_jumps(flying: Stepped) -> None:
    task = flying.prepare.land().begin()
    flying.run(1.0)
    flying.sim.begin_fault(EstimatorJumps(Vector3(3.0, 0.0, 2.0), 1000.0))
    flying.end(task.future)
    assert flying.state in (State.LANDED_ARMED, State.LANDED_DISARMED)
