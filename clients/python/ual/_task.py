"""The client's handle of a task."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Generic, TypeVar

import grpc
from typing_extensions import override

from ual import _calls, interface
from ual._connection import Connection
from ual.errors import InvalidArgumentError, UalTimeoutError, WrongStateError
from ual.shared.time_limit import time_limit
from ual.types import TaskInfo, TaskKind
from ual.wire import uav

WAIT_RATE_HZ = 1.0
"""Waiting needs only the last message, which the daemon sends at once when the task ends."""

ConnectionT = TypeVar("ConnectionT")


def not_ended(kind: TaskKind, timeout_s: float) -> UalTimeoutError:
    """The error that `wait` raises when its time has passed."""
    return UalTimeoutError(f"{kind.name} has not ended after {timeout_s:g} s; it goes on")


class KnownTask(Generic[ConnectionT]):
    """Knowledge of the client about a task without a question to the daemon. Base of both clients' handles."""

    def __init__(self, connection: ConnectionT, info: TaskInfo) -> None:
        self._connection = connection
        self._info = info

    @property
    def id(self) -> str:
        """The identifier, for `Uav.task`."""
        return self._info.id

    @property
    def kind(self) -> TaskKind:
        """Kind of manoeuvre."""
        return self._info.kind

    def __repr__(self) -> str:
        return f"<Task {self.id} {self.kind.name} {self._info.status.name}>"


class Task(KnownTask[Connection], interface.Task):
    """A manoeuvre that is running or has ended; see `ual.interface.Task`."""

    @override
    def info(self) -> TaskInfo:
        if not _calls.has_ended(self._info):
            self._info = self._connection.run(_calls.get_task(self.id))
        return self._info

    @override
    def done(self) -> bool:
        return _calls.has_ended(self.info())

    @override
    def wait(self, timeout_s: float | None = None) -> TaskInfo:
        for info in self._watch(WAIT_RATE_HZ, time_limit(timeout_s)):
            self._info = info
        if self._info.error is not None:
            raise self._info.error
        return self._info

    @override
    def cancel(self) -> None:
        if self.done():
            return
        try:
            self._connection.run(_calls.abort(task_id=self.id))
        except (WrongStateError, InvalidArgumentError):
            if not self.done():
                raise

    @override
    def pause(self) -> None:
        self._connection.run(_calls.pause(self.id))

    @override
    def resume(self) -> None:
        self._connection.run(_calls.resume(self.id))

    @override
    def watch(self, rate_hz: float = 10.0) -> Iterator[TaskInfo]:
        for info in self._watch(rate_hz, None):
            self._info = info
            yield info

    def _watch(self, rate_hz: float, timeout_s: float | None) -> Iterator[TaskInfo]:
        if _calls.has_ended(self._info):
            yield self._info
            return
        call = self._connection.watch_task(self.id, rate_hz, timeout_s)
        try:
            for response in call:
                yield uav.task_info_from_proto(response.task)
        except grpc.RpcError as error:
            if timeout_s is not None and error.code() is grpc.StatusCode.DEADLINE_EXCEEDED:
                raise not_ended(self.kind, timeout_s) from error
            raise self._connection.error(error) from None
        finally:
            call.cancel()
