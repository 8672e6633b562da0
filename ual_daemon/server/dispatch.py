"""Dispatch of one call, which depends on how the servicer's method is written.

- ``def`` of a request, or a generator into which each request of a stream is sent. It runs on the transport's thread,
  in the order of the calls, and must not block. This is the fast way: no other thread has to wake. If it begins
  something that ends later, it returns a coroutine, which the event loop awaits.
- ``def`` with a stream of responses: it sends by the `ServedCall`, from any thread. It returns a function that ends
that.
- An asynchronous generator: it runs on the event loop.

Each gets the `ServedCall` as its context, with the lease by which its caller commands (`extensions.base.lease_of`).
"""

from __future__ import annotations

import asyncio
import inspect
import logging
from collections.abc import AsyncIterator, Callable, Coroutine, Generator
from contextlib import aclosing
from functools import partial
from typing import Any, Final, Protocol, TypeAlias, TypeVar, cast

import grpc
from google.protobuf.message import DecodeError, Message
from typing_extensions import override

from ual.contract.methods import METHODS
from ual.errors import InvalidArgumentError, TaskAbortedError, UalError
from ual.wire import rpc_errors
from ual_daemon import logs
from ual_daemon.flight.policy.lease import NOBODY
from ual_daemon.server.access.caller import Caller
from ual_daemon.server.door import has_lists, paths_to_times, require_few, require_times
from ual_daemon.server.headroom import SMALL_REQUEST_BYTES, Headroom
from ual_daemon.server.motion_gate import FLIES, MotionGate
from ual_daemon.server.standstill import MOVES, Standstill
from ual_daemon.server.transport.base import ServedCall

T = TypeVar("T")
Handler: TypeAlias = "grpc.RpcMethodHandler[Any, Any]"

_log = logging.getLogger(__name__)

SHUTTING_DOWN = "the daemon is shutting down"
LEASE_KEY = "ual-lease"
_NEVER_LATE: Final = MOVES | {METHODS["AcquireLease"].path}
"""Methods that do nothing for a caller that has given up. A new lease aborts what is in progress."""


class StatusError(Exception):
    """Ends a call with a status of gRPC, where our contract has no error for it."""

    def __init__(self, code: grpc.StatusCode, details: str) -> None:
        super().__init__(details)
        self.code = code


class ServedMethod:
    """A method of a service, and how it is answered."""

    def __init__(self, handler: Handler) -> None:
        # Generated code gives all three; gRPC's types do not know that.
        self.decode = cast("Callable[[bytes], Any]", handler.request_deserializer)
        # What decodes is a method of the request's class; an extension may have another one.
        kind = getattr(self.decode, "__self__", None)
        is_message = isinstance(kind, type) and issubclass(kind, Message)
        self.times = paths_to_times(cast("Any", kind).DESCRIPTOR) if is_message else ()
        self.has_lists = is_message and has_lists(cast("Any", kind).DESCRIPTOR)
        self.encode = cast("Callable[[Any], bytes]", handler.response_serializer)
        self.serve = cast(
            "Callable[[Any, Any], Any]",
            handler.unary_unary or handler.unary_stream or handler.stream_unary or handler.stream_stream,
        )
        # What a servicer does not override is in generated code, which needs a context of gRPC to say so.
        self.is_generated: bool = self.serve.__module__.endswith("_pb2_grpc")
        self.has_request_stream: bool = handler.request_streaming
        self.has_response_stream: bool = handler.response_streaming
        self.kind: type[CallAnswer]
        if inspect.isasyncgenfunction(self.serve):
            self.kind = _GeneratorAnswer
        elif self.has_request_stream:
            self.kind = _RequestStreamAnswer
        else:
            self.kind = _PushAnswer if self.has_response_stream else _UnaryAnswer


class Register(Protocol):
    """Registry of the answers in progress (`ual_daemon.server.calls.Calls`)."""

    standstill: Standstill
    motion_gate: MotionGate | None
    headroom: Headroom

    def join(self, answer: CallAnswer) -> None:
        """Adds an answer that is in progress. Raises `ResourceExhaustedError` where there are too many."""
        ...

    def leave(self, answer: CallAnswer) -> None:
        """Removes an answer that has ended."""
        ...

    def await_request(self, answer: CallAnswer) -> None:
        """Adds an answer whose request has to come yet."""
        ...

    def has_request(self, answer: CallAnswer) -> None:
        """Removes an answer whose request has come, or will not come any more."""
        ...

    def require_room(self, method: str, who: Caller) -> None:
        """Raises `ResourceExhaustedError` where too many calls of the method are in progress for the caller."""
        ...

    def require_accepted(self, call: ServedCall) -> None:
        """Raises the error by which a call is refused before its request is read."""
        ...

    def on_failure(self, reason: str) -> None:
        """Counts a call that is refused or has failed."""
        ...

    def set_context(self, call: ServedCall | None, who: Caller | None) -> None:
        """Sets the caller for what this thread or task does from now on."""
        ...

    def on_loop(self, callback: Callable[..., object], *arguments: object) -> bool:
        """Calls it on the event loop, soon. Returns False if that is closed."""
        ...


