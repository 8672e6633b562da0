"""`set_velocity` and `set_pose` of the asyncio client; see `ual._setpoints`."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import grpc.aio

from ual import _calls
from ual._setpoints import CLOSE_S, CONTINUES_S, STALE_S
from ual.aio._connection import Connection
from ual.errors import DaemonUnreachableError, UalError
from ual.v1 import ual_pb2 as pb

_log = logging.getLogger(__name__)


class Setpoints:
    """Sends setpoints, the newest only."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._accepted_s: float | None = None
        self._failure: UalError | None = None
        self._changed = asyncio.Event()
        self._newest: tuple[pb.StreamSetpointsRequest, float] | None = None
        self._is_ending = False
        self._writing: asyncio.Task[None] | None = None

    async def send(self, setpoint: pb.StreamSetpointsRequest) -> None:
        """Sends a setpoint; raises the refusal of this one, or of one before."""
        failure, self._failure = self._failure, None
        if failure is not None:
            self._accepted_s = None
            raise failure
        now_s = asyncio.get_running_loop().time()
        if self._accepted_s is None or now_s - self._accepted_s >= CONTINUES_S:
            await self._connection.run(_calls.single_setpoint(setpoint))
            self._accepted_s = asyncio.get_running_loop().time()
            return
        self._accepted_s = now_s
        self._newest = (setpoint, now_s)
        self._changed.set()
        if self._writing is None:
            self._writing = asyncio.create_task(self._write())
        # Lets the writer run, in a program that never waits for anything else.
        await asyncio.sleep(0)

    async def settle(self) -> None:
        """Sends what waits and ends the stream; as `ual._setpoints.Setpoints.settle`."""
        self._accepted_s = None
        if self._writing is not None:
            self._is_ending = True
            self._changed.set()
            _, unfinished = await asyncio.wait((self._writing,), timeout=CLOSE_S)
            for writing in unfinished:
                writing.cancel()
                await asyncio.wait((writing,))
            self._is_ending = False
        failure, self._failure = self._failure, None
        if failure is not None:
            _log.warning("the last setpoints were refused: %s: %s", failure.reason, failure.message)

    async def _write(self) -> None:
        try:
            with self._connection.calling() as route:
                call = route.stubs.ual.StreamSetpoints(metadata=self._connection.target.metadata)
                try:
                    await self._write_newest(call)
                    await call.done_writing()
                    await call
                except asyncio.InvalidStateError:
                    await call  # it has ended; this says how
                finally:
                    call.cancel()
        except grpc.aio.AioRpcError as error:
            self._failure = self._connection.error(error)
        except UalError as error:
            self._failure = error
        else:
            if not self._is_ending:
                self._failure = DaemonUnreachableError("the daemon ended the stream of setpoints")
        finally:
            self._writing = None

    async def _write_newest(self, call: Any) -> None:  # noqa: ANN401 (gRPC's call)
        loop = asyncio.get_running_loop()
        while not call.done():
            if self._newest is None:
                if self._is_ending:
                    return
                self._changed.clear()
                await self._changed.wait()
                continue
            (setpoint, put_s), self._newest = self._newest, None
            if loop.time() - put_s <= STALE_S:
                await call.write(setpoint)
