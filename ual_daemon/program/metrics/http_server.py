"""Serves one page over HTTP, to several at once. A request has a limit as a whole, however its bytes come."""

from __future__ import annotations

import asyncio
import http.client
import io
import logging
import socket
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any, NamedTuple, TypeAlias, cast

from ual.shared.guard import WorkGuard
from ual.shared.waiting import ends_within
from ual_daemon import logs
from ual_daemon.server.addresses import Address

Application: TypeAlias = Callable[[dict[str, Any], Any], Iterable[bytes]]
"""An application of WSGI."""

_log = logging.getLogger(__name__)

REQUEST_S = 2.0
"""A request that is not complete after this time, from the connection on, is not answered."""
_ANSWER_S = 20.0
"""A client that has not taken its answer after this time is left. Prometheus waits for 10 s by default."""
MOST_CONNECTIONS = 16
"""Connections beyond which the oldest one ends: a caller that asks at once is served, however many say nothing."""
_LARGEST_REQUEST_BYTES = 16 << 10
"""Of a request. Prometheus sends about 400."""
_BACKLOG_CONNECTIONS = 16
_ACCEPT_RETRY_S = 1.0
"""After a connection that could not be accepted, as no descriptor or memory was left."""
_THREAD_END_S = 1.0
_END_OF_REQUEST = b"\r\n\r\n"


class HttpAnswer(NamedTuple):
    """An answer: its status, its headers, and its content."""

    status: str
    headers: list[tuple[str, str]]
    body: bytes

    def packed(self) -> bytes:
        """Returns it as it is sent."""
        fields = [*self.headers, ("Content-Length", str(len(self.body))), ("Connection", "close")]
        lines = [f"HTTP/1.1 {self.status}", *(f"{name}: {value}" for name, value in fields)]
        return "\r\n".join([*lines, "", ""]).encode("latin-1") + self.body


class HttpServer:
    """Serves an application on a thread of its own, from `start` to `close`. The application has one more thread.

    Args:
        address: Where. The port is open before `start`.
        name: What the guard, the threads and the log call it.

    Raises:
        OSError: The port cannot be had.

    """

    def __init__(self, address: Address, name: str) -> None:
        family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
        self._listener = socket.socket(family)
        try:
            self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listener.bind((address.host, address.port))
            self._listener.listen(_BACKLOG_CONNECTIONS)
        except BaseException:
            self._listener.close()
            raise
        self._listener.setblocking(False)
        self.address = Address(address.host, self._listener.getsockname()[1])
        self._name = name
        self._guard = WorkGuard(name)
        self._ended = asyncio.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None

    def start(self, app: Application) -> None:
        """Begins to serve. The application is called on a thread, for one request at a time.

        Raises:
            OSError: No file descriptor is left.

        """
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, args=(self._loop, app), name=self._name, daemon=True)
        self._thread.start()

    def leave(self) -> None:
        """Closes the port in a process that has inherited it and does not serve it."""
        self._listener.close()

    def close(self) -> None:
        """Ends it. Waits for no client, and for no answer that is being made."""
        if self._loop is not None and self._thread is not None:
            with suppress(RuntimeError):  # it has ended by a defect
                self._loop.call_soon_threadsafe(self._ended.set)
            self._thread.join(_THREAD_END_S)
        self._listener.close()

    def _run(self, loop: asyncio.AbstractEventLoop, app: Application) -> None:
        try:
            loop.run_until_complete(_Serving(self._listener, app, self._name, self._guard).until(self._ended))
        finally:
            loop.close()


