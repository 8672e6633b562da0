"""The asyncio client's channel to its daemon; see `ual._connection`."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any, TypeVar

import grpc
import grpc.aio

from ual import _calls, rpc_errors
from ual._calls import Call
from ual._target import CHANNEL_OPTIONS, Stubs, Target
from ual.errors import DaemonUnreachableError, UalError
from ual.v1 import ual_pb2 as pb

T = TypeVar("T")


class Connection:
    """Makes calls to the daemon of a target, on one event loop."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self._channel: grpc.aio.Channel | None = None
        self._stubs: Stubs | None = None
        self._address = ""
        self._is_closed = False
        self._was_reached = False
        self._retired: set[asyncio.Task[None]] = set()

    async def run(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call and waits for its answer; cancelled with the task that waits."""
        limit_s = _calls.deadline(call, timeout_s)
        try:
            return await self._run_once(call, limit_s)
        except DaemonUnreachableError as error:
            if not (self._was_reached and rpc_errors.was_never_sent(error)):
                raise
            self._was_reached = False
            await self._wait_until_back(error)
        return await self._run_once(call, limit_s)

    async def stream_telemetry(self, rate_hz: float) -> AsyncIterator[pb.StreamTelemetryResponse]:
        """The stream of telemetry."""
        request = pb.StreamTelemetryRequest(rate_hz=rate_hz)
        call = self.stubs().ual.StreamTelemetry(request, metadata=self.target.metadata)
        try:
            async for response in call:
                yield response
        except grpc.aio.AioRpcError as error:
            raise self.error(error) from error
        finally:
            call.cancel()

    def stubs(self) -> Stubs:
        """The daemon's services, where it is now."""
        if self._is_closed:
            raise UalError("this client is closed")
        address = self.target.address()
        if self._stubs is None or address != self._address:
            if self._channel is not None:
                closing = asyncio.create_task(self._channel.close())
                self._retired.add(closing)
                closing.add_done_callback(self._retired.discard)
            self._channel, self._address = self._make_channel(address), address
            self._stubs = Stubs(self._channel)
        return self._stubs

    def error(self, error: grpc.RpcError) -> UalError:
        """What a call of this connection ended with."""
        return rpc_errors.from_rpc_error(error, address=self._address, ns=self.target.ns)

    async def close(self) -> None:
        """Ends every call that runs, and refuses new ones."""
        self._is_closed = True
        if self._channel is not None:
            await self._channel.close()
        if self._retired:
            await asyncio.wait(self._retired)

    async def _run_once(self, call: Call[T], limit_s: float | None) -> T:
        method = self.stubs().method(call)
        try:
            response = await method(call.request, timeout=limit_s, metadata=self.target.metadata)
        except grpc.aio.AioRpcError as error:
            raise _calls.in_time(self.error(error), call, limit_s) from error
        self._was_reached = True
        return call.read(response)

    def _make_channel(self, address: str) -> grpc.aio.Channel:
        if self.target.credentials is None:
            return grpc.aio.insecure_channel(address, CHANNEL_OPTIONS)
        return grpc.aio.secure_channel(address, self.target.credentials, CHANNEL_OPTIONS)

    async def _wait_until_back(self, unreachable: DaemonUnreachableError) -> None:
        probe: Any = self.stubs().ual.GetInfo
        try:
            await probe(
                pb.GetInfoRequest(), timeout=_calls.RECONNECT_S, metadata=self.target.metadata, wait_for_ready=True
            )
        except grpc.aio.AioRpcError as error:
            if error.code() in (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.UNAVAILABLE):
                raise unreachable from error
            raise self.error(error) from error
