"""The client's channel to its daemon: opened when first needed, and again where the daemon moved."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from typing import Any, TypeVar

import grpc

from ual import _calls, _rpc_errors
from ual._calls import Call
from ual._target import CHANNEL_OPTIONS, Route, Stubs, Target
from ual.errors import DaemonUnreachableError, UalError
from ual.v1 import ual_pb2 as pb

T = TypeVar("T")


class Connection:
    """Makes calls to the daemon of a target. May be used from any thread."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self._lock = threading.Lock()
        self._route: Route | None = None
        self._retired: list[Route] = []
        self._is_closed = False
        self._was_reached = False

    def run(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call and waits for its answer. A call that is interrupted (Ctrl-C) is cancelled."""
        limit_s = _calls.deadline(call, timeout_s)
        try:
            return self._run_once(call, limit_s)
        except DaemonUnreachableError as error:
            if not (self._was_reached and _rpc_errors.was_never_sent(error)):
                raise
            self._was_reached = False
            self._wait_until_back(error)
        return self._run_once(call, limit_s)

    def stream_telemetry(self, rate_hz: float) -> TelemetryStream:
        """A stream of telemetry, over a channel of its own. Raises where the daemon is not found."""
        # Imported with the first channel anyhow, as late as that.
        from grpc.experimental import ChannelOptions

        address = self.target.address()
        if self._is_closed:
            raise _calls.closed()
        # Its reader waits for it himself, not for a thread that waits for all calls: docs/decisions/0016.
        channel = self._make_channel(address, ((ChannelOptions.SingleThreadedUnaryStream, 1),))
        return TelemetryStream(channel, self.target, address, rate_hz)

    def watch_task(self, task_id: str, rate_hz: float, timeout_s: float | None) -> Any:  # noqa: ANN401 (an iterator and a call: gRPC has no type for it)
        """The stream of a task's progress: an iterator with `cancel`, which raises `grpc.RpcError`."""
        request = pb.WatchTaskRequest(task_id=task_id, rate_hz=rate_hz)
        return self._begin(lambda stubs: stubs.ual.WatchTask(request, timeout=timeout_s, metadata=self.target.metadata))

    def stream_setpoints(self, setpoints: Iterator[pb.StreamSetpointsRequest]) -> Any:  # noqa: ANN401 (as above)
        """Sends setpoints until the iterator ends: a future, which raises `grpc.RpcError`."""
        return self._begin(lambda stubs: stubs.ual.StreamSetpoints.future(setpoints, metadata=self.target.metadata))

    def error(self, error: grpc.RpcError) -> UalError:
        """What a call of this connection ended with."""
        if self._is_closed and error.code() is grpc.StatusCode.CANCELLED:
            return _calls.closed()
        route = self._route
        return _rpc_errors.from_rpc_error(error, address="" if route is None else route.address, ns=self.target.ns)

    def close(self) -> None:
        """Ends every call that runs, and refuses new ones."""
        with self._lock:
            self._is_closed = True
            routes, self._retired = self._retired, []
            if self._route is not None:
                routes.append(self._route)
            self._route = None
        for route in routes:
            route.channel.close()

    def _run_once(self, call: Call[T], limit_s: float | None) -> T:
        try:
            response = self._use(lambda stubs: self._invoke(stubs, call, limit_s))
        except grpc.RpcError as error:
            raise _calls.in_time(self.error(error), call, limit_s) from error
        except grpc.FutureCancelledError as error:
            raise _calls.closed() from error
        self._was_reached = True
        return call.read(response)

    def _invoke(self, stubs: Stubs, call: Call[T], limit_s: float | None) -> Any:  # noqa: ANN401 (a response)
        method = stubs.method(call)
        if call.quick_s is not None:
            return method(call.request, timeout=limit_s, metadata=self.target.metadata)
        # As a future it is cancelled when Ctrl-C, or whatever else, ends the waiting for it.
        future = method.future(call.request, timeout=limit_s, metadata=self.target.metadata)
        try:
            return future.result()
        finally:
            future.cancel()

    def _use(self, use: Callable[[Stubs], T]) -> T:
        """Makes a call that has ended when this returns."""
        route = self._enter()
        try:
            return self._call(use, route)
        finally:
            self._leave(route)

    def _begin(self, begin: Callable[[Stubs], Any]) -> Any:  # noqa: ANN401 (a call: gRPC has no type for it)
        """Makes a call that goes on."""
        route = self._enter()
        try:
            call = self._call(begin, route)
        except BaseException:
            self._leave(route)
            raise
        call.add_done_callback(lambda _: self._leave(route))
        return call

    def _call(self, use: Callable[[Stubs], T], route: Route) -> T:
        try:
            return use(route.stubs)
        except ValueError as error:
            if self._is_closed:  # gRPC's answer on a channel that was closed meanwhile
                raise _calls.closed() from error
            raise

    def _enter(self) -> Route:
        """Where the daemon is now, for one call: its channel stays open until that leaves."""
        address = self.target.address()
        with self._lock:
            if self._is_closed:
                raise _calls.closed()
            route = self._route
            if route is None or address != route.address:
                if route is not None:
                    self._retired.append(route)
                channel = self._make_channel(address)
                self._route = route = Route(address, channel, Stubs(channel))
            route.call_count += 1
            unused = [each for each in self._retired if not each.call_count]
            self._retired = [each for each in self._retired if each.call_count]
        for each in unused:
            each.channel.close()
        return route

    def _leave(self, route: Route) -> None:
        # Its channel is closed by who enters next: this is called on gRPC's thread, too, which closing would wait for.
        with self._lock:
            route.call_count -= 1

    def _make_channel(self, address: str, more: tuple[tuple[str, int], ...] = ()) -> grpc.Channel:
        options = (*CHANNEL_OPTIONS, *more)
        if self.target.credentials is None:
            return grpc.insecure_channel(address, options)
        return grpc.secure_channel(address, self.target.credentials, options)

    def _wait_until_back(self, unreachable: DaemonUnreachableError) -> None:
        """Waits for a daemon that was there before: it may be starting again, here or elsewhere, or gRPC pausing."""
        address = self.target.address()
        try:
            self._use(
                lambda stubs: stubs.ual.GetInfo(
                    pb.GetInfoRequest(),
                    timeout=_calls.RECONNECT_S,
                    metadata=self.target.metadata,
                    wait_for_ready=True,
                )
            )
        except grpc.RpcError as error:
            if error.code() not in (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.UNAVAILABLE):
                raise self.error(error) from error
            if self.target.address() == address:
                raise unreachable from error


class TelemetryStream:
    """One stream of telemetry. One thread at a time reads it; `close` may be called from any."""

    def __init__(self, channel: grpc.Channel, target: Target, address: str, rate_hz: float) -> None:
        self._channel = channel
        self._target = target
        self._address = address
        self._is_closed = False
        self._call: Any = Stubs(channel).ual.StreamTelemetry(
            pb.StreamTelemetryRequest(rate_hz=rate_hz), metadata=target.metadata
        )

    def read(self) -> Generator[pb.StreamTelemetryResponse, None, None]:
        """The samples, until it is closed. Raises what the daemon, or the connection, ends it by."""
        try:
            yield from self._call
        except grpc.RpcError as error:
            if self._is_closed:
                raise _calls.closed() from error
            raise _rpc_errors.from_rpc_error(error, address=self._address, ns=self._target.ns) from error
        finally:
            self.close()
            with suppress(grpc.RpcError):  # only once its end has been read does gRPC give back what it holds
                for _ in self._call:
                    pass

    def close(self) -> None:
        """Ends it."""
        self._is_closed = True
        self._channel.close()  # not by `cancel`: of a call that it ended, the reader would not read the end
