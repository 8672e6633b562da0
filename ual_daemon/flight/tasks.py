"""Tasks: what is known of each, and the list of those that run or ended lately."""

from __future__ import annotations

import os
import threading
from collections import Counter, OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import NamedTuple

from ual.errors import InvalidArgumentError, TaskAbortedError, UalError
from ual.types import TaskInfo, TaskKind, TaskStatus
from ual_daemon import traces
from ual_daemon.backends.base import Clock
from ual_daemon.flight.futures import end_future, running_future


class Progress(NamedTuple):
    """Progress of a task: a share of 1, the metres left, and the number of the waypoint it is flying to."""

    progress: float | None = None
    distance_left_m: float | None = None
    waypoint_index: int | None = None


_NO_PROGRESS: Callable[[], Progress] = Progress
_MOST_REMEMBERED_TASKS = 200


class VehicleTask:
    """A manoeuvre that takes time. `future` ends with None, or with the `UalError` that ended it.

    Any thread may call any member. See `ual_daemon.vehicle.commands.Commands.cancel` for what cancels it.
    """

    def __init__(self, kind: TaskKind, description: str, clock: Clock) -> None:
        self.id = f"{kind.name.lower()}-{os.urandom(4).hex()}"
        self.kind = kind
        self.description = description
        self.note = ""
        """Note for users while it runs, in addition to its description: that it is stuck, and the remedy."""
        self.future = running_future()
        self.is_paused = False
        """Whether the UAV holds on the way; see `ual_daemon.flight.flight.Flight.pause`."""
        self._clock = clock
        self._started_s = clock.now_s()
        self._ended_s: float | None = None
        self._progress = _NO_PROGRESS
        self._reported_progress: float | None = None
        self._final: TaskInfo | None = None

    @classmethod
    def ended(cls, info: TaskInfo, clock: Clock) -> VehicleTask:
        """Returns a task that has ended, as it was then."""
        task = cls(info.kind, info.description, clock)
        task.id, task._final = info.id, info
        end_future(task.future, info.error)
        return task

    def info(self) -> TaskInfo:
        """Returns its state now."""
        if self._final is not None:
            return self._final
        progress, distance_left_m, waypoint_index = self._progress()
        if progress is not None:  # the progress must not fall with a noisy estimate
            progress = self._reported_progress = max(progress, self._reported_progress or 0.0)
        status, error = _outcome(self.future)
        ended_s = self._clock.now_s() if self._ended_s is None else self._ended_s
        return TaskInfo(
            self.id,
            self.kind,
            status,
            1.0 if status is TaskStatus.SUCCEEDED else progress,
            distance_left_m,
            max(0.0, ended_s - self._started_s),
            waypoint_index,
            error,
            f"{self.description}: {self.note}" if self.note else self.description,
            self.is_paused and status is TaskStatus.RUNNING,
        )

    def report(self, progress: Callable[[], Progress]) -> None:
        """Sets its progress, as a pure function that `info` calls. Called by the update thread."""
        self._progress = progress
        if self._ended_s is not None:  # another thread has ended it during this update
            self._keep_progress()

    def end(self, error: UalError | None) -> None:
        """Ends it. Runs the callbacks of its future, so hold no lock."""
        self._ended_s = self._clock.now_s()
        self._keep_progress()
        end_future(self.future, error)

    def _keep_progress(self) -> None:
        """Keeps how far it has come, and not the function: that holds the trajectory, up to 10,000 waypoints."""
        last = self._progress()
        self._progress = lambda: last


class Tasks:
    """The tasks of one UAV: those that run, and the last ones that ended. Any thread may call.

    Of those that ended only their reports are kept: 0.9 kB each, a third of the task.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._tasks: OrderedDict[str, VehicleTask | TaskInfo] = OrderedDict()
        self._ended: Counter[tuple[TaskKind, TaskStatus]] = Counter()

    def new(self, kind: TaskKind, description: str, task_id: str = "") -> VehicleTask:
        """Makes a task, and forgets the oldest one if there are too many. `task_id` is that of one found again."""
        task = VehicleTask(kind, description, self._clock)
        task.id = task_id or task.id
        with self._lock:
            for each in self._tasks.values():
                if isinstance(each, VehicleTask) and each.future.done():
                    self._tasks[each.id] = _remembered(each)
            self._tasks[task.id] = task
            if len(self._tasks) > _MOST_REMEMBERED_TASKS:
                self._tasks.popitem(last=False)
        about = {"ual.task_id": task.id, "ual.task": description}
        end_trace = traces.begin(f"task: {kind.name.lower()}", traces.current(), about)
        if end_trace is not None:
            task.future.add_done_callback(end_trace)
        task.future.add_done_callback(partial(self._on_end, kind))  # not the task: it would hold itself in memory
        return task

    def _on_end(self, kind: TaskKind, future: Future[None]) -> None:
        status, _ = _outcome(future)
        with self._lock:
            self._ended[kind, status] += 1

    def ended(self) -> Counter[tuple[TaskKind, TaskStatus]]:
        """Returns how many have ended since the start, by their kind and how they ended."""
        with self._lock:
            return self._ended.copy()

    def get(self, task_id: str) -> VehicleTask:
        """Returns a task by its identifier.

        Raises:
            InvalidArgumentError: There is no such task.

        """
        found = self._tasks.get(task_id)
        if found is None:
            why = "; its daemon may have been restarted since, or it ended long ago" if isinstance(task_id, str) else ""
            raise InvalidArgumentError(f"task_id: there is no task {task_id!r:.100}{why}", {"field": "task_id"})
        return VehicleTask.ended(found, self._clock) if isinstance(found, TaskInfo) else found


def _outcome(future: Future[None]) -> tuple[TaskStatus, UalError | None]:
    """Returns how a task stands, by its future, and the error that ended it."""
    if not future.done():
        return TaskStatus.RUNNING, None
    error = future.exception()
    if error is None:
        return TaskStatus.SUCCEEDED, None
    assert isinstance(error, UalError)
    return (TaskStatus.ABORTED if isinstance(error, TaskAbortedError) else TaskStatus.FAILED), error


def _remembered(task: VehicleTask) -> TaskInfo:
    """Returns what is kept of a task that has ended. Its error keeps the frames that it was raised through no longer:
    they hold the request, and the trajectory.
    """
    info = task.info()
    if info.error is not None:
        info.error.__traceback__ = info.error.__context__ = info.error.__cause__ = None
    return info
