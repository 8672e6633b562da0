"""Pausing a task and going on with it. In stepped time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.ual_daemon.stepped import STEP_S, Stepped, at, stepped
from tests.ual_daemon.tracker.test_tracker import assert_sent_within, wiretap
from tests.ual_daemon.trajectory.trajectories import distance_from_path
from ual.errors import TaskAbortedError, WrongStateError
from ual.geometry import IDENTITY, Transform, Twist, TwistStamped, Vector3
from ual.types import AltitudeReference, State, TaskStatus
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import Tracker, VehicleSettings

PAUSE_S = 100.0
"""Far longer than the time limit of any of these tasks."""


def go_to(uav: Stepped) -> VehicleTask:
    return uav.prepare.go_to_waypoint(at(12, 0, 3, 1.5)).begin()


def go_to_geo(uav: Stepped) -> VehicleTask:
    projection = uav.vehicle.backend.snapshot().earth.projection
    assert projection is not None
    place = projection.to_geo(Vector3(12, 0, 3))
    assert place.altitude_amsl_m is not None
    where = (place.latitude_deg, place.longitude_deg, place.altitude_amsl_m, AltitudeReference.AMSL)
    return uav.prepare.go_to_waypoint_geo(*where).begin()


def follow(uav: Stepped) -> VehicleTask:
    return uav.prepare.follow_path([at(6, 0, 3), at(6, 6, 3), at(0, 6, 3)], corner_radius_m=1.0).begin()


def return_home(uav: Stepped) -> VehicleTask:
    uav.end(uav.prepare.go_to_waypoint(at(8, 0, 3)).begin().future)
    return uav.prepare.return_to_launch(3.0).begin()


TASKS = (go_to, go_to_geo, follow, return_home)


@pytest.mark.parametrize("begin", TASKS)
def test_a_paused_task_holds_and_goes_on(flying: Stepped, begin: Callable[[Stepped], VehicleTask]) -> None:
    task = begin(flying)
    flying.run(2.5)
    assert flying.speed > 0.5
    flying.vehicle.commands.pause()
    assert task.info().is_paused
    flying.run(5.0)
    held, progress = flying.pose.position, task.info().progress
    flying.run(PAUSE_S)
    assert flying.speed < 0.01
    assert (flying.pose.position - held).norm() < 0.02
    info = task.info()
    assert (info.status, info.is_paused) == (TaskStatus.RUNNING, True)
    assert info.progress == pytest.approx(progress, abs=0.01)
    sample = flying.vehicle.telemetry()
    assert sample.task is not None
    assert sample.task.is_paused
    flying.vehicle.commands.resume()
    assert not task.info().is_paused
    flying.end(task.future)
    assert task.info().status is TaskStatus.SUCCEEDED


@pytest.mark.parametrize("paused_after_s", [0.0, 0.3, 1.0, 3.4, 4.1, 5.0, 7.0, 9.9, 11.0])
def test_a_pause_sends_nothing_off_the_path_or_beyond_the_limits(flying: Stepped, paused_after_s: float) -> None:
    limits = flying.vehicle.info().limits
    with wiretap(flying) as sent:
        task = follow(flying)
        flying.run(STEP_S)
        flying.end(task.future)
        whole = [setpoint.position for _, setpoint in sent]
    flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3)).begin().future)
    flying.run(2.0)
    with wiretap(flying) as sent:
        task = follow(flying)
        flying.run(STEP_S + paused_after_s)
        flying.vehicle.commands.pause(task.id)
        flying.run(7.0)
        assert flying.speed < 0.02
        flying.vehicle.commands.resume(task.id)
        flying.end(task.future)
    assert_sent_within(sent, limits)
    assert max(distance_from_path(setpoint.position, whole) for _, setpoint in sent[::5]) < 0.03


def test_a_pause_near_the_end_does_not_end_the_task(flying: Stepped) -> None:
    task = flying.prepare.go_to_waypoint(at(3, 0, 3)).begin()
    flying.until(lambda: (flying.pose.position - Vector3(3, 0, 3)).norm() < 0.05)
    flying.vehicle.commands.pause()
    flying.run(20.0)
    assert not task.future.done()
    flying.vehicle.commands.resume()
    flying.end(task.future, 10.0)


@pytest.mark.parametrize("light", [{"takes": "positions"}, {"takes": "velocities"}, {}], ids=str)
def test_a_pause_holds_and_goes_on_by_pure_pursuit(light: dict[str, str]) -> None:
    settings = VehicleSettings() if light else VehicleSettings(tracker=Tracker.PURSUIT)
    with stepped(settings, light=light) as uav:
        uav.fly()
        task = uav.prepare.follow_path([at(6, 0, 3), at(6, 6, 3)]).begin()
        uav.run(2.5)
        uav.vehicle.commands.pause()
        uav.run(8.0)
        held = uav.pose.position
        uav.run(PAUSE_S)
        assert (uav.pose.position - held).norm() < 0.05
        assert abs(held.y) < 0.05
        assert 1.0 < held.x < 5.0
        uav.vehicle.commands.resume()
        uav.end(task.future)
        assert (uav.pose.position - Vector3(6, 6, 3)).norm() <= settings.tolerance.position_m


def test_what_cannot_be_paused_is_refused_with_words(uav: Stepped) -> None:
    commands = uav.vehicle.commands
    with pytest.raises(WrongStateError, match="pause: no task runs"):
        commands.pause()
    uav.arm()
    task = uav.prepare.take_off(3.0).begin()
    uav.run(1.0)
    with pytest.raises(WrongStateError, match=r"take_off cannot be paused: it goes on to its end"):
        commands.pause()
    uav.end(task.future)
    with pytest.raises(WrongStateError, match="resume: no task runs"):
        commands.resume()
    old = uav.prepare.go_to_waypoint(at(5, 0, 3)).begin()
    with pytest.raises(WrongStateError, match="resume: go_to_waypoint is not paused"):
        commands.resume()
    new = uav.prepare.go_to_waypoint(at(0, 5, 3)).begin()
    with pytest.raises(WrongStateError, match=f"{old.id} does not run any more"):
        commands.pause(old.id)
    commands.pause(new.id)
    commands.pause(new.id)  # again
    landing = uav.prepare.land().begin()
    uav.run(0.5)
    with pytest.raises(WrongStateError, match="land cannot be paused"):
        commands.pause()
    uav.end(landing.future)


def test_a_go_to_to_a_moving_goal_cannot_be_paused(flying: Stepped) -> None:
    car = "car"
    for step in range(10):
        flying.vehicle.frame_editor.add(Transform(Vector3(step * 0.1, 0.0, 0.0), child_frame_id=car))
        flying.run(0.1)
    task = flying.prepare.go_to_waypoint(at(5, 5, 3, frame_id=car)).begin()
    with pytest.raises(WrongStateError, match="its goal moves"):
        flying.vehicle.commands.pause()
    assert not task.info().is_paused


def test_a_goal_whose_frame_is_put_elsewhere_in_a_pause_is_approached_there(flying: Stepped) -> None:
    """It was flown to where its frame had been before, and that was told as a success."""

    def put(x: float, y: float) -> None:
        flying.vehicle.frame_editor.add(Transform(Vector3(x, y, 0.0), IDENTITY, "uav_1/odom", "boat"))

    put(10.0, 0.0)
    task = flying.prepare.go_to_waypoint(at(0, 0, 3, frame_id="boat")).begin()
    flying.run(1.0)
    flying.vehicle.commands.pause()
    flying.run(3.0)
    held = flying.pose.position
    put(0.0, 12.0)
    flying.run(5.0)
    assert (flying.pose.position - held).norm() < 0.1
    flying.vehicle.commands.resume()
    flying.end(task.future)
    assert (flying.pose.position - Vector3(0.0, 12.0, 3.0)).norm() < 0.3


def test_another_command_ends_a_paused_task_as_ever(flying: Stepped) -> None:
    for end in (
        flying.vehicle.commands.abort,
        lambda: flying.vehicle.commands.setpoints.set_velocity(TwistStamped(Twist(Vector3(0.0, 0.1, 0.0)))),
        lambda: flying.prepare.go_to_waypoint(at(0, 0, 3)).begin(),
    ):
        task = go_to(flying)
        flying.run(2.5)
        flying.vehicle.commands.pause()
        flying.run(1.0)  # it still brakes
        end()
        with pytest.raises(TaskAbortedError):
            flying.end(task.future)
        assert not task.info().is_paused
        flying.run(3.0)
        with pytest.raises(WrongStateError, match="resume"):
            flying.vehicle.commands.resume()
        flying.end(flying.prepare.go_to_waypoint(at(0, 0, 3)).begin().future)


def test_the_pilot_ends_a_paused_task(flying: Stepped) -> None:
    task = go_to(flying)
    flying.run(2.5)
    flying.vehicle.commands.pause()
    flying.sim.pilot_take_over()
    with pytest.raises(TaskAbortedError, match="safety pilot took over"):
        flying.end(task.future)
    with pytest.raises(WrongStateError):
        flying.vehicle.commands.resume()
    assert flying.state is State.FLYING_MANUAL


def test_a_path_that_is_planned_while_a_pause_comes_does_not_begin(flying: Stepped) -> None:
    go_to(flying)
    flying.run(1.0)
    prepared = flying.prepare.follow_path([at(5, 5, 3)])
    flying.vehicle.commands.pause()
    with pytest.raises(TaskAbortedError, match="replaced by pause"):
        prepared.begin()
