"""The client's channel to its daemon: opened when first needed, and again when the daemon has moved."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import suppress
from typing import Any, TypeVar

import grpc

from ual import _calls, _forks, _interrupts
from ual._calls import Call
from ual._target import DaemonTarget, Route, Stubs
from ual.errors import DaemonUnreachableError, UalError
from ual.shared.tracing import Metadata
from ual.v1 import ual_pb2 as pb
from ual.wire import rpc_errors

T = TypeVar("T")


class Connection:
    """Makes calls to the daemon of a target. May be used from any thread."""

    def __init__(self, target: DaemonTarget) -> None:
        self.target = target
        target.settle()
        self._lock = threading.Lock()
        self._route: Route | None = None
        self._retired: list[Route] = []
        self._is_closed = False
        self._was_reached = False
        self._of_parent: list[Route] = []
        self._abandoned: list[Route] = []
        _forks.renew_in_child(self)

    def begin_anew(self) -> None:
        """Opens channels of its own in a forked process: those of the parent may not be used, nor closed, there."""
        self._lock = threading.Lock()
        self._of_parent += [*self._retired, *filter(None, [self._route])]
        self._route, self._retired, self._was_reached = None, [], False

    @property
    def described(self) -> str:
        """Description of the UAV, its address, and whether its daemon has answered. Makes no call."""
        status = "closed" if self._is_closed else "connected" if self._was_reached else "not connected"
        return self.target.described(status)

    def note_answer(self) -> None:
        """Notes that the daemon has answered by a stream."""
        self._was_reached = True

    def run(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call and blocks until it is answered. An interruption (Ctrl-C) cancels the call.

        If the daemon answered before and cannot be reached now, waits for it (`ual._calls.RECONNECT_S`) and tries once
        more.

        Raises:
            DaemonUnreachableError: No daemon answers.
            UalTimeoutError: The daemon did not answer in time.
            UalError: The daemon refused the call, or it failed.
        """
        limit_s = _calls.deadline(call, timeout_s)
        try:
            return self._run_once(call, limit_s)
        except DaemonUnreachableError as error:
            if not (self._was_reached and rpc_errors.was_never_sent(error)):
                raise
            self._was_reached = False
            self._wait_until_back(error)
        return self._run_once(call, limit_s)

    def iterate(self, call: Call[T]) -> Iterator[T]:
        """Yields what each response of a stream is. Raises the `UalError` by which the stream ended."""
        with _calls.traced(call) as more:
            metadata = (*self.target.metadata, *more)
            stream = self._begin(lambda stubs: stubs.method(call)(call.request, metadata=metadata))
            try:
                for response in stream:
                    self._was_reached = True
                    yield call.read(response)
            except grpc.RpcError as error:
                raise self.error(error) from None
            finally:
                stream.cancel()

    def stream_telemetry(self, rate_hz: float) -> TelemetryStream:
        """Opens a stream of telemetry on a channel of its own. Raises `UalError` if the client is closed."""
        # Imported here because gRPC, too, imports it only with the first channel.
        from grpc.experimental import ChannelOptions

        address = self.target.address()
        if self._is_closed:
            raise _calls.closed()
        # The thread that reads waits on the socket itself, and is not woken by gRPC's polling thread:
        # docs/evidence/decisions/0016.
        channel = self.target.open_channel(grpc, address, ((ChannelOptions.SingleThreadedUnaryStream, 1),))
        return TelemetryStream(channel, self.target, address, rate_hz)

    def watch_task(self, task_id: str, rate_hz: float, timeout_s: float | None) -> Any:  # noqa: ANN401 (an iterator and a call: gRPC has no type for it)
        """Opens the stream of a task's progress: an iterator with `cancel`, which raises `grpc.RpcError`."""
        request = pb.WatchTaskRequest(task_id=task_id, rate_hz=rate_hz)
        return self._begin(lambda stubs: stubs.ual.WatchTask(request, timeout=timeout_s, metadata=self.target.metadata))

    def stream(self, method: str, elements: Iterator[Any], service: str = "UalService") -> Any:  # noqa: ANN401 (as above)
        """Sends elements until the iterator ends. Returns a future, which raises `grpc.RpcError`."""
        metadata = self.target.metadata
        return self._begin(lambda stubs: stubs.method_of(service, method).future(elements, metadata=metadata))

    def run_extension(
        self, make_stub: Callable[[grpc.Channel], Any], method: str, request: object, limit_s: float
    ) -> Any:  # noqa: ANN401 (the package's own)
        """Makes a call of an extension's service; see `ual.extension.Link.call`."""

        def invoke(channel: grpc.Channel) -> Any:  # noqa: ANN401
            call = getattr(make_stub(channel), method)
            return call(request, timeout=limit_s, metadata=self.target.metadata)

        try:
            return self._use_channel(invoke)
        except grpc.RpcError as error:
            raise self.error(error) from None

    def stream_extension(self, make_stub: Callable[[grpc.Channel], Any], method: str, request: object) -> Iterator[Any]:
        """Yields the responses of a stream of an extension's service; see `ual.extension.Link.stream`."""
        route = self._enter()
        try:
            call = getattr(make_stub(route.channel), method)(request, metadata=self.target.metadata)
            try:
                yield from call
            finally:
                call.cancel()
        except grpc.RpcError as error:
            raise self.error(error) from None
        finally:
            self._leave(route)

    def error(self, error: grpc.RpcError) -> UalError:
        """Converts the error that a call of this connection ended with."""
        if self._is_closed and error.code() is grpc.StatusCode.CANCELLED:
            return _calls.closed()
        route = self._route
        return rpc_errors.from_rpc_error(error, address="" if route is None else route.address, ns=self.target.ns)

    def close(self) -> None:
        """Ends all running calls and refuses new ones."""
        with self._lock:
            self._is_closed = True
            routes, self._retired = self._retired, []
            if self._route is not None:
                routes.append(self._route)
            self._route = None
        for route in routes:
            route.channel.close()
        self.target.close()

    def _run_once(self, call: Call[T], limit_s: float | None) -> T:
        with _calls.traced(call) as metadata:
            return self._answer(call, limit_s, (*self.target.metadata, *metadata))

    def _answer(self, call: Call[T], limit_s: float | None, metadata: Metadata) -> T:
        try:
            response = self._use(lambda stubs: self._invoke(stubs, call, limit_s, metadata))
        except grpc.RpcError as error:
            raise _calls.in_time(self.error(error), call, limit_s) from None
        except grpc.FutureCancelledError as error:
            raise _calls.closed() from error
        self._was_reached = True
        return call.read(response)

    def _invoke(self, stubs: Stubs, call: Call[T], limit_s: float | None, metadata: Metadata) -> Any:  # noqa: ANN401 (a response)
        method = stubs.method(call)
        if call.is_stream:
            return _all_of(method(call.request, timeout=limit_s, metadata=metadata))
        if call.quick_s is not None:
            return method(call.request, timeout=limit_s, metadata=metadata)
        # A future can be cancelled when Ctrl-C, or anything else, ends the wait for it, also while it begins.
        future = None
        try:
            with _interrupts.put_off():
                future = method.future(call.request, timeout=limit_s, metadata=metadata)
            return future.result()
        finally:
            if future is not None:
                future.cancel()

    def _use(self, use: Callable[[Stubs], T]) -> T:
        """Makes a call and holds its route until the call has returned."""
        route = self._enter()
        try:
            return self._call(use, route)
        finally:
            self._leave(route)

    def _use_channel(self, use: Callable[[grpc.Channel], T]) -> T:
        """The same, with the channel."""
        route = self._enter()
        try:
            return self._call(lambda _: use(route.channel), route)
        finally:
            self._leave(route)

    def _begin(self, begin: Callable[[Stubs], Any]) -> Any:  # noqa: ANN401 (a call: gRPC has no type for it)
        """Begins a call and holds its route until the call ends."""
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
            if self._is_closed:  # gRPC raises ValueError on a channel that was closed meanwhile
                raise _calls.closed() from error
            raise
        except KeyboardInterrupt:
            self.abandon()
            raise

    def abandon(self) -> None:
        """Uses a new channel from now on. Ctrl-C amid gRPC's own steps can leave its channel locked: nothing is
        received on it any more, and to close it would wait forever.
        """
        with self._lock:
            self._abandoned += filter(None, [self._route])
            self._route = None

    def _enter(self) -> Route:
        """Returns the route to where the daemon is now. Its channel stays open until `_leave`."""
        address = self.target.address()
        with self._lock:
            if self._is_closed:
                raise _calls.closed()
            route = self._route
            if route is None or address != route.address:
                if route is not None:
                    self._retired.append(route)
                channel = self.target.open_channel(grpc, address)
                self._route = route = Route(address, channel, Stubs(channel))
            route.call_count += 1
            unused = [each for each in self._retired if not each.call_count]
            self._retired = [each for each in self._retired if each.call_count]
        for each in unused:
            each.channel.close()
        return route

    def _leave(self, route: Route) -> None:
        # Does not close the channel: closing waits for gRPC's thread, and this may run on it. `_enter` closes it.
        with self._lock:
            route.call_count -= 1

    def _wait_until_back(self, unreachable: DaemonUnreachableError) -> None:
        """Waits for a daemon that answered before: it may be restarting, here or at another address, or gRPC may be
        pausing between two attempts to connect.
        """
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
                raise self.error(error) from None
            if self.target.address() == address:
                raise unreachable from None


