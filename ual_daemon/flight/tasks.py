"""Tasks: the handle of each, and those that are known."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple

from ual.errors import InvalidArgumentError, TaskAbortedError, UalError
from ual.types import TaskInfo, TaskKind, TaskStatus
from ual_daemon.backends.base import Clock


class Progress(NamedTuple):
    """How far a task has come: a share of 1, metres left, and the waypoint it is flying to."""

    progress: float | None = None
    distance_left_m: float | None = None
    waypoint_index: int | None = None


_NO_PROGRESS: Callable[[], Progress] = Progress
_REMEMBERED_COUNT = 200


class VehicleTask:
    """A manoeuvre that takes time. `future` ends with None, or with the `UalError` that ended it.

    Any thread may call any member. See `ual_daemon.vehicle.commands.Commands.cancel` for what cancels it.
    """

    def __init__(self, kind: TaskKind, description: str, clock: Clock) -> None:
        self.id = f"{kind.name.lower()}-{os.urandom(4).hex()}"
        self.kind = kind
        self.description = description
        self.future: Future[None] = Future()
        # A running future cannot be cancelled by those who wait for it: only what flies ends a task.
        self.future.set_running_or_notify_cancel()
        self._clock = clock
        self._started_s = clock.now_s()
        self._ended_s: float | None = None
        self._progress = _NO_PROGRESS
        self._reported_progress: float | None = None

    def info(self) -> TaskInfo:
        """Returns how it stands now."""
        progress, distance_left_m, waypoint_index = self._progress()
        if progress is not None:  # a noisy estimate must not make it fall
            progress = self._reported_progress = max(progress, self._reported_progress or 0.0)
        status, error = self._status()
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
            self.description,
        )

    def _status(self) -> tuple[TaskStatus, UalError | None]:
        if not self.future.done():
            return TaskStatus.RUNNING, None
        error = self.future.exception()
        if error is None:
            return TaskStatus.SUCCEEDED, None
        assert isinstance(error, UalError)
        return (TaskStatus.ABORTED if isinstance(error, TaskAbortedError) else TaskStatus.FAILED), error

    def report(self, progress: Callable[[], Progress]) -> None:
        """Sets how far it has come, on the update thread: a pure function, called when a caller asks."""
        self._progress = progress

    def end(self, error: UalError | None) -> None:
        """Ends it. Runs the callbacks of its future, so that no lock may be held."""
        self._ended_s = self._clock.now_s()
        if error is None:
            self.future.set_result(None)
        else:
            self.future.set_exception(error)


class Tasks:
    """The tasks of one UAV that are known: those that run, and the last ones that ended. Any thread may call."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._tasks: OrderedDict[str, VehicleTask] = OrderedDict()

    def new(self, kind: TaskKind, description: str) -> VehicleTask:
        """Makes a task, and forgets the oldest one where there are too many."""
        task = VehicleTask(kind, description, self._clock)
        with self._lock:
            self._tasks[task.id] = task
            if len(self._tasks) > _REMEMBERED_COUNT:
                self._tasks.popitem(last=False)
        return task

    def get(self, task_id: str) -> VehicleTask:
        """Returns a task by its identifier.

        Raises:
            InvalidArgumentError: There is none.

        """
        found = self._tasks.get(task_id)
        if found is None:
            raise InvalidArgumentError(f"task_id: there is no task {task_id[:100]!r}", {"field": "task_id"})
        return found
