"""Checks of tasks: handles, replacing, cancelling, deadlines."""

from __future__ import annotations

from ual.conformance.check import check
from ual.conformance.flight import Flight, position, require
from ual.errors import TaskAbortedError, UalTimeoutError
from ual.geometry import Twist
from ual.interface import Task
from ual.types import Capability, State, TaskStatus

_GOAL_AHEAD_M = 4.0
_FAR_GOAL_M = 8.0  # a UAV at full speed needs 3 m to stop, and must still be far from its goal then
_POSITION = (Capability.POSITION,)
_FLYING = State.FLYING_AUTO


@check(_FLYING, capabilities=_POSITION, moves="4 m ahead")
def a_handle_reports_its_task(flight: Flight) -> None:
    """The handle of a task can be watched, found by the task's id, and waited for."""
    uav = flight.uav
    goal = flight.goal(_GOAL_AHEAD_M, 0.0)
    task = uav.go_to_waypoint(goal, blocking=False)
    require(task.id == uav.task(task.id).id, "task() returns another task")
    flight.wait(lambda sample: sample.task is not None and sample.task.id == task.id, "the task in the telemetry")
    require(next(iter(task.watch(rate_hz=0.0))).id == task.id, "a watch without a rate of its own reports another task")
    reports = list(task.watch(rate_hz=20.0))
    require(reports[-1].status is TaskStatus.SUCCEEDED, f"the last status is {reports[-1].status.name}")
    progress = [info.progress for info in reports if info.progress is not None]
    require(progress == sorted(progress), f"the progress goes back: {progress}")
    require(task.done() and task.wait().status is TaskStatus.SUCCEEDED, "it has not ended")
    require(task.wait().id == task.id, "a second wait returns another task")
    task.cancel()
    require(task.info().status is TaskStatus.SUCCEEDED, "an ended task was cancelled")
    flight.require_at(goal, "at the waypoint")


@check(_FLYING, capabilities=_POSITION, moves="4 m ahead, and back")
def a_new_command_replaces_a_task(flight: Flight) -> None:
    """The replaced task ends as ABORTED and says what replaced it; the new one goes on."""
    first = flight.uav.go_to_waypoint(flight.goal(_GOAL_AHEAD_M, 0.0), blocking=False)
    _wait_until_moving(flight)
    second = flight.uav.go_to_waypoint(flight.start, blocking=False)
    error = flight.refuses(TaskAbortedError, first.wait, "waiting for the replaced task")
    require(error.metadata.get("by") == "go_to_waypoint", f"metadata by is {error.metadata.get('by')}")
    require(first.info().status is TaskStatus.ABORTED, f"the replaced task is {first.info().status.name}")
    require(second.wait().status is TaskStatus.SUCCEEDED, "the new task did not succeed")
    flight.require_at(flight.start, "back at the start")


@check(_FLYING, capabilities=(Capability.POSITION, Capability.VELOCITY), moves="2 m ahead")
def a_velocity_replaces_a_task(flight: Flight) -> None:
    """A velocity ends the running task as ABORTED."""
    task = flight.uav.go_to_waypoint(flight.goal(_GOAL_AHEAD_M, 0.0), blocking=False)
    _wait_until_moving(flight)
    flight.uav.set_velocity(Twist())
    error = flight.refuses(TaskAbortedError, task.wait, "waiting for the replaced task")
    require(error.metadata.get("by") == "set_velocity", f"metadata by is {error.metadata.get('by')}")
    flight.wait(flight.is_slow, "rest")


@check(_FLYING, capabilities=_POSITION, moves="3 m ahead (8 m, should it not stop)")
def a_cancelled_task_holds(flight: Flight) -> None:
    """A cancelled task ends as ABORTED, and the UAV stops and holds."""
    task = flight.uav.go_to_waypoint(flight.goal(_FAR_GOAL_M, 0.0), blocking=False)
    _wait_until_moving(flight)
    task.cancel()
    _require_stopped(flight, task)


@check(_FLYING, capabilities=_POSITION, moves="3 m ahead (8 m, should it not stop)")
def an_abort_stops(flight: Flight) -> None:
    """An abort ends the task, and the UAV brakes and holds where it stops."""
    task = flight.uav.go_to_waypoint(flight.goal(_FAR_GOAL_M, 0.0), blocking=False)
    _wait_until_moving(flight)
    flight.uav.abort()
    _require_stopped(flight, task)


@check(_FLYING, capabilities=_POSITION, moves="3 m ahead (8 m, should it not stop)")
def a_freeze_holds_the_position_it_had(flight: Flight) -> None:
    """An abort that freezes comes back to the position that it had."""
    task = flight.uav.go_to_waypoint(flight.goal(_FAR_GOAL_M, 0.0), blocking=False)
    _wait_until_moving(flight)
    flight.uav.abort(freeze=True)
    here = flight.position()
    _require_stopped(flight, task)
    off_m = (flight.position() - here).norm()
    require(off_m <= 2 * flight.tolerances.position_m, f"it holds {off_m:.2f} m from where it was")


@check(_FLYING, capabilities=_POSITION, moves="4 m ahead at most")
def a_deadline_cancels_what_was_waited_for(flight: Flight) -> None:
    """After the caller's timeout, the go-to is cancelled and the UAV holds its position."""
    try:
        flight.uav.go_to_waypoint(flight.goal(_GOAL_AHEAD_M, 0.0), timeout_s=0.01)
    except UalTimeoutError:
        flight.wait(lambda sample: sample.task is None and flight.is_slow(sample), "rest")
        flight.require_stays("after the deadline")


def _wait_until_moving(flight: Flight) -> None:
    start = flight.start.position
    flight.wait(lambda sample: (position(sample) - start).norm() >= 0.3, "motion")


def _require_stopped(flight: Flight, task: Task) -> None:
    flight.refuses(TaskAbortedError, task.wait, "waiting for the ended task")
    require(task.info().status is TaskStatus.ABORTED, f"the task is {task.info().status.name}")
    flight.wait(flight.is_slow, "rest", 10.0)
    require(flight.uav.is_idle(), "a task still runs")
    flight.require_stays("after the end of the task")
    left_m = (flight.position() - flight.goal(_FAR_GOAL_M, 0.0).position).norm()
    require(left_m > flight.tolerances.position_m, "it flew on to the goal")


CHECKS = (
    a_handle_reports_its_task,
    a_new_command_replaces_a_task,
    a_velocity_replaces_a_task,
    a_cancelled_task_holds,
    an_abort_stops,
    a_freeze_holds_the_position_it_had,
    a_deadline_cancels_what_was_waited_for,
)
