"""The asyncio client's handle of a task."""

from __future__ import annotations

from collections.abc import AsyncIterator

import grpc
import grpc.aio

from ual import _calls
from ual._task import WAIT_RATE_HZ, KnownTask, not_ended
from ual.aio._connection import Connection
from ual.errors import InvalidArgumentError, WrongStateError
from ual.shared.time_limit import time_limit
from ual.types import TaskInfo
from ual.v1 import ual_pb2 as pb
from ual.wire import uav


class Task(KnownTask[Connection]):
    """A manoeuvre that is running or has ended; the members of `ual.interface.Task` as coroutines."""

    async def info(self) -> TaskInfo:
        """Returns how it stands now."""
        if not _calls.has_ended(self._info):
            self._info = await self._connection.run(_calls.get_task(self.id))
        return self._info

    async def done(self) -> bool:
        """Returns whether it has ended, however it ended."""
        return _calls.has_ended(await self.info())

    async def wait(self, timeout_s: float | None = None) -> TaskInfo:
        """Blocks until it has ended.

        Raises:
            UalTimeoutError: It has not ended after `timeout_s`; it goes on.
            UalError: The error by which it was aborted or failed.
        """
        async for info in self._watch(WAIT_RATE_HZ, time_limit(timeout_s)):
            self._info = info
        if self._info.error is not None:
            raise self._info.error
        return self._info

    async def cancel(self) -> None:
        """Ends it: the UAV stops and holds its position. Does nothing if it has ended.

        Raises:
            WrongStateError: It is a take-off or a landing, which cannot be cancelled.
        """
        if await self.done():
            return
        try:
            await self._connection.run(_calls.abort(task_id=self.id))
        except (WrongStateError, InvalidArgumentError):
            if not await self.done():
                raise

    async def pause(self) -> None:
        """Stops it on its way, and holds there; see `ual.interface.Task.pause`."""
        await self._connection.run(_calls.pause(self.id))

    async def resume(self) -> None:
        """Goes on with it along the rest of its way; see `ual.interface.Task.resume`."""
        await self._connection.run(_calls.resume(self.id))

    async def watch(self, rate_hz: float = 10.0) -> AsyncIterator[TaskInfo]:
        """Yields how it stands, `rate_hz` times a second, until it has ended; the last value says how it ended."""
        async for info in self._watch(rate_hz, None):
            self._info = info
            yield info

    async def _watch(self, rate_hz: float, timeout_s: float | None) -> AsyncIterator[TaskInfo]:
        if _calls.has_ended(self._info):
            yield self._info
            return
        request = pb.WatchTaskRequest(task_id=self.id, rate_hz=rate_hz)
        async with self._connection.calling() as route:
            call = route.stubs.ual.WatchTask(request, timeout=timeout_s, metadata=self._connection.target.metadata)
            try:
                async for response in call:
                    yield uav.task_info_from_proto(response.task)
            except grpc.aio.AioRpcError as error:
                if timeout_s is not None and error.code() is grpc.StatusCode.DEADLINE_EXCEEDED:
                    raise not_ended(self.kind, timeout_s) from error
                raise self._connection.error(error) from None
            finally:
                call.cancel()
