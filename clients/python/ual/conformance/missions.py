"""Checks of what a mission is made of: pausing, holding at waypoints, returning home."""

from __future__ import annotations

from ual.conformance.check import LANDED, check
from ual.conformance.flight import HEIGHT_M, CannotRunError, Flight, position, require
from ual.errors import TaskAbortedError, WrongStateError
from ual.geometry import Vector3
from ual.interface import Task
from ual.types import Capability, State, TaskKind, TaskStatus, Telemetry

_POSITION = (Capability.POSITION,)
_FLYING = State.FLYING_AUTO
_GOAL_AHEAD_M = 4.0
_GOAL_ASIDE_M = 3.0
_FARTHEST_HOME_M = 30.0
_REST_DELAY_S = 2.0
_HOLD_S = 3.0


@check(_FLYING, capabilities=_POSITION, moves="4 m ahead, with a pause")
def a_paused_task_holds_and_goes_on(flight: Flight) -> None:
    """A pause stops the UAV on its way, and the task still runs; after a resume it flies the rest."""
    uav, goal, start = flight.uav, flight.goal(_GOAL_AHEAD_M, 0.0), flight.position()
    with flight.recording() as recorded:
        task = uav.go_to_waypoint(goal, blocking=False)
        _wait_until_moving(flight)
        uav.pause()
        uav.pause()  # again
        _require_paused(flight, task)
        _require_route(flight, task, start, goal.position)
        task.resume()
        require(not task.info().is_paused, "it is still paused")
        require(task.wait().status is TaskStatus.SUCCEEDED, "it did not go on")
        flight.require_straight(recorded(), start, goal.position)
    flight.require_at(goal, "at the waypoint")


def _require_route(flight: Flight, task: Task, start: Vector3, goal: Vector3) -> None:
    """Requires that the way of a go-to is reported: the straight line from where it began to its goal, in `map`."""
    route = flight.uav.route()
    require(route is not None, "the way of the running task is not told")
    assert route is not None
    require(route.task_id == task.id and not route.is_goal_moving, "the way is not that of the task")
    to_map = flight.uav.transform("map", f"{flight.uav.ns}/odom")
    require(route.frame_id == "map" and len(route.points) == 2, "the way is not a line in map")
    begins, ends = route.points
    require((ends - to_map.apply(goal)).norm() <= flight.tolerances.position_m, "the way leads elsewhere")
    require((begins - to_map.apply(start)).norm() <= 2 * flight.tolerances.position_m, "the way begins elsewhere")


@check(_FLYING, capabilities=_POSITION, moves="4 m ahead at most")
def a_paused_task_can_be_ended(flight: Flight) -> None:
    """An abort ends a paused task; afterwards there is nothing to pause or to resume."""
    uav = flight.uav
    flight.refuses(WrongStateError, uav.pause, "a pause without a task")
    task = uav.go_to_waypoint(flight.goal(_GOAL_AHEAD_M, 0.0), blocking=False)
    flight.refuses(WrongStateError, task.resume, "resuming a task that is not paused")
    _wait_until_moving(flight)
    task.pause()
    uav.abort()
    flight.refuses(TaskAbortedError, task.wait, "waiting for the aborted task")
    require(not task.info().is_paused, "an ended task is paused")
    flight.refuses(WrongStateError, task.pause, "pausing an ended task")
    flight.refuses(WrongStateError, uav.resume, "a resume without a task")
    flight.wait(flight.is_slow, "rest")


@check(_FLYING, capabilities=_POSITION, moves="2 m ahead, and back")
def holds_at_a_waypoint(flight: Flight) -> None:
    """A path holds at a waypoint for as long as it says; the plan includes that."""
    uav, goal, back = flight.uav, flight.goal(2.0, 0.0), flight.start
    without, plan = uav.dry_run.follow_path([goal, back]), uav.dry_run.follow_path([goal, back], holds_s=[_HOLD_S, 0.0])
    assert plan.duration_s is not None
    assert without.duration_s is not None
    longer_s = plan.duration_s - without.duration_s
    require(abs(longer_s - _HOLD_S) <= 0.5, f"the plan takes {longer_s:.1f} s longer with a hold of {_HOLD_S:g} s")
    with flight.recording() as recorded:
        uav.follow_path([goal, back], holds_s=[_HOLD_S, 0.0])
        samples = recorded()
    radius_m = flight.tolerances.position_m
    near = [sample.stamp_s for sample in samples if (position(sample) - goal.position).norm() <= radius_m]
    require(bool(near), "it did not reach the waypoint")
    stayed_s = near[-1] - near[0]
    require(stayed_s >= _HOLD_S - 0.5, f"it was at the waypoint for {stayed_s:.1f} s only")
    flight.require_at(back, "at the end of the path")


@check(
    _FLYING,
    capabilities=(Capability.POSITION, Capability.LAND),
    moves="3 m aside, with a pause on the way home, and down",
)
def returns_home_and_lands(flight: Flight) -> None:
    """A return flies over home and lands there, as one task, which can be paused until it lands."""
    uav = flight.uav
    uav.go_to_waypoint(flight.goal(0.0, _GOAL_ASIDE_M))
    plan = uav.dry_run.return_to_launch(HEIGHT_M)
    path_m = plan.length_m or 0.0
    if path_m > _FARTHEST_HOME_M:
        raise CannotRunError(f"home is far from where it flies: the way there is {path_m:.1f} m")
    begun = flight.position()
    task = uav.return_to_launch(HEIGHT_M, blocking=False)
    require(task.kind is TaskKind.RETURN_TO_LAUNCH, f"the task is {task.kind.name}")
    flight.wait(lambda sample: (position(sample) - begun).norm() >= 0.3, "motion")
    uav.pause()
    _require_paused(flight, task)
    uav.resume()
    flight.wait_for_state(State.LANDING, *LANDED, limit_s=60.0)
    if uav.state() is State.LANDING:
        flight.refuses(WrongStateError, uav.pause, "a pause of a landing")
    require(task.wait().status is TaskStatus.SUCCEEDED, "it did not succeed")
    require(uav.state() in LANDED, f"it is {uav.state().name}, not on the ground")
    allowed_m = 1.0 + 2 * flight.tolerances.position_m
    moved_m = (flight.position() - begun).horizontal_norm()
    require(moved_m <= path_m + allowed_m, f"it landed {moved_m:.2f} m from where it was, the way was {path_m:.2f} m")
    # Else home is the position where it took off before these checks.
    if abs(path_m - _GOAL_ASIDE_M) <= 1.0 + 2 * flight.tolerances.drift_m:
        off_m = (flight.position() - flight.ground).horizontal_norm()
        require(off_m <= allowed_m, f"it landed {off_m:.2f} m from where it took off")


def _wait_until_moving(flight: Flight) -> None:
    start = flight.start.position
    flight.wait(lambda sample: (position(sample) - start).norm() >= 0.3, "motion")


def _require_paused(flight: Flight, task: Task) -> None:
    flight.wait(_is_paused, "the pause in the telemetry")
    # One that has just begun to move is slow, too, and follows the reference to its stop.
    flight.let_pass(_REST_DELAY_S)
    flight.wait(flight.is_slow, "rest")
    flight.require_stays("while it is paused")
    info = task.info()
    require(info.status is TaskStatus.RUNNING and info.is_paused, f"the task is {info.status.name}, not paused")


def _is_paused(sample: Telemetry) -> bool:
    return sample.task is not None and sample.task.is_paused


CHECKS = (
    a_paused_task_holds_and_goes_on,
    a_paused_task_can_be_ended,
    holds_at_a_waypoint,
    returns_home_and_lands,
)
