"""gRPC's core without the layers of Python above it: one thread that waits for what comes, and calls back there.

The only module that knows the binding to the core (`grpc._cython.cygrpc`), which gRPC does not promise to keep:
docs/decisions/0017. Operations are those of ``grpc/grpc.h`` and follow its rules; of each kind one may be under way.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, TypeAlias

import grpc
import grpc._cython.cygrpc as cygrpc

Metadata: TypeAlias = Sequence[tuple[str, str | bytes]]

_log = logging.getLogger(__name__)

_NO_FLAGS = 0
_READ_S = 0.001
_END_S = 5.0
"""The thread ends at once, unless a call never ended: then the process does not wait for it."""


class Core:
    """The thread that waits for gRPC. Servers of one process share it; what it calls back must not block.

    With `gather_s` it looks only so often: where many UAVs are served, it would take Python's lock from the thread that
    sends to their readers after each message, to hear that it is out.
    """

    def __init__(self, gather_s: float = 0.0) -> None:
        self._gather_s = gather_s
        self.queue = cygrpc.CompletionQueue()
        self._thread = threading.Thread(target=self._run, name="gRPC", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Ends the thread, once its servers have stopped. Not from the thread itself."""
        self.queue.shutdown()
        self._thread.join(_END_S)
        if self._thread.is_alive():
            _log.warning("a call never ended; the thread that waits for gRPC is left behind")

    def _run(self) -> None:
        while True:
            event = None  # before it waits again: a call that an event holds keeps its server from ending
            try:
                event = self._next()
                if event.completion_type == cygrpc.CompletionType.queue_shutdown:
                    return
                event.tag(event)
            except Exception:  # noqa: BLE001  the thread serves everybody
                _log.exception("what gRPC called back failed; this is a defect of UAL, please report it")

    def _next(self) -> Any:  # noqa: ANN401  the binding's, as all events
        if self._gather_s:
            # With a deadline that has passed gRPC would read from one connection only, each time: pings of the others
            # would not be answered.
            event = self.queue.poll(time.time() + _READ_S)
            if event.completion_type != cygrpc.CompletionType.queue_timeout:
                return event
            time.sleep(self._gather_s)
        return self.queue.poll()


class CoreServer:
    """A server that hands each call to `take`, on the core's thread."""

    def __init__(self, core: Core, options: Sequence[tuple[str, int]], take: Callable[[Call], None]) -> None:
        self._queue = core.queue
        self._take = take
        self._server = cygrpc.Server(tuple(options), False)  # no xDS
        self._server.register_completion_queue(self._queue)
        # gRPC's server may not be destroyed while a thread is still in one of its functions.
        self._lock = threading.Lock()
        self._is_started = False
        self._stopped: Future[None] | None = None

    def listen(self, address: str, credentials: grpc.ServerCredentials | None = None) -> int:
        """Listens there; the port, where there is one. Raises RuntimeError."""
        if credentials is None:
            port: int = self._server.add_http2_port(address.encode())
        else:
            inner = credentials._credentials  # type: ignore[attr-defined]  # noqa: SLF001  as gRPC's own servers do
            port = self._server.add_http2_port(address.encode(), inner)
        if port == 0:
            raise RuntimeError(f"cannot listen on {address}")
        return port

    def start(self) -> None:
        """Begins to take calls."""
        with self._lock:
            self._server.start()
            self._is_started = True
            self._request()

    def stop(self) -> Future[None]:
        """Takes no more calls; the future ends when the last of those that were taken has ended."""
        with self._lock:
            if self._stopped is None:
                self._stopped = Future()
                if self._is_started:
                    self._server.shutdown(self._queue, self._on_stopped)
                else:
                    self._stopped.set_result(None)
            return self._stopped

    def cancel_calls(self) -> None:
        """Ends the calls that still run, after `stop`."""
        with self._lock:
            if self._stopped is not None and not self._stopped.done():
                self._server.cancel_all_calls()

    def _request(self) -> None:
        self._server.request_call(self._queue, self._queue, self._on_call)

    def _on_call(self, event: Any) -> None:  # noqa: ANN401  the binding's, as all events
        if not event.success:
            return  # the server stops
        try:
            self._take(Call(event))
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


