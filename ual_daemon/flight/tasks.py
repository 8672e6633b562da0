"""The handle of a task: how it stands, how it ended, and how to cancel it."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple

from ual.errors import TaskAbortedError, UalError
from ual.types import TaskInfo, TaskKind, TaskStatus
from ual_daemon.backends.base import Clock


class Progress(NamedTuple):
    """How far a task has come: a share of 1, metres left, and the waypoint it is flying to."""

    progress: float | None = None
    distance_left_m: float | None = None
    waypoint_index: int | None = None


_NO_PROGRESS: Callable[[], Progress] = Progress


class VehicleTask:
    """A manoeuvre that takes time. `future` ends with None or with the `UalError` that it ended by.

    Every member may be called from any thread.
    """

    def __init__(
        self, kind: TaskKind, description: str, clock: Clock, on_cancel: Callable[[VehicleTask], None]
    ) -> None:
        self.id = f"{kind.name.lower()}-{os.urandom(4).hex()}"
        self.kind = kind
        self.description = description
        self.future: Future[None] = Future()
        # A running future cannot be cancelled behind our back: only `cancel`, and what flies, end a task.
        self.future.set_running_or_notify_cancel()
        self._clock = clock
        self._on_cancel = on_cancel
        self._started_s = clock.now_s()
        self._ended_s: float | None = None
        self._progress = _NO_PROGRESS
        self._told: float | None = None

    def info(self) -> TaskInfo:
        """How it stands now."""
        progress, distance_left_m, waypoint_index = self._progress()
        if progress is not None:  # what a noisy estimate takes back of it is left
            progress = self._told = max(progress, self._told or 0.0)
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

    def cancel(self) -> None:
        """Ends it; the UAV stops and holds. Nothing happens if it has ended. Raises `WrongStateError` for a take-off
        or landing, which only the safety pilot can abort.
        """
        self._on_cancel(self)

    def report(self, progress: Callable[[], Progress]) -> None:
        """Says how far it has come (by the update thread): a pure function, called when somebody asks."""
        self._progress = progress

    def end(self, error: UalError | None) -> None:
        """Ends it. Runs the callbacks of its future, so no lock may be held."""
        self._ended_s = self._clock.now_s()
        if error is None:
            self.future.set_result(None)
        else:
            self.future.set_exception(error)
