"""The asyncio client's handle of a task."""

from __future__ import annotations

from collections.abc import AsyncIterator

import grpc
import grpc.aio

from ual import _calls, _convert
from ual._task import WAIT_RATE_HZ, has_not_ended
from ual._time_limit import time_limit
from ual.aio._connection import Connection
from ual.errors import InvalidArgumentError, WrongStateError
from ual.types import TaskInfo, TaskKind
from ual.v1 import ual_pb2 as pb


class Task:
    """A manoeuvre under way, or ended; the members of `ual.interface.Task` as coroutines."""

    def __init__(self, connection: Connection, info: TaskInfo) -> None:
        self._connection = connection
        self._info = info

    @property
    def id(self) -> str:
        """By which `Uav.task` finds it."""
        return self._info.id

    @property
    def kind(self) -> TaskKind:
        """Which manoeuvre it is."""
        return self._info.kind

    async def info(self) -> TaskInfo:
        if not _calls.has_ended(self._info):
            self._info = await self._connection.run(_calls.get_task(self.id))
        return self._info

    async def done(self) -> bool:
        return _calls.has_ended(await self.info())

    async def wait(self, timeout_s: float | None = None) -> TaskInfo:
        async for info in self._watch(WAIT_RATE_HZ, time_limit(timeout_s)):
            self._info = info
        if self._info.error is not None:
            raise self._info.error
        return self._info

    async def cancel(self) -> None:
        if await self.done():
            return
        try:
            await self._connection.run(_calls.abort(task_id=self.id))
        except (WrongStateError, InvalidArgumentError):
            if not await self.done():
                raise

    async def watch(self, rate_hz: float = 10.0) -> AsyncIterator[TaskInfo]:
        async for info in self._watch(rate_hz, None):
            self._info = info
            yield info

    def __repr__(self) -> str:
        return f"<Task {self.id} {self.kind.name} {self._info.status.name}>"

    async def _watch(self, rate_hz: float, timeout_s: float | None) -> AsyncIterator[TaskInfo]:
        if _calls.has_ended(self._info):
            yield self._info
            return
        request = pb.WatchTaskRequest(task_id=self.id, rate_hz=rate_hz)
        with self._connection.calling() as route:
            call = route.stubs.ual.WatchTask(request, timeout=timeout_s, metadata=self._connection.target.metadata)
            try:
                async for response in call:
                    yield _convert.task_from_proto(response.task)
            except grpc.aio.AioRpcError as error:
                if timeout_s is not None and error.code() is grpc.StatusCode.DEADLINE_EXCEEDED:
                    raise has_not_ended(self.kind, timeout_s) from error
                raise self._connection.error(error) from error
            finally:
                call.cancel()
