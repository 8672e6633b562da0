"""What is the same for every call: who calls, for which UAV, how errors go out, and how calls end at shutdown."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import aclosing
from functools import partial
from typing import Any, TypeAlias, cast

import grpc

from ual import rpc_errors
from ual.errors import InvalidArgumentError, TaskAbortedError, UalError
from ual_daemon import logs

_Handler: TypeAlias = "grpc.RpcMethodHandler[Any, Any]"
_Context: TypeAlias = "grpc.aio.ServicerContext[Any, Any]"
_Serve: TypeAlias = Callable[[Any, _Context], Awaitable[Any]]

_log = logging.getLogger(__name__)

_KINDS: Mapping[tuple[bool, bool], tuple[str, Any]] = {
    (False, False): ("unary_unary", grpc.unary_unary_rpc_method_handler),
    (False, True): ("unary_stream", grpc.unary_stream_rpc_method_handler),
    (True, False): ("stream_unary", grpc.stream_unary_rpc_method_handler),
    (True, True): ("stream_stream", grpc.stream_stream_rpc_method_handler),
}
"""By whether a stream asks and whether a stream answers: where a handler has its method, and what makes a handler."""

NAMESPACE_KEY = "ual-ns"
SHUTTING_DOWN = "the daemon is shutting down"


class Calls:
    """Stands before every call of what is registered with `before`.

    `log_name` is what the log calls the UAV. `shutdown_refuses` are the beginnings of the methods that are refused once
    the shutdown has begun.
    """

    def __init__(self, ns: str, shutdown_refuses: tuple[str, ...], log_name: str = "") -> None:
        self._ns = ns
        self._log_name = log_name
        self._shutdown_refuses = shutdown_refuses
        self._is_shutting_down = False
        self._streams: set[asyncio.Task[Any]] = set()
        self._unary: set[asyncio.Task[Any]] = set()

    def before(self, server: grpc.aio.Server) -> grpc.aio.Server:
        """The server, for what is registered with it (``add_..._to_server``) to be called by way of this.

        Not an interceptor of gRPC, which would have to wrap each method anew for each call.
        """
        return cast("grpc.aio.Server", _Registry(server, self))

    def begin_shutdown(self) -> None:
        """Ends the streams, and refuses new calls that fly."""
        self._is_shutting_down = True
        for task in self._streams:
            task.cancel()

    def end_waiting(self) -> None:
        """Ends the calls that still wait for something."""
        for task in self._unary:
            task.cancel()

    def wrapped(self, method: str, handler: _Handler) -> _Handler:
        """The handler of a method (``/package.Service/Method``), with this before it."""
        is_answered_by_stream = handler.response_streaming
        running = self._streams if handler.request_streaming or is_answered_by_stream else self._unary
        kind, make = _KINDS[handler.request_streaming, is_answered_by_stream]
        serve: _Serve = getattr(handler, kind)
        if is_answered_by_stream:
            serve = partial(_respond, serve)

        async def call(request: Any, context: _Context) -> Any:  # noqa: ANN401  each method has its own
            if is_answered_by_stream:
                # Now, and not with the first message, and before a shutdown can end this call: gRPC would send it once
                # more where it is interrupted, and the caller would never hear of the end.
                await context.send_initial_metadata(())
            return await self._call(method, serve, running, request, context)

        wrapped: _Handler = make(call, handler.request_deserializer, handler.response_serializer)
        return wrapped

    async def _call(
        self, method: str, serve: _Serve, running: set[asyncio.Task[Any]], request: object, context: _Context
    ) -> object:
        logs.caller.set(context.peer())
        if self._log_name:
            logs.uav.set(self._log_name)
        task = asyncio.current_task()
        assert task is not None
        running.add(task)
        try:
            if self._is_shutting_down and method.startswith(self._shutdown_refuses):
                await context.abort(grpc.StatusCode.UNAVAILABLE, SHUTTING_DOWN)
            self._require_ns(context)
            return await serve(request, context)
        except UalError as error:
            # The vehicle has logged what it refused; this is for what did not come so far.
            logs.event(_log, logging.DEBUG, "call_failed", method=method, reason=error.reason, why=error)
            await _abort(context, error)
        except asyncio.CancelledError:
            if not self._is_shutting_down or context.cancelled():
                raise
            if running is self._streams:
                await context.abort(grpc.StatusCode.UNAVAILABLE, SHUTTING_DOWN)
            await _abort(context, TaskAbortedError(SHUTTING_DOWN, {"by": "shutdown"}))
        except grpc.aio.AbortError:
            raise
        except grpc.aio.InternalError as error:  # a message that could not be sent: the caller is gone
            logs.event(_log, logging.DEBUG, "caller_gone", method=method, why=error)
        except Exception as error:  # noqa: BLE001  whatever a call does, the server goes on
            _log.exception("%s failed unexpectedly", method)
            await _abort(context, UalError(f"internal error, see the daemon's log: {type(error).__name__}: {error}"))
        finally:
            running.discard(task)
        return None

    def _require_ns(self, context: _Context) -> None:
        for key, value in context.invocation_metadata() or ():
            if key == NAMESPACE_KEY and value != self._ns:
                raise InvalidArgumentError(
                    f"this daemon flies {self._ns}, not {value!s:.64}", {"field": NAMESPACE_KEY, "namespace": self._ns}
                )


class _Registry:
    """Takes what generated code registers with a server."""

    def __init__(self, server: grpc.aio.Server, calls: Calls) -> None:
        self._server = server
        self._calls = calls

    def add_generic_rpc_handlers(self, handlers: Sequence[grpc.GenericRpcHandler]) -> None:
        """Nothing: these are the same methods again, as they were registered before gRPC 1.67."""

    def add_registered_method_handlers(self, service: str, handlers: Mapping[str, _Handler]) -> None:
        """The methods of a service."""
        wrapped = {name: self._calls.wrapped(f"/{service}/{name}", each) for name, each in handlers.items()}
        self._server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(service, wrapped),))


async def _respond(serve: Callable[[object, _Context], Any], request: object, context: _Context) -> None:
    """Writes the responses of a stream. Here, and not handed on by yield, so that a call that is ended while it writes
    ends here, too.
    """
    async with aclosing(serve(request, context)) as responses:
        async for response in responses:
            await context.write(response)


async def _abort(context: _Context, error: UalError) -> None:
    status = rpc_errors.to_grpc_status(error)
    await context.abort(status.code, status.details, status.trailing_metadata)
