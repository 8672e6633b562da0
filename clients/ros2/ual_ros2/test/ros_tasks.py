"""The handles of tasks that a program in ROS has: by an identifier, and of a goal of an action."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from derived_values import read_task
from flying import CANCELED, LIMIT_S, Client, waited
from reading import error_of, number
from ual_msgs import srv

import ual
from ual.interface import Task

Call = Callable[..., Any]
"""Calls a service of the node by its type, its name and its fields; raises what it refuses."""
AGAIN_S = 0.02


def info_of(call: Call, task_id: str) -> ual.TaskInfo:
    """Returns the node's info about a task.

    Raises:
        InvalidArgumentError: There is no such task.
    """
    return read_task(call(srv.GetTask, "get_task", task_id=task_id).task)


class RosTask(Task):
    """A task that is known by its identifier."""

    def __init__(self, call: Call, task_id: str, kind: ual.TaskKind) -> None:
        self._call = call
        self._id = task_id
        self._kind = kind

    @property
    def id(self) -> str:
        return self._id

    @property
    def kind(self) -> ual.TaskKind:
        return self._kind

    def info(self) -> ual.TaskInfo:
        return info_of(self._call, self.id)

    def done(self) -> bool:
        return self.info().status is not ual.TaskStatus.RUNNING

    def wait(self, timeout_s: float | None = None) -> ual.TaskInfo:
        limit_s = LIMIT_S if timeout_s is None else timeout_s
        if not ends_within(self.done, limit_s):
            raise ual.UalTimeoutError(f"it has not ended within {limit_s:g} s")
        info = self.info()
        if info.error is not None:
            raise info.error
        return info

    def cancel(self) -> None:
        self._call(srv.OrderTask, "cancel_task", task_id=self.id)

    def pause(self) -> None:
        self._call(srv.OrderTask, "pause_task", task_id=self.id)

    def resume(self) -> None:
        self._call(srv.OrderTask, "resume_task", task_id=self.id)

    def watch(self, rate_hz: float = 10.0) -> Iterator[ual.TaskInfo]:
        while not self.done():
            yield self.info()
            time.sleep(1.0 / rate_hz)
        yield self.info()


class ActionGoal(RosTask):
    """A goal of an action. Until it has begun, it has no identifier."""

    def __init__(self, client: Client, call: Call, kind: Any, ns: str, name: str, fields: Mapping[str, Any]) -> None:
        super().__init__(call, "", ual.TaskKind[name.upper().removeprefix("FLY_")])
        self._client = client
        self._feedback: list[Any] = []
        self._goal = client.begin(kind, f"/{ns}/ual/{name}", self._feedback.append, **fields)
        self._end = client.end_soon(self._goal)

    @property
    def id(self) -> str:
        told = self._feedback[-1] if self._feedback else self.result
        return str(told.task_id)

    @property
    def result(self) -> Any:
        """Result of the manoeuvre."""
        return self._end.result().result

    def done(self) -> bool:
        return bool(self._end.done())

    def wait(self, timeout_s: float | None = None) -> ual.TaskInfo:
        limit_s = LIMIT_S if timeout_s is None else timeout_s
        if not ends_within(self.done, limit_s):
            raise ual.UalTimeoutError(f"it has not ended within {limit_s:g} s")
        if not self.result.success:
            raise error_of(self.result)
        return self.info()

    def wait_until_begun(self) -> None:
        """Returns once it flies, which the feedback tells, or has ended.

        Raises:
            UalError: It was refused.

        """
        waited(lambda: self._feedback or self.done())
        if self.done() and not self._feedback:
            self.wait()

    def wait_or_cancel(self, timeout_s: float) -> None:
        """Waits for the end; cancels it when the time has passed, as a program in ROS does.

        Raises:
            UalTimeoutError: It has not ended in time.
            UalError: The error that it ended with.

        """
        if not ends_within(self.done, timeout_s):
            self.cancel()
            waited(self.done)
            if self._end.result().status == CANCELED:
                raise ual.UalTimeoutError(f"it has not ended within {timeout_s:g} s")
        self.wait()

    def cancel(self) -> None:
        if not self.done() and not self._client.cancel(self._goal) and not self.done():
            raise ual.WrongStateError("the node rejects that the goal is cancelled")

    def watch(self, rate_hz: float = 10.0) -> Iterator[ual.TaskInfo]:
        """By the feedback, which comes at the rate of the node."""
        seen = 0
        while not self.done():
            for told in self._feedback[seen:]:
                seen += 1
                yield ual.TaskInfo(
                    self.id,
                    self.kind,
                    ual.TaskStatus.RUNNING,
                    number(told.progress),
                    number(told.distance_left),
                    is_paused=told.is_paused,
                )
            time.sleep(AGAIN_S)
        yield self.info()


def ends_within(done: Callable[[], bool], time_s: float) -> bool:
    """Returns whether something has ended in time."""
    deadline_s = time.monotonic() + time_s
    while not done() and time.monotonic() < deadline_s:
        time.sleep(0.005)
    return done()
