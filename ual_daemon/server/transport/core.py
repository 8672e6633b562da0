"""The transport on gRPC's core, without the layers of Python above it: one thread waits for events and calls back.

The only module that uses the binding to the core (`grpc._cython.cygrpc`), which gRPC does not promise to keep:
Decision 17. Operations are those of ``grpc/grpc.h`` and follow its rules; of each kind one may be in progress.
"""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

import grpc
import grpc._cython.cygrpc as cygrpc
from typing_extensions import override

from ual_daemon.server.transport.base import (
    MakeCredentials,
    Metadata,
    Options,
    ServedCall,
    Transport,
    TransportServer,
    name_of_certificate,
)
from ual_daemon.server.transport.listening import Deferral
from ual_daemon.server.waiting import completion

_log = logging.getLogger(__name__)

_NO_FLAGS = 0
_READ_S = 0.001
_RETRY_S = 0.1
"""After an error of the queue itself, which may come again at once."""
_THREAD_END_S = 5.0
"""Seconds for which `close` waits for the thread. It ends at once, unless a call never ended."""


def _log_defect(error: Exception) -> None:
    _log.error("gRPC's core failed; this is a defect of UAL, please report it", exc_info=error)


class CoreTransport(Transport):
    """The thread that waits for gRPC's events. `on_defect` gets what a callback raises, and what gRPC cannot do.

    With `gather_s` it looks for events only that often. Where many UAVs are served, it would otherwise take Python's
    lock after each message that went out, from the thread that sends the next one.
    """

    name = "core"
    is_on_loop = False

    def __init__(self, gather_s: float = 0.0, on_defect: Callable[[Exception], None] = _log_defect) -> None:
        self._gather_s = gather_s
        self._on_defect = on_defect
        self._is_ending = False
        self._queue = cygrpc.CompletionQueue()
        self._deferral = Deferral()
        self._thread = threading.Thread(target=self._run, name="gRPC", daemon=True)
        self._thread.start()

    @override
    def server(self, options: Options, take: Callable[[ServedCall], None]) -> CoreServer:
        return CoreServer(self._queue, options, take, self._on_defect, self._deferral)

    @override
    def close(self) -> None:
        if not self.end(_THREAD_END_S):
            _log.warning("a call never ended; the thread that waits for gRPC is left behind")

    def end(self, limit_s: float) -> bool:
        """Ends the thread. Returns whether it has ended within the limit."""
        self._is_ending = True
        self._queue.shutdown()
        self._thread.join(limit_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while True:
            event = None  # before it waits again: a call that an event holds keeps its server from ending
            try:
                event = self._next()
                if event.completion_type == cygrpc.CompletionType.queue_shutdown:
                    return
            except Exception as error:  # noqa: BLE001
                self._on_defect(error)
                # A queue that is freed before its end blocks the thread that frees it: this thread keeps it.
                threading.Event().wait(None if self._is_ending else _RETRY_S)
                continue
            try:
                event.tag(event)
            except Exception as error:  # noqa: BLE001  the thread serves everybody
                self._on_defect(error)

    def _next(self) -> Any:  # noqa: ANN401  the binding's, as all events
        if self._gather_s:
            # With a deadline that has passed gRPC would read from one connection only, each time: pings of the others
            # would not be answered.
            event = self._queue.poll(time.time() + _READ_S)
            if event.completion_type != cygrpc.CompletionType.queue_timeout:
                return event
            time.sleep(self._gather_s)
        return self._queue.poll()


class CoreServer(TransportServer):
    """A server that hands each call to `take`, on the transport's thread."""

    def __init__(
        self,
        queue: Any,  # noqa: ANN401
        options: Options,
        take: Callable[[ServedCall], None],
        on_defect: Callable[[Exception], None],
        deferral: Deferral,
    ) -> None:
        self._queue = queue
        self._deferral = deferral
        self._take = take
        self._on_defect = on_defect
        self._server = cygrpc.Server(tuple(options), False)  # no xDS
        self._server.register_completion_queue(self._queue)
        # gRPC's server may not be destroyed while a thread is still in one of its functions.
        self._lock = threading.Lock()
        self._is_started = False
        self._stopped: Future[None] | None = None

    @override
    def listen(self, address: str, credentials: MakeCredentials | None = None) -> int:
        if credentials is None:
            port: int = self._server.add_http2_port(address.encode())
        else:
            inner = credentials()._credentials  # type: ignore[attr-defined]  # noqa: SLF001  as gRPC's own servers do
            port = self._server.add_http2_port(address.encode(), inner)
        if port == 0:
            raise RuntimeError("gRPC cannot open it; with GRPC_VERBOSITY=debug it prints why")
        self._deferral.add(address, port)
        return port

    @override
    async def start(self) -> None:
        self._deferral.apply()
        with self._lock:
            self._server.start()
            self._is_started = True
            self._request()

    @override
    async def stop(self, grace_s: float) -> bool:
        stopped = completion(self._shut_down())
        await asyncio.wait((stopped,), timeout=grace_s)
        if not stopped.done():
            self._cancel_calls()
            await asyncio.wait((stopped,), timeout=grace_s)
        return stopped.done()

    def _shut_down(self) -> Future[None]:
        """Takes no more calls; the future is done when the last of those that were taken has ended."""
        with self._lock:
            if self._stopped is None:
                self._stopped = Future()
                if self._is_started:
                    self._server.shutdown(self._queue, self._on_stopped)
                else:
                    self._stopped.set_result(None)
            return self._stopped

    def _cancel_calls(self) -> None:
        with self._lock:
            if self._stopped is not None and not self._stopped.done():
                self._server.cancel_all_calls()

    def _request(self) -> None:
        self._server.request_call(self._queue, self._queue, self._on_call)

    def _on_call(self, event: Any) -> None:  # noqa: ANN401  the binding's, as all events
        if not event.success:
            return  # the server stops
        try:
            self._take(CoreCall(event, self._on_defect))
        finally:
            with self._lock:
                if self._stopped is None:
                    self._request()

    def _on_stopped(self, _: Any) -> None:  # noqa: ANN401
        with self._lock:
            self._server.destroy()
            stopped = self._stopped
        assert stopped is not None
        stopped.set_result(None)


class CoreCall(ServedCall):
    """One call of the core. Its callbacks come on the transport's thread."""

    def __init__(self, event: Any, on_defect: Callable[[Exception], None]) -> None:  # noqa: ANN401
        self._call = event.call
        self._on_defect = on_defect
        self.method = event.call_details.method.decode(errors="replace")
        self.metadata = event.invocation_metadata or ()
        self.is_finished = False
        self.is_cancelled = False
        self._peer = ""
        self._lock = threading.Lock()
        self._has_begun = False
        self._is_watched = False
        self._on_cancel: Callable[[], object] = _nothing

    @override
    def peer(self) -> str:
        if not self._peer:
            self._peer = self._call.peer().decode(errors="replace")
        return self._peer

    @override
    def certificate_name(self) -> str | None:
        return name_of_certificate({key.decode(): values for key, values in cygrpc.auth_context(self._call).items()})

    @override
    def watch(self, on_cancel: Callable[[], object]) -> None:
        self._on_cancel = on_cancel
        self._is_watched = True
        self._start((cygrpc.ReceiveCloseOnServerOperation(_NO_FLAGS),), self._on_close)

    @override
    def receive(self, then: Callable[[bytes | None], object]) -> None:
        def on_received(event: Any) -> None:  # noqa: ANN401
            then(event.batch_operations[0].message())

        self._start((cygrpc.ReceiveMessageOperation(_NO_FLAGS),), on_received)

    @override
    def begin(self) -> None:
        self._start(self._beginning(), _ignore)

    @override
    def send(self, message: bytes, then: Callable[[bool], object]) -> None:
        def on_sent(event: Any) -> None:  # noqa: ANN401
            then(event.success)

        if not self.is_finished:
            self._start((*self._beginning(), cygrpc.SendMessageOperation(message, _NO_FLAGS)), on_sent)

    @override
    def finish(
        self,
        message: bytes | None = None,
        code: grpc.StatusCode = grpc.StatusCode.OK,
        details: str = "",
        metadata: Metadata = (),
    ) -> None:
        with self._lock:
            if self.is_finished:
                return
            self.is_finished = True
        operations = [*self._beginning()]
        if message is not None:
            operations.append(cygrpc.SendMessageOperation(message, _NO_FLAGS))
        status: int = code.value[0]
        text = details.encode(errors="replace")
        operations.append(cygrpc.SendStatusFromServerOperation(metadata, status, text, _NO_FLAGS))
        if not self._is_watched:  # each call must receive its close, else gRPC counts it as cancelled
            operations.append(cygrpc.ReceiveCloseOnServerOperation(_NO_FLAGS))
        error = None
        try:
            error = self._call.start_server_batch(operations, _ignore)
        finally:
            if error != cygrpc.CallError.ok:  # without a status the caller would wait for ever
                self._on_defect(RuntimeError(f"{self.method}: its end cannot be sent (grpc_call_error {error})"))
                self._call.cancel()

    def _beginning(self) -> tuple[Any, ...]:
        with self._lock:
            if self._has_begun:
                return ()
            self._has_begun = True
        return (cygrpc.SendInitialMetadataOperation((), _NO_FLAGS),)

    def _on_close(self, event: Any) -> None:  # noqa: ANN401
        on_cancel, self._on_cancel = self._on_cancel, _nothing
        if event.batch_operations[0].cancelled():
            self.is_cancelled = True
            on_cancel()

    def _start(self, operations: Sequence[Any], then: Callable[[Any], None]) -> None:
        error = self._call.start_server_batch(operations, then)
        if error != cygrpc.CallError.ok and not self.is_finished:
            raise RuntimeError(f"{self.method}: gRPC refuses an operation (grpc_call_error {error})")


def _nothing() -> None:
    pass


def _ignore(_: Any) -> None:  # noqa: ANN401
    pass
