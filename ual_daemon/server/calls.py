"""What is the same for every call: who calls, for which UAV, how errors go out, and how calls end at shutdown."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing, asynccontextmanager
from typing import Any, TypeAlias, TypeVar

import grpc

from ual import rpc_errors
from ual.errors import InvalidArgumentError, TaskAbortedError, UalError
from ual_daemon import logs

_Request = TypeVar("_Request")
_Response = TypeVar("_Response")
_Handler: TypeAlias = "grpc.RpcMethodHandler[Any, Any]"
_Details: TypeAlias = grpc.HandlerCallDetails
_Context: TypeAlias = "grpc.aio.ServicerContext[Any, Any]"

_log = logging.getLogger(__name__)

NAMESPACE_KEY = "ual-ns"
SHUTTING_DOWN = "the daemon is shutting down"


class Calls(grpc.aio.ServerInterceptor):
    """Stands before every call of the server.

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

    def begin_shutdown(self) -> None:
        """Ends the streams, and refuses new calls that fly."""
        self._is_shutting_down = True
        for task in self._streams:
            task.cancel()

    def end_waiting(self) -> None:
        """Ends the calls that still wait for something."""
        for task in self._unary:
            task.cancel()

    async def intercept_service(
        self,
        continuation: Callable[[_Details], Awaitable[grpc.RpcMethodHandler[_Request, _Response] | None]],
        handler_call_details: _Details,
    ) -> grpc.RpcMethodHandler[_Request, _Response] | None:
        handler = await continuation(handler_call_details)
        if handler is None:  # no such method: gRPC says so
            return None
        if handler.response_streaming:
            return self._streaming(handler, handler_call_details)
        return self._answering(handler, handler_call_details)

    def _answering(self, handler: _Handler, details: _Details) -> _Handler:
        serve: Any = handler.stream_unary if handler.request_streaming else handler.unary_unary
        running = self._streams if handler.request_streaming else self._unary

        async def call(request: object, context: _Context) -> object:
            async with self._call(details, context, running):
                return await serve(request, context)

        make: Any = (
            grpc.stream_unary_rpc_method_handler if handler.request_streaming else grpc.unary_unary_rpc_method_handler
        )
        wrapped: _Handler = make(call, handler.request_deserializer, handler.response_serializer)
        return wrapped

    def _streaming(self, handler: _Handler, details: _Details) -> _Handler:
        serve: Any = handler.stream_stream if handler.request_streaming else handler.unary_stream

        # Written here, and not handed on by yield, so that a call that is ended while it writes ends here, too.
        async def call(request: object, context: _Context) -> None:
            # Now, and not with the first message: gRPC would send it once more where that message is interrupted, and
            # the caller would never hear of the end.
            await context.send_initial_metadata(())
            async with self._call(details, context, self._streams), aclosing(serve(request, context)) as responses:
                async for response in responses:
                    await context.write(response)

        make: Any = (
            grpc.stream_stream_rpc_method_handler if handler.request_streaming else grpc.unary_stream_rpc_method_handler
        )
        wrapped: _Handler = make(call, handler.request_deserializer, handler.response_serializer)
        return wrapped

    @asynccontextmanager
    async def _call(self, details: _Details, context: _Context, running: set[asyncio.Task[Any]]) -> AsyncIterator[None]:
        logs.caller.set(context.peer())
        if self._log_name:
            logs.uav.set(self._log_name)
        task = asyncio.current_task()
        assert task is not None
        running.add(task)
        try:
            await self._check(details, context)
            yield
        except UalError as error:
            # The vehicle has logged what it refused; this is for what did not come so far.
            logs.event(_log, logging.DEBUG, "call_failed", method=details.method, reason=error.reason, why=error)
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
            logs.event(_log, logging.DEBUG, "caller_gone", method=details.method, why=error)
        except Exception as error:  # noqa: BLE001  whatever a call does, the server goes on
            _log.exception("%s failed unexpectedly", details.method)
            await _abort(context, UalError(f"internal error, see the daemon's log: {type(error).__name__}: {error}"))
        finally:
            running.discard(task)

    async def _check(self, details: _Details, context: _Context) -> None:
        if self._is_shutting_down and details.method.startswith(self._shutdown_refuses):
            await context.abort(grpc.StatusCode.UNAVAILABLE, SHUTTING_DOWN)
        for key, value in details.invocation_metadata or ():
            if key == NAMESPACE_KEY and value != self._ns:
                raise InvalidArgumentError(
                    f"this daemon flies {self._ns}, not {value!s:.64}", {"field": NAMESPACE_KEY, "namespace": self._ns}
                )


async def _abort(context: _Context, error: UalError) -> None:
    status = rpc_errors.to_grpc_status(error)
    await context.abort(status.code, status.details, status.trailing_metadata)