def _all_of(responses: Any) -> list[Any]:  # noqa: ANN401 (an iterator and a call: gRPC has no type for it)
    """Returns all responses of a stream. It is cancelled where anything else ends the wait for it."""
    try:
        return list(responses)
    finally:
        responses.cancel()


class TelemetryStream:
    """One stream of telemetry. Only one thread at a time may read it; any thread may call `close`."""

    def __init__(self, channel: grpc.Channel, target: DaemonTarget, address: str, rate_hz: float) -> None:
        self._channel = channel
        self._target = target
        self._address = address
        self._is_closed = False
        self._call: Any = Stubs(channel).ual.StreamTelemetry(
            pb.StreamTelemetryRequest(rate_hz=rate_hz), metadata=target.metadata
        )

    def read(self) -> Generator[pb.StreamTelemetryResponse, None, None]:
        """Yields samples until the stream is closed. Raises the `UalError` by which the daemon or the connection ended
        it.
        """
        try:
            yield from self._call
        except grpc.RpcError as error:
            if self._is_closed:
                raise _calls.closed() from error
            raise rpc_errors.from_rpc_error(error, address=self._address, ns=self._target.ns) from None
        finally:
            self.close()
            with suppress(grpc.RpcError):  # gRPC frees what the call holds only once its end has been read
                for _ in self._call:
                    pass

    def close(self) -> None:
        """Ends the stream."""
        self._is_closed = True
        self._channel.close()  # not `cancel`: after that the reader would not read the end of the call
