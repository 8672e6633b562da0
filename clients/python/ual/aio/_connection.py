"""The asyncio client's channel to its daemon; see `ual._connection`."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, TypeVar

import grpc
import grpc.aio

from ual import _calls, _forks
from ual._calls import Call
from ual._target import SETTLING_S, DaemonTarget, Route, Stubs
from ual.errors import ClientUnusableError, DaemonUnreachableError, UalError
from ual.v1 import ual_pb2 as pb
from ual.wire import rpc_errors

T = TypeVar("T")


class Connection:
    """Makes calls to the daemon of a target, on one event loop."""

    def __init__(self, target: DaemonTarget) -> None:
        self.target = target
        self._route: Route | None = None
        self._retired: list[Route] = []
        self._closing: set[asyncio.Task[None]] = set()
        self._is_closed = False
        self._was_reached = False
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def is_closed(self) -> bool:
        """Whether it was closed."""
        return self._is_closed

    @property
    def described(self) -> str:
        """Description of the UAV, its address, and whether its daemon has answered. Makes no call."""
        status = "closed" if self._is_closed else "connected" if self._was_reached else "not connected"
        return self.target.described(status)

    async def run(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call and waits for its answer. Cancelling the waiting task cancels the call.

        Raises:
            DaemonUnreachableError: No daemon answers.
            UalTimeoutError: The daemon did not answer in time.
            UalError: The daemon refused the call, or it failed.
        """
        limit_s = _calls.deadline(call, timeout_s)
        try:
            return await self._run_once(call, limit_s)
        except DaemonUnreachableError as error:
            if not (self._was_reached and rpc_errors.was_never_sent(error)):
                raise
            self._was_reached = False
            await self._wait_until_back(error)
        return await self._run_once(call, limit_s)

    async def iterate(self, call: Call[T]) -> AsyncIterator[T]:
        """Yields what each response of a stream is. Raises the `UalError` by which the stream ended."""
        with _calls.traced(call) as more:
            async with self.calling() as route:
                stream = route.stubs.method(call)(call.request, metadata=(*self.target.metadata, *more))
                try:
                    async for response in stream:
                        self._was_reached = True
                        yield call.read(response)
                except grpc.aio.AioRpcError as error:
                    raise self.error(error) from None
                finally:
                    stream.cancel()

    async def stream_telemetry(self, rate_hz: float) -> AsyncIterator[pb.StreamTelemetryResponse]:
        """Yields telemetry until the stream ends. Raises the `UalError` by which it ended."""
        request = pb.StreamTelemetryRequest(rate_hz=rate_hz)
        async with self.calling() as route:
            call = route.stubs.ual.StreamTelemetry(request, metadata=self.target.metadata)
            try:
                async for response in call:
                    self._was_reached = True
                    yield response
            except grpc.aio.AioRpcError as error:
                raise self.error(error) from None
            finally:
                call.cancel()

    @asynccontextmanager
    async def calling(self) -> AsyncIterator[Route]:
        """Returns the route to where the daemon is now. Its channel stays open until the block is left."""
        while not self.target.is_settled:  # noqa: ASYNC110  the network's threads set no event of this loop
            await asyncio.sleep(SETTLING_S)
        route = self._enter()
        try:
            yield route
        except asyncio.CancelledError as error:
            # gRPC also raises this in every call of a channel that is being closed.
            if self._is_cancelled():
                raise
            raise _calls.closed() if self._is_closed else UalError("the call was cancelled before it ended") from error
        finally:
            route.call_count -= 1
            if route in self._retired and not route.call_count:
                self._retired.remove(route)
                self._close_soon(route)

    def error(self, error: grpc.RpcError) -> UalError:
        """Converts the error that a call of this connection ended with."""
        address = "" if self._route is None else self._route.address
        return rpc_errors.from_rpc_error(error, address=address, ns=self.target.ns)

    def require_own_loop(self) -> None:
        """Raises `ClientUnusableError` on another event loop than that of the first call."""
        running = asyncio.get_running_loop()
        if self._loop is None:
            self._loop = running
        if self._loop is not running:
            raise ClientUnusableError(
                "this client belongs to another event loop, that of its first call: make one inside each asyncio.run()"
            )

    async def close(self) -> None:
        """Ends all running calls and refuses new ones."""
        self._is_closed = True
        routes, self._retired = self._retired, []
        if self._route is not None:
            routes.append(self._route)
        for route in routes:
            await route.channel.close()
        if self._closing:
            await asyncio.wait(self._closing)
        if self.target.is_followed:
            await self._leave_network()

    async def _leave_network(self) -> None:
        leaving = threading.Thread(target=self.target.close, name="ual network")
        leaving.start()
        while leaving.is_alive():  # noqa: ASYNC110  the network's threads set no event of this loop
            await asyncio.sleep(SETTLING_S)

    def _enter(self) -> Route:
        if self._is_closed:
            raise _calls.closed()
        _forks.use_asyncio()
        self.require_own_loop()
        address = self.target.address()
        route = self._route
        if route is None or address != route.address:
            channel = self.target.open_channel(grpc.aio, address)
            self._route, old = Route(address, channel, Stubs(channel)), route
            if old is not None and old.call_count:
                self._retired.append(old)
            elif old is not None:
                self._close_soon(old)
            route = self._route
        route.call_count += 1
        return route

    def _close_soon(self, route: Route) -> None:
        closing = asyncio.create_task(route.channel.close())
        self._closing.add(closing)
        closing.add_done_callback(self._closing.discard)

    def _is_cancelled(self) -> bool:
        """Returns whether the task that makes the call was cancelled, and not only the call."""
        cancelling = getattr(asyncio.current_task(), "cancelling", None)
        return cancelling() > 0 if cancelling is not None else not self._is_closed  # Python 3.10 has no `cancelling`

    async def _run_once(self, call: Call[T], limit_s: float | None) -> T:
        with _calls.traced(call) as more:
            async with self.calling() as route:
                metadata = (*self.target.metadata, *more)
                try:
                    begun = route.stubs.method(call)(call.request, timeout=limit_s, metadata=metadata)
                    response = await (_all_of(begun) if call.is_stream else begun)
                except grpc.aio.AioRpcError as error:
                    raise _calls.in_time(self.error(error), call, limit_s) from None
        self._was_reached = True
        return call.read(response)

    async def _wait_until_back(self, unreachable: DaemonUnreachableError) -> None:
        """Waits for a daemon that answered before: it may be restarting, here or at another address."""
        async with self.calling() as route:
            try:
                await route.stubs.ual.GetInfo(
                    pb.GetInfoRequest(), timeout=_calls.RECONNECT_S, metadata=self.target.metadata, wait_for_ready=True
                )
            except grpc.aio.AioRpcError as error:
                if error.code() not in (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.UNAVAILABLE):
                    raise self.error(error) from None
                if self.target.address() == route.address:
                    raise unreachable from None


async def _all_of(responses: Any) -> list[Any]:  # noqa: ANN401 (an iterator and a call: gRPC has no type for it)
    """Returns all responses of a stream. It is cancelled where anything else ends the wait for it."""
    try:
        return [each async for each in responses]
    finally:
        responses.cancel()
