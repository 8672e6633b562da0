"""`set_velocity`, `set_pose` and `set_external_pose` of the asyncio client; see `ual._setpoints`."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import grpc.aio

from ual._setpoints import CLOSE_TIMEOUT_S, SETPOINTS, STALE_SETPOINT_S, STREAM_S, Element, StreamKind, log_settled
from ual.aio._connection import Connection
from ual.errors import DaemonUnreachableError, UalError

_LOST_STATUS = "Internal error from Core"
"""gRPC's own words where a write has failed because the daemon had ended the stream: its status is not read then."""


class Setpoints:
    """Sends setpoints; skips those that a newer one has replaced."""

    def __init__(self, connection: Connection, kind: StreamKind = SETPOINTS) -> None:
        self._kind = kind
        self._connection = connection
        self._accepted_s: float | None = None
        self._failure: UalError | None = None
        self._stream: _Stream | None = None
        self._has_lost_status = False
        """Whether the last stream has ended with a status that is not known."""

    async def send(self, setpoint: Element) -> None:
        """Sends a setpoint. Raises the `UalError` by which the daemon refused this one or an earlier one."""
        self._connection.require_own_loop()
        failure, self._failure = self._failure, None
        if failure is not None:
            self._accepted_s = None
            raise failure
        now_s = asyncio.get_running_loop().time()
        if self._accepted_s is None or now_s - self._accepted_s >= STREAM_S:
            self._has_lost_status = False
            await self._connection.run(self._kind.single(setpoint))
            self._accepted_s = asyncio.get_running_loop().time()
            return
        self._accepted_s = now_s
        if self._stream is None or self._stream.is_ending:
            self._stream = _Stream(self._connection, self._on_end, self._kind)
        self._stream.put(setpoint)
        # Lets the writing task run even in a program that awaits nothing else.
        await asyncio.sleep(0)

    async def settle(self) -> bool:
        """Sends the setpoint that waits and ends the stream; as `ual._setpoints.Setpoints.settle`."""
        self._accepted_s = None
        if self._stream is not None:
            self._connection.require_own_loop()
        is_taken = self._stream is None or await self._stream.close(CLOSE_TIMEOUT_S)
        failure, self._failure = self._failure, None
        if self._has_lost_status:
            self._has_lost_status = False
            failure = DaemonUnreachableError(f"the daemon ended the stream of {self._kind.name}; gRPC has lost why")
        return log_settled(is_taken, failure, self._kind)

    def _on_end(self, stream: _Stream, failure: UalError | None) -> None:
        if self._stream is stream:
            self._stream = None
            self._failure = failure
            self._has_lost_status = stream.has_lost_status
            if stream.has_lost_status:  # the next one is sent by a call, which gets it
                self._accepted_s = None


class _Stream:
    """One stream of setpoints, written by a task of its own: the newest waits, those between are dropped."""

    def __init__(
        self, connection: Connection, on_end: Callable[[_Stream, UalError | None], None], kind: StreamKind
    ) -> None:
        self._kind = kind
        self.is_ending = self.has_lost_status = False
        self._connection = connection
        self._on_end = on_end
        self._changed = asyncio.Event()
        self._newest: tuple[Element, float] | None = None
        self._writing = asyncio.create_task(self._write())

    def put(self, setpoint: Element) -> None:
        """Sends a setpoint, or lets it wait in place of the one that waits."""
        self._newest = (setpoint, asyncio.get_running_loop().time())
        self._changed.set()

    async def close(self, timeout_s: float) -> bool:
        """Ends the stream, as `close` in `ual._setpoints` does. If this call is cancelled, the stream still ends."""
        self.is_ending = True
        self._changed.set()
        _, unfinished = await asyncio.wait((self._writing,), timeout=timeout_s)
        if unfinished:
            self._writing.cancel()
            await asyncio.wait(unfinished)
        return not unfinished

    async def _write(self) -> None:
        failure: UalError | None = None
        try:
            async with self._connection.calling() as route:
                call = getattr(route.stubs.ual, self._kind.method)(metadata=self._connection.target.metadata)
                try:
                    await self._write_newest(call)
                    await call.done_writing()
                    await call
                except asyncio.InvalidStateError:
                    await call  # the call has ended: this raises its error
                finally:
                    call.cancel()
            if not self.is_ending:
                failure = DaemonUnreachableError(f"the daemon ended the stream of {self._kind.name}")
        except grpc.aio.AioRpcError as error:
            self.has_lost_status = error.details() == _LOST_STATUS
            failure = None if self.has_lost_status else self._connection.error(error)
        except UalError as error:
            failure = error
        finally:
            self._on_end(self, failure)

    async def _write_newest(self, call: Any) -> None:  # noqa: ANN401 (gRPC's call)
        loop = asyncio.get_running_loop()
        while not call.done():
            if self._newest is None:
                if self.is_ending:
                    return
                self._changed.clear()
                await self._changed.wait()
                continue
            (setpoint, put_s), self._newest = self._newest, None
            if loop.time() - put_s <= STALE_SETPOINT_S:
                await call.write(setpoint)
