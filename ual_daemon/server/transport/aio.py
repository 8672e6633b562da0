"""The transport on gRPC's public API for asyncio (``grpc.aio``): calls are received, and call back, on the event loop.

Every method is served as a stream of bytes in and out; a unary call is one with a single message each way.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, NamedTuple, TypeAlias

import grpc
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

_Context: TypeAlias = "grpc.aio.ServicerContext[bytes, bytes]"
_OnReceived: TypeAlias = Callable[[bytes | None], object]
_OnSent: TypeAlias = Callable[[bool], object]

_log = logging.getLogger(__name__)

_WATCH_S = 1.0
"""Seconds between two looks whether a server has ended, and between attempts to open an address."""


class AioTransport(Transport):
    """The event loop that runs when its servers are made."""

    name = "aio"
    is_on_loop = True

    def __init__(self) -> None:
        self._deferral = Deferral()

    @override
    def server(self, options: Options, take: Callable[[ServedCall], None]) -> AioServer:
        return AioServer(options, take, self._deferral)

    @override
    def close(self) -> None:
        pass


class AioServer(TransportServer):
    """A server that hands each call to `take`, on the event loop.

    ``grpc.aio`` ends its server after some errors, for example if the path of a request is no UTF-8. Then another one
    takes its place; calls that are in progress go on.
    """

    def __init__(self, options: Options, take: Callable[[ServedCall], None], deferral: Deferral) -> None:
        self._options = options
        self._deferral = deferral
        self._handlers = [_AnyMethod(take)]
        self._server = self._make()
        self._replaced: list[grpc.aio.Server] = []
        self._opened: list[tuple[str, MakeCredentials | None]] = []
        self._watching: asyncio.Task[None] | None = None
        self._stopping: list[asyncio.Task[None]] = []

    @override
    def listen(self, address: str, credentials: MakeCredentials | None = None) -> int:
        port = self._open(self._server, address, credentials)
        host, _, number = address.rpartition(":")
        self._opened.append((f"{host}:{port}" if number == "0" else address, credentials))
        return port

    @override
    async def start(self) -> None:
        self._deferral.apply()
        await self._server.start()
        self._watching = asyncio.create_task(self._watch())

    @override
    async def stop(self, grace_s: float) -> bool:
        if self._watching is not None:
            self._watching.cancel()
        if not self._stopping:  # once: the second of two stops at a time would use a server that the first has freed
            servers = (self._server, *self._replaced)
            self._stopping = [asyncio.create_task(server.stop(grace_s)) for server in servers]
        await asyncio.wait(self._stopping, timeout=2.0 * grace_s)
        return all(each.done() for each in self._stopping)

    def _make(self) -> grpc.aio.Server:
        return grpc.aio.server(handlers=self._handlers, options=self._options)

    async def _watch(self) -> None:
        while True:
            try:
                # While there are calls, it raises what ended the server only with a timeout.
                if not await self._server.wait_for_termination(_WATCH_S):
                    return
            except Exception as error:  # noqa: BLE001  whatever it was, others must be served
                _log.error("grpc.aio ended its server (%s: %s); it starts again", type(error).__name__, error)
                await self._replace()

    async def _replace(self) -> None:
        self._replaced.append(self._server)
        self._server = server = self._make()
        for address, credentials in self._opened:
            while not self._try_to_open(server, address, credentials):  # noqa: ASYNC110  nothing notifies of free ports
                await asyncio.sleep(_WATCH_S)
        self._deferral.apply()
        await server.start()

    def _open(self, server: grpc.aio.Server, address: str, credentials: MakeCredentials | None) -> int:
        port = _add(server, address, credentials)
        self._deferral.add(address, port)
        return port

    def _try_to_open(self, server: grpc.aio.Server, address: str, credentials: MakeCredentials | None) -> bool:
        try:
            self._open(server, address, credentials)
        except RuntimeError as error:
            _log.error("%s", error)
            return False
        return True


def _add(server: grpc.aio.Server, address: str, credentials: MakeCredentials | None) -> int:
    if credentials is None:
        return server.add_insecure_port(address)
    return server.add_secure_port(address, credentials())


class _AnyMethod(grpc.GenericRpcHandler):
    """Takes calls of every method: which ones exist is known by the handler."""

    def __init__(self, take: Callable[[ServedCall], None]) -> None:
        self._take = take

    @override
    def service(self, handler_call_details: grpc.HandlerCallDetails) -> grpc.RpcMethodHandler[bytes, bytes]:
        method = handler_call_details.method

        async def serve(_: object, context: _Context) -> None:
            await AioCall(method, context).run(self._take)

        return grpc.stream_stream_rpc_method_handler(serve)


class _End(NamedTuple):
    """Arguments of `ServedCall.finish`."""

    message: bytes | None
    code: grpc.StatusCode
    details: str
    metadata: Metadata


class _OperationWorker:
    """Awaits operations of one kind, one after the other. Its task lives only while there are any."""

    def __init__(self) -> None:
        self._next: Coroutine[Any, Any, None] | None = None
        self._task: asyncio.Task[None] | None = None

    def start(self, operation: Coroutine[Any, Any, None]) -> None:
        """Awaits it, after the one in progress."""
        self._next = operation
        if self._task is None:
            self._task = asyncio.create_task(self._run())

    def cancel(self) -> None:
        """Gives up the operation in progress."""
        if self._task is not None:
            self._task.cancel()
        if self._next is not None:
            self._next.close()

    async def _run(self) -> None:
        try:
            while self._next is not None:
                operation, self._next = self._next, None
                await operation
        finally:
            self._task = None


class AioCall(ServedCall):
    """One call of ``grpc.aio``. It lives as long as `run`."""

    def __init__(self, method: str, context: _Context) -> None:
        self.method = method
        self.metadata = tuple(context.invocation_metadata() or ())
        self.is_finished = False
        self.is_cancelled = False
        self._context = context
        self._peer = context.peer()
        self._certificate_name = name_of_certificate(context.auth_context())
        self._loop = asyncio.get_running_loop()
        self._thread_id = threading.get_ident()
        self._lock = threading.Lock()
        # Everything below belongs to the event loop.
        self._reader, self._writer = _OperationWorker(), _OperationWorker()
        self._on_received: _OnReceived | None = None
        self._on_sent: _OnSent | None = None
        self._on_cancel: Callable[[], object] | None = None
        self._beginning: asyncio.Task[bool] | None = None
        self._end: asyncio.Future[_End] = self._loop.create_future()
        self._has_ended = False

    async def run(self, take: Callable[[ServedCall], None]) -> None:
        """Serves the call, as gRPC's handler of it: until it is finished or cancelled."""
        try:
            _call_back(take, self)
            end = await self._end
            self._reader.cancel()
            self._writer.cancel()
            await self._send_end(end)
        except asyncio.CancelledError:
            self.is_cancelled = True
            if self._on_cancel is not None:
                _call_back(self._on_cancel)
            raise
        finally:
            self._leave()

    @override
    def peer(self) -> str:
        return self._peer

    @override
    def certificate_name(self) -> str | None:
        return self._certificate_name

    @override
    def watch(self, on_cancel: Callable[[], object]) -> None:
        self._on_cancel = on_cancel

    @override
    def receive(self, then: _OnReceived) -> None:
        self._on_loop(self._receive, then)

    @override
    def begin(self) -> None:
        self._on_loop(self._begin)

    @override
    def send(self, message: bytes, then: _OnSent) -> None:
        if not self.is_finished:
            self._on_loop(self._send, message, then)

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
        self._on_loop(self._finish, _End(message, code, details, metadata))

    def _on_loop(self, step: Callable[..., None], *arguments: object) -> None:
        if threading.get_ident() == self._thread_id:
            step(*arguments)
            return
        with suppress(RuntimeError):  # the loop is closed, and with it the call
            self._loop.call_soon_threadsafe(step, *arguments)

    # --- On the event loop --------------------------------------------------------------------------------------------

    def _receive(self, then: _OnReceived) -> None:
        if self._has_ended:
            self._loop.call_soon(_call_back, then, None)
            return
        self._on_received = then
        self._reader.start(self._read())

    async def _read(self) -> None:
        message: object = await self._context.read()
        then, self._on_received = self._on_received, None
        assert then is not None
        _call_back(then, message if isinstance(message, bytes) else None)  # `grpc.aio.EOF` after the last one

    def _begin(self) -> None:
        if self._beginning is None and not self._has_ended:
            self._beginning = self._loop.create_task(_try(self._context.send_initial_metadata(())))

    def _send(self, message: bytes, then: _OnSent) -> None:
        if self._has_ended:
            self._loop.call_soon(_call_back, then, False)
            return
        # A write that also sends the initial metadata must not be cancelled: gRPC would send them again with the
        # status, which the core refuses.
        self._begin()
        self._on_sent = then
        self._writer.start(self._write(message))

    async def _write(self, message: bytes) -> None:
        assert self._beginning is not None
        await asyncio.shield(self._beginning)
        is_out = await _try(self._context.write(message))
        then, self._on_sent = self._on_sent, None
        assert then is not None
        _call_back(then, is_out)

    def _finish(self, end: _End) -> None:
        if not self._end.done():
            self._end.set_result(end)

    async def _send_end(self, end: _End) -> None:
        if self._beginning is not None:
            await self._beginning
        if end.message is not None and not await _try(self._context.write(end.message)):
            raise asyncio.CancelledError  # as gRPC does where the caller is gone
        metadata = tuple(end.metadata)
        if end.code is grpc.StatusCode.OK:  # sent by gRPC when its handler returns
            self._context.set_trailing_metadata(metadata)
        elif not await _try(self._context.abort(end.code, _encodable(end.details), metadata)):
            raise asyncio.CancelledError

    def _leave(self) -> None:
        """Ends what is in progress, as the core does: a receiver gets None, a sender gets False."""
        self._has_ended = True
        self._reader.cancel()
        self._writer.cancel()
        if self._on_received is not None:
            _call_back(self._on_received, None)
        if self._on_sent is not None:
            _call_back(self._on_sent, False)


async def _try(operation: Coroutine[Any, Any, object]) -> bool:
    """Returns whether it was done; False where gRPC cannot do it any more, because the call is cancelled."""
    try:
        await operation
    except grpc.aio.InternalError:
        return False
    return True


def _call_back(callback: Callable[..., object], *arguments: object) -> None:
    try:
        callback(*arguments)
    except Exception:  # noqa: BLE001  the loop serves everybody
        _log.exception("a callback of gRPC failed; this is a defect of UAL, please report it")


def _encodable(text: str) -> str:
    return text.encode(errors="replace").decode()