class CallAnswer:
    """One call that is being answered."""

    def __init__(self, calls: Register, method: ServedMethod, call: ServedCall, caller: Caller) -> None:
        self.caller = caller
        call.lease_id = next((str(value) for key, value in call.metadata if key == LEASE_KEY), NOBODY)
        self.is_stream = method.has_request_stream or method.has_response_stream
        self.method_name = call.method
        self._calls = calls
        self._method = method
        self._standstill = calls.standstill if call.method in MOVES else None
        self._motion_gate = calls.motion_gate if call.method in FLIES else None
        self.call = call

    def begin(self) -> None:
        """Begins, on the transport's thread."""
        if self._method.has_response_stream:
            # Now, and not with the first message: so the caller knows that it is connected.
            self.call.begin()
        self._do(self._begin)

    def end(self, why: UalError | None = None) -> None:
        """Ends it, and what it does for its caller, by an error; without one because the daemon shuts down."""
        self.fail(why or self._shutdown())

    def _do(self, step: Callable[..., None], *arguments: object) -> None:
        """Does a step, on the transport's thread. An error ends the call."""
        self._calls.set_context(self.call, self.caller)
        try:
            step(*arguments)
        except Exception as error:  # noqa: BLE001  whatever a call does, the server goes on
            self.fail(error)
        finally:
            self._calls.set_context(None, None)  # the thread must not keep the call alive

    def _begin(self) -> None:
        self._calls.require_accepted(self.call)
        self._calls.await_request(self)
        self.call.receive(partial(self._do, self._receive))

    def _receive(self, message: bytes | None) -> None:
        self._calls.has_request(self)
        if self.call.is_finished or self.call.is_cancelled:  # it came too late
            return
        if message is None:
            raise StatusError(grpc.StatusCode.UNIMPLEMENTED, f"{self.call.method} takes one request")
        self._answer(self._decoded(message))

    def _answer(self, request: object) -> None:
        raise NotImplementedError

    def _decoded(self, message: bytes) -> Any:  # noqa: ANN401  each method has its own
        if self._standstill is not None:
            self._standstill.require_running(self.method_name)
        if self._motion_gate is not None:
            self._motion_gate.require_open(self.method_name)
        if len(message) > SMALL_REQUEST_BYTES:
            self._calls.headroom.require_room_to_work(self.method_name, len(message))
        try:
            request = self._method.decode(message)
        except DecodeError as error:
            raise InvalidArgumentError(f"{self.call.method}: no such message: {error}") from None
        if self._method.has_lists:
            require_few(request)
        if self._method.times:
            require_times(request, self._method.times)
        return request

    def _shutdown(self) -> Exception:
        if self.is_stream:
            return StatusError(grpc.StatusCode.UNAVAILABLE, SHUTTING_DOWN)
        return TaskAbortedError(SHUTTING_DOWN, {"by": "shutdown"})

    def fail(self, error: BaseException) -> None:
        """Ends it with an error."""
        self._calls.leave(self)
        if isinstance(error, StatusError):
            self._count_failure(error.code.name)
            self.call.finish(code=error.code, details=str(error))
            return
        if isinstance(error, UalError):
            # The vehicle logs what it refuses; this is for what is refused before.
            logs.event(_log, logging.DEBUG, "call_failed", method=self.call.method, reason=error.reason, why=error)
        else:
            _log.error("%s failed unexpectedly", self.call.method, exc_info=error)
            error = UalError(f"internal error, see the daemon's log: {type(error).__name__}: {error}")
        self._count_failure(error.reason)
        status = rpc_errors.to_grpc_status(error)
        self.call.finish(None, status.code, status.details, status.trailing_metadata)

    def _count_failure(self, reason: str) -> None:
        if not self.call.is_finished:  # else it has ended in another way before
            self._calls.on_failure(reason)


