from __future__ import annotations

import gc
import weakref

import pytest

from ual.errors import InvalidArgumentError, RejectedByAutopilotError, TaskAbortedError, UalError, UalTimeoutError
from ual.types import TaskKind, TaskStatus
from ual_daemon.flight.tasks import Progress, Tasks, VehicleTask


class HandClock:
    """A clock whose time a test sets."""

    time_s = 100.0

    def now_s(self) -> float:
        return self.time_s


@pytest.fixture
def clock() -> HandClock:
    return HandClock()


@pytest.fixture
def task(clock: HandClock) -> VehicleTask:
    return VehicleTask(TaskKind.GO_TO_WAYPOINT, "go to 1, 2, 3", clock)


def test_a_new_task_runs_and_nothing_is_known_of_its_progress(task: VehicleTask) -> None:
    info = task.info()
    assert info.id.startswith("go_to_waypoint-")
    assert (info.kind, info.status) == (TaskKind.GO_TO_WAYPOINT, TaskStatus.RUNNING)
    assert (info.progress, info.distance_left_m, info.waypoint_index, info.error) == (None, None, None, None)
    assert info.elapsed_s == 0.0
    assert info.description == "go to 1, 2, 3"


def test_each_task_has_an_id_of_its_own(clock: HandClock) -> None:
    ids = {VehicleTask(TaskKind.LAND, "", clock).id for _ in range(100)}
    assert len(ids) == 100


def test_the_elapsed_time_grows_until_the_task_ends(task: VehicleTask, clock: HandClock) -> None:
    clock.time_s = 103.0
    assert task.info().elapsed_s == pytest.approx(3.0)
    task.end(None)
    clock.time_s = 110.0
    assert task.info().elapsed_s == pytest.approx(3.0)


def test_progress_is_what_was_reported_last_but_never_goes_back(task: VehicleTask) -> None:
    task.report(lambda: Progress(0.5, 4.0, 1))
    assert task.info().progress == 0.5
    task.report(lambda: Progress(0.4, 4.1, 1))
    info = task.info()
    assert (info.progress, info.distance_left_m, info.waypoint_index) == (0.5, 4.1, 1)


class Trajectory:
    """Object that a progress function holds."""

    def progress(self) -> Progress:
        return Progress(0.5, 4.0, 1)


def test_a_task_that_has_ended_says_how_far_it_came_and_keeps_no_trajectory(task: VehicleTask) -> None:
    trajectory = Trajectory()
    held = weakref.ref(trajectory)
    task.report(trajectory.progress)
    task.end(TaskAbortedError("replaced by land"))
    task.report(trajectory.progress)  # a step of the update thread that was under way
    del trajectory
    gc.collect()
    assert held() is None
    info = task.info()
    assert (info.progress, info.distance_left_m, info.waypoint_index) == (0.5, 4.0, 1)


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (None, TaskStatus.SUCCEEDED),
        (TaskAbortedError("cancelled"), TaskStatus.ABORTED),
        (UalTimeoutError("too long"), TaskStatus.FAILED),
        (RejectedByAutopilotError("no"), TaskStatus.FAILED),
    ],
)
def test_the_end_of_a_task_shows_in_its_status_and_its_future(
    task: VehicleTask, error: UalError | None, status: TaskStatus
) -> None:
    task.report(lambda: Progress(0.5))
    task.end(error)
    info = task.info()
    assert (info.status, info.error) == (status, error)
    assert info.progress == (1.0 if error is None else 0.5)
    assert task.future.exception(timeout=0) is error


def test_a_waiting_caller_cannot_cancel_the_future_of_a_task(task: VehicleTask) -> None:
    assert not task.future.cancel()
    assert not task.future.done()


def test_tasks_are_found_by_their_ids_and_the_oldest_are_forgotten(clock: HandClock) -> None:
    tasks = Tasks(clock)
    made = [tasks.new(TaskKind.LAND, "") for _ in range(201)]
    assert [tasks.get(each.id) for each in made[1:]] == made[1:]
    for unknown in (made[0].id, "land-none", ""):
        with pytest.raises(InvalidArgumentError) as refused:
            tasks.get(unknown)
        assert refused.value.metadata["field"] == "task_id"


def test_a_callback_of_its_future_sees_it_ended(task: VehicleTask) -> None:
    seen: list[TaskStatus] = []
    task.future.add_done_callback(lambda _: seen.append(task.info().status))
    task.end(None)
    assert seen == [TaskStatus.SUCCEEDED]


def test_a_task_that_ended_is_reported_as_it_was_whatever_comes_after(clock: HandClock) -> None:
    tasks = Tasks(clock)
    ended, running = tasks.new(TaskKind.LAND, "land"), tasks.new(TaskKind.FOLLOW_PATH, "a path")
    ended.report(lambda: Progress(0.5, 2.0))
    ended.end(TaskAbortedError("land: taken", {"by": "safety pilot"}))
    before = ended.info()
    clock.time_s += 10.0
    tasks.new(TaskKind.LAND, "another")
    remembered = tasks.get(ended.id)
    assert remembered.info() == before
    assert remembered.future.exception() is before.error
    assert tasks.get(running.id) is running


def test_the_error_of_a_task_that_ended_keeps_nothing_of_those_that_waited_for_it(clock: HandClock) -> None:
    class Request:
        pass

    def wait(task: VehicleTask) -> weakref.ref[Request]:
        request = Request()
        try:
            task.future.result()
        except TaskAbortedError:
            return weakref.ref(request)
        raise AssertionError

    tasks = Tasks(clock)
    task = tasks.new(TaskKind.FOLLOW_PATH, "")
    task.end(TaskAbortedError("follow_path: cancelled"))
    request = wait(task)
    gc.collect()
    assert request() is not None  # the error's traceback has the frame in which it was raised
    tasks.new(TaskKind.LAND, "")
    gc.collect()
    assert request() is None


def test_those_that_ended_are_counted_by_kind_and_outcome(clock: HandClock) -> None:
    tasks = Tasks(clock)
    for kind, error in (
        (TaskKind.LAND, None),
        (TaskKind.LAND, None),
        (TaskKind.LAND, TaskAbortedError("the pilot took over")),
        (TaskKind.TAKE_OFF, RejectedByAutopilotError("not now")),
    ):
        tasks.new(kind, "").end(error)
    tasks.new(TaskKind.LAND, "")
    assert tasks.ended() == {
        (TaskKind.LAND, TaskStatus.SUCCEEDED): 2,
        (TaskKind.LAND, TaskStatus.ABORTED): 1,
        (TaskKind.TAKE_OFF, TaskStatus.FAILED): 1,
    }