class Call:
    """One call: what is received and sent in it. What its operations end with is told on the core's thread."""

    def __init__(self, event: Any) -> None:  # noqa: ANN401
        self._call = event.call
        self.method: str = event.call_details.method.decode(errors="replace")
        """``/package.Service/Method``."""
        self.metadata: Metadata = event.invocation_metadata or ()
        self._peer = ""
        self._lock = threading.Lock()
        self._has_begun = False
        self.is_finished = False
        """Whether an end was sent."""
        self._is_watched = False
        self._end: Callable[[], object] = _nothing
        self.is_cancelled = False
        """Whether the caller has given up, or vanished, or his deadline passed; see `watch`."""

    def peer(self) -> str:
        """Who calls. To be asked once before the call ends: then gRPC forgets it."""
        if not self._peer:
            self._peer = self._call.peer().decode(errors="replace")
        return self._peer

    def watch(self, on_cancel: Callable[[], object]) -> None:
        """Calls back once it is cancelled. To be called once, and only where the call may take a while."""
        self._end = on_cancel
        self._is_watched = True
        self._start((cygrpc.ReceiveCloseOnServerOperation(_NO_FLAGS),), self._on_close)

    def receive(self, then: Callable[[bytes | None], object]) -> None:
        """The next message of the caller; None when there is no more."""

        def received(event: Any) -> None:  # noqa: ANN401
            then(event.batch_operations[0].message())

        self._start((cygrpc.ReceiveMessageOperation(_NO_FLAGS),), received)

    def begin(self) -> None:
        """Sends the initial metadata at once, and not with the first message."""
        self._start(self._beginning(), _ignore)

    def send(self, message: bytes, then: Callable[[bool], object]) -> None:
        """Sends a message; tells whether it went out, after which another may be sent. Nothing once it is finished."""

        def sent(event: Any) -> None:  # noqa: ANN401
            then(event.success)

        if not self.is_finished:
            self._start((*self._beginning(), cygrpc.SendMessageOperation(message, _NO_FLAGS)), sent)

    def finish(
        self,
        message: bytes | None = None,
        code: grpc.StatusCode = grpc.StatusCode.OK,
        details: str = "",
        metadata: Metadata = (),
    ) -> None:
        """Ends it, with a last message or with an error. Only the first that ends it counts."""
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
        if not self._is_watched:  # each call must hear of its end, else gRPC takes it for given up
            operations.append(cygrpc.ReceiveCloseOnServerOperation(_NO_FLAGS))
        error = None
        try:
            error = self._call.start_server_batch(operations, _ignore)
        finally:
            if error != cygrpc.CallError.ok:  # the caller must hear of an end
                _log.error("%s: its end could not be sent (grpc_call_error %s)", self.method, error)
                self._call.cancel()

    def _beginning(self) -> tuple[Any, ...]:
        with self._lock:
            if self._has_begun:
                return ()
            self._has_begun = True
        return (cygrpc.SendInitialMetadataOperation((), _NO_FLAGS),)

    def _on_close(self, event: Any) -> None:  # noqa: ANN401
        end, self._end = self._end, _nothing
        if event.batch_operations[0].cancelled():
            self.is_cancelled = True
            end()

    def _start(self, operations: Sequence[Any], then: Callable[[Any], None]) -> None:
        error = self._call.start_server_batch(operations, then)
        if error != cygrpc.CallError.ok and not self.is_finished:
            raise RuntimeError(f"{self.method}: gRPC refuses an operation (grpc_call_error {error})")


def _nothing() -> None:
    pass


def _ignore(_: Any) -> None:  # noqa: ANN401
    pass