class _LoopAnswer(CallAnswer):
    """An answer that waits, or all of it, on the event loop."""

    _task: asyncio.Task[bytes | None] | None = None
    _has_begun = _is_watched = False
    _is_to_cancel = False
    _ended_by: UalError | None = None

    @override
    def end(self, why: UalError | None = None) -> None:
        if self._task is None:
            super().end(why)
        else:
            self._ended_by = why
            self._cancel()

    def _watch(self) -> None:
        """From here on the call may be cancelled, or ended by a shutdown."""
        self._calls.join(self)
        if not self._is_watched:
            self._watch_caller()

    def _watch_caller(self) -> None:
        self._is_watched = True
        self.call.watch(lambda: self._calls.on_loop(self._cancel))

    def _go_on(self, coroutine: Coroutine[Any, Any, bytes | None]) -> None:
        """Awaits it on the loop, and ends the call with its result."""
        if not self._calls.on_loop(self._start, coroutine):
            coroutine.close()

    def _start(self, coroutine: Coroutine[Any, Any, bytes | None]) -> None:
        self._task = asyncio.create_task(self._serve(coroutine))
        self._task.add_done_callback(self._on_end)
        if self.call.is_finished or self.call.is_cancelled:  # in the meantime
            self._cancel()

    async def _serve(self, coroutine: Coroutine[Any, Any, bytes | None]) -> bytes | None:
        self._calls.set_context(self.call, self.caller)
        self._has_begun = True
        if self._is_to_cancel:
            self._cancel()
        return await coroutine

    def _cancel(self) -> None:
        """Cancels the task, once it has begun: before that it could not undo what was begun for it."""
        self._is_to_cancel = True
        if self._task is not None and self._has_begun:
            self._task.cancel()

    def _on_end(self, task: asyncio.Task[bytes | None]) -> None:
        self._calls.leave(self)
        if task.cancelled():
            if not self.call.is_cancelled:
                self.fail(self._ended_by or self._shutdown())
            return
        error = task.exception()
        if error is None:
            self.call.finish(task.result())
        else:
            self.fail(error)


class _UnaryAnswer(_LoopAnswer):
    """One response to one request: at once, or when the coroutine that the method returned has ended."""

    @override
    def _begin(self) -> None:
        if self.call.method in _NEVER_LATE:
            # Before its request is read: where this thread was held up, its caller may have given up meanwhile, and
            # nothing moves by it.
            self._watch_caller()
        super()._begin()

    @override
    def _answer(self, request: object) -> None:
        self._calls.require_room(self.call.method, self.caller)  # before anything begins
        response = self._method.serve(request, self.call)
        if inspect.iscoroutine(response):
            self._watch()
            self._go_on(self._encoded(response))
        else:
            self.call.finish(self._method.encode(response))

    async def _encoded(self, response: Coroutine[Any, Any, Any]) -> bytes:
        return self._method.encode(await response)


class _GeneratorAnswer(_LoopAnswer):
    """The responses of an asynchronous generator."""

    @override
    def _begin(self) -> None:
        self._watch()
        if self._method.has_request_stream:
            self._calls.require_accepted(self.call)
            self._answer(self._requests())
        else:
            super()._begin()

    @override
    def _answer(self, request: object) -> None:
        self._go_on(self._send(request))

    async def _send(self, request: object) -> None:
        async with aclosing(self._method.serve(request, self.call)) as responses:
            async for response in responses:
                await self._until(partial(self.call.send, self._method.encode(response)))

    async def _requests(self) -> AsyncIterator[Any]:
        while (message := await self._until(self.call.receive)) is not None:
            yield self._decoded(message)

    async def _until(self, start: Callable[[Callable[[T], object]], None]) -> T:
        """Waits for an operation of the call. Returns its result."""
        ended: asyncio.Future[T] = asyncio.get_running_loop().create_future()

        def set_result(result: T) -> None:
            if not ended.done():
                ended.set_result(result)

        start(lambda result: self._calls.on_loop(set_result, result))
        return await ended


class _RequestStreamAnswer(CallAnswer):
    """One response to a stream of requests, each of which is processed on the transport's thread."""

    @override
    def _begin(self) -> None:
        self._calls.join(self)
        self.call.watch(_nothing)  # see `_UnaryAnswer`
        self._requests: Generator[None, Any, Any] = self._method.serve(None, self.call)
        next(self._requests)
        self._calls.require_accepted(self.call)
        self.call.receive(partial(self._do, self._receive))

    @override
    def _receive(self, message: bytes | None) -> None:
        if self.call.is_finished:  # by a shutdown: requests that still arrive are ignored
            return
        try:
            if message is None or not self.call.is_cancelled:
                self._requests.send(None if message is None else self._decoded(message))
        except StopIteration as ended:
            self._calls.leave(self)
            self.call.finish(self._method.encode(ended.value))
        else:
            self.call.receive(partial(self._do, self._receive))


class _PushAnswer(CallAnswer):
    """A stream of responses that other threads send."""

    _stop: Callable[[], None] | None = None

    @override
    def _begin(self) -> None:
        self._calls.join(self)
        self.call.watch(self._on_cancel)
        super()._begin()

    @override
    def _answer(self, request: object) -> None:
        self._stop = self._method.serve(request, self.call)
        if self.call.is_cancelled or self.call.is_finished:  # in the meantime
            self._stop()

    @override
    def end(self, why: UalError | None = None) -> None:
        super().end(why)
        if self._stop is not None:
            self._stop()

    def _on_cancel(self) -> None:
        self._calls.leave(self)
        if self._stop is not None:
            self._stop()


def _nothing() -> None:
    pass
