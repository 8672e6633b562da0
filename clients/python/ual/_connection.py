"""The client's channel to its daemon: opened when first needed, and again where the daemon moved."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import grpc

from ual import _calls, rpc_errors
from ual._calls import Call
from ual._target import CHANNEL_OPTIONS, Stubs, Target
from ual.errors import DaemonUnreachableError, UalError
from ual.v1 import ual_pb2 as pb

T = TypeVar("T")


class Connection:
    """Makes calls to the daemon of a target. May be used from any thread."""

    def __init__(self, target: Target) -> None:
        self.target = target
        self._lock = threading.Lock()
        self._channel: grpc.Channel | None = None
        self._stubs: Stubs | None = None
        self._address = ""
        self._is_closed = False
        self._was_reached = False

    def run(self, call: Call[T], timeout_s: float | None = None) -> T:
        """Makes a call and waits for its answer. A call that is interrupted (Ctrl-C) is cancelled."""
        limit_s = _calls.deadline(call, timeout_s)
        try:
            return self._run_once(call, limit_s)
        except DaemonUnreachableError as error:
            if not (self._was_reached and rpc_errors.was_never_sent(error)):
                raise
            self._was_reached = False
            self._wait_until_back(error)
        return self._run_once(call, limit_s)

    def stream_telemetry(self, rate_hz: float) -> Any:  # noqa: ANN401 (an iterator and a call: gRPC has no type for it)
        """The stream of telemetry: an iterator with `cancel`, which raises `grpc.RpcError`."""
        request = pb.StreamTelemetryRequest(rate_hz=rate_hz)
        return self._use(lambda stubs: stubs.ual.StreamTelemetry(request, metadata=self.target.metadata))

    def watch_task(self, task_id: str, rate_hz: float, timeout_s: float | None) -> Any:  # noqa: ANN401 (as above)
        """The stream of a task's progress: as `stream_telemetry`."""
        request = pb.WatchTaskRequest(task_id=task_id, rate_hz=rate_hz)
        return self._use(lambda stubs: stubs.ual.WatchTask(request, timeout=timeout_s, metadata=self.target.metadata))

    def stream_setpoints(self, setpoints: Iterator[pb.StreamSetpointsRequest]) -> Any:  # noqa: ANN401 (as above)
        """Sends setpoints until the iterator ends: a future, which raises `grpc.RpcError`."""
        return self._use(lambda stubs: stubs.ual.StreamSetpoints.future(setpoints, metadata=self.target.metadata))

    def error(self, error: grpc.RpcError) -> UalError:
        """What a call of this connection ended with."""
        return rpc_errors.from_rpc_error(error, address=self._address, ns=self.target.ns)

    def close(self) -> None:
        """Ends every call that runs, and refuses new ones."""
        with self._lock:
            self._is_closed = True
            channel, self._channel, self._stubs = self._channel, None, None
        if channel is not None:
            channel.close()

    def _run_once(self, call: Call[T], limit_s: float | None) -> T:
        try:
            response = self._use(lambda stubs: self._invoke(stubs, call, limit_s))
        except grpc.RpcError as error:
            raise _calls.in_time(self.error(error), call, limit_s) from error
        except grpc.FutureCancelledError as error:
            raise _closed() from error
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
        while True:
            stubs = self._open()
            try:
                return use(stubs)
            except ValueError:
                # gRPC's answer on a channel that was closed meanwhile: the daemon moved, or the client was closed.
                if stubs is self._stubs:
                    raise

    def _open(self) -> Stubs:
        address = self.target.address()
        retired = None
        with self._lock:
            if self._is_closed:
                raise _closed()
            if self._stubs is None or address != self._address:
                retired, self._channel, self._address = self._channel, self._make_channel(address), address
                self._stubs = Stubs(self._channel)
            stubs = self._stubs
        if retired is not None:
            retired.close()
        return stubs

    def _make_channel(self, address: str) -> grpc.Channel:
        if self.target.credentials is None:
            return grpc.insecure_channel(address, CHANNEL_OPTIONS)
        return grpc.secure_channel(address, self.target.credentials, CHANNEL_OPTIONS)

    def _wait_until_back(self, unreachable: DaemonUnreachableError) -> None:
        """Waits for a daemon that was there before: it may be starting again, or gRPC pausing before it looks."""
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
            if error.code() in (grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.UNAVAILABLE):
                raise unreachable from error
            raise self.error(error) from error


def _closed() -> UalError:
    return UalError("this client is closed")