class _Serving:
    """The connections of a server, on its event loop."""

    def __init__(self, listener: socket.socket, app: Application, name: str, guard: WorkGuard) -> None:
        self._listener = listener
        self._app = app
        self._name = name
        self._guard = guard
        self._turn = asyncio.Lock()
        """One answer is made at a time: more of them take no more of the processor from the flight."""
        self._connections: dict[asyncio.Task[None], None] = {}
        """From the oldest on."""
        self._silent: dict[asyncio.Task[None], None] = {}
        """Connections whose request is not complete."""
        self._cause = ""
        """Why connections cannot be accepted now."""

    async def until(self, ended: asyncio.Event) -> None:
        """Serves until the event is set. All connections are closed then."""
        accepting, ending = asyncio.create_task(self._accept()), asyncio.create_task(ended.wait())
        await asyncio.wait((accepting, ending), return_when=asyncio.FIRST_COMPLETED)
        tasks = [accepting, ending, *self._connections]
        for task in tasks:
            task.cancel()
        for result in await asyncio.gather(*tasks, return_exceptions=True):
            if isinstance(result, Exception):
                raise result

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, _ = await loop.sock_accept(self._listener)
            except OSError as error:
                self._note_refusal(error.strerror or str(error))
                await asyncio.sleep(_ACCEPT_RETRY_S)
                continue
            self._note_refusal("")
            self._make_room()
            task = asyncio.create_task(self._serve(connection))
            self._connections[task] = self._silent[task] = None
            task.add_done_callback(self._forget)
            await asyncio.sleep(0.0)  # it begins, so that it closes the connection whatever happens

    def _forget(self, task: asyncio.Task[None]) -> None:
        self._connections.pop(task, None)
        self._silent.pop(task, None)

    def _note_refusal(self, cause: str) -> None:
        """Logs that nobody can connect, once for each cause, and that it is possible again."""
        if cause == self._cause:
            return
        self._cause = cause
        if cause:
            fields = {"server": self._name, "why": cause, "retry_s": _ACCEPT_RETRY_S}
            logs.event(_log, logging.ERROR, "connections_fail", **fields)
        else:
            logs.event(_log, logging.INFO, "connections_recovered", server=self._name)

    def _make_room(self) -> None:
        if len(self._connections) >= MOST_CONNECTIONS:
            oldest = next(iter(self._silent or self._connections))
            self._forget(oldest)
            oldest.cancel()

    async def _serve(self, connection: socket.socket) -> None:
        writer: asyncio.StreamWriter | None = None
        try:
            reader, writer = await asyncio.open_connection(sock=connection, limit=_LARGEST_REQUEST_BYTES)
            asking = asyncio.ensure_future(reader.readuntil(_END_OF_REQUEST))
            if await ends_within(asking, REQUEST_S):
                self._silent.pop(cast("asyncio.Task[None]", asyncio.current_task()), None)
                await ends_within(self._answer(asking.result(), writer), _ANSWER_S)
        except (OSError, EOFError, asyncio.LimitOverrunError):
            _log.debug("%s: a request was not answered", self._name, exc_info=True)
        except Exception as error:  # noqa: BLE001  a defect concerns one request only
            self._guard.note(error)
        finally:
            if writer is None:
                connection.close()
            else:
                writer.transport.abort()

    async def _answer(self, request: bytes, writer: asyncio.StreamWriter) -> None:
        environ = environ_of(request)
        answer = HttpAnswer("400 Bad Request", [], b"") if environ is None else await self._ask(environ)
        writer.write(answer.packed())
        await writer.drain()
        writer.close()
        await writer.wait_closed()

    async def _ask(self, environ: dict[str, Any]) -> HttpAnswer:
        """Asks the application, on a thread that the end does not wait for."""
        loop = asyncio.get_running_loop()
        await self._turn.acquire()
        answered: asyncio.Future[HttpAnswer] = loop.create_future()
        answered.add_done_callback(lambda _: self._turn.release())

        def ask() -> None:
            failed = HttpAnswer("500 Internal Server Error", [], b"")
            answer = self._guard.run(lambda: _called(self._app, environ), lambda _: failed)
            with suppress(RuntimeError):  # the server was closed meanwhile
                loop.call_soon_threadsafe(answered.set_result, answer)

        threading.Thread(target=ask, name=self._name, daemon=True).start()
        return await asyncio.shield(answered)  # the turn ends with the answer, even if nobody waits for it


def _called(app: Application, environ: dict[str, Any]) -> HttpAnswer:
    begun: list[tuple[str, list[tuple[str, str]]]] = []
    body = b"".join(app(environ, lambda status, headers: begun.append((status, headers))))
    return HttpAnswer(*begun[0], body)


def environ_of(request: bytes) -> dict[str, Any] | None:
    """Returns what an application reads of a request: its method, path, query and headers; None for no HTTP."""
    line, _, rest = request.partition(b"\r\n")
    words = line.decode("latin-1").split(" ")
    if len(words) != 3 or not words[2].startswith("HTTP/1."):
        return None
    try:
        headers = http.client.parse_headers(io.BytesIO(rest))
    except http.client.HTTPException:
        return None
    path, _, query = words[1].partition("?")
    fields = {"HTTP_" + name.upper().replace("-", "_"): value for name, value in headers.items()}
    return {**fields, "REQUEST_METHOD": words[0], "PATH_INFO": path, "QUERY_STRING": query}
