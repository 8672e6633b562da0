"""The page's server: viser's, behind our guard. The only module that knows how viser serves.

viser passes neither TLS nor a check of requests to `websockets`, nor a socket. So while it starts, its call of `serve`
gets them. It sets an event of asyncio from other threads, so its buffers of messages get one that allows this.
"""

from __future__ import annotations

import asyncio
import http
import io
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import viser
from typing_extensions import override
from viser.infra import _infra
from viser.infra._async_message_buffer import AsyncMessageBuffer
from websockets.asyncio import server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import InvalidHandshake
from websockets.http11 import Request, Response
from websockets.protocol import State

from ual.errors import InvalidArgumentError
from ual_tools.view.access import PageAccess
from ual_tools.view.guard import HEADERS, Guard
from ual_tools.view.listener import PageSocket
from ual_tools.view.shell import with_shell

_LARGEST_MESSAGE_BYTES = 1 << 20
"""Of a browser. viser would take 50 MiB, for pictures that we do not ask for."""
_HANDSHAKE_S = 10.0
"""Of TLS; as long as `websockets` waits for a request. asyncio would wait for a minute."""
_Answer = Callable[[ServerConnection, Request], "Response | None"]


class _LoopEvent(asyncio.Event):
    """An event that other threads do not set: after each try viser sets it on the event loop, too.

    asyncio's own fails in another thread if the loop begins to wait for it in the same moment. A browser whose page was
    being made then had an empty one.
    """

    @override
    def set(self) -> None:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class _MessageBuffer(AsyncMessageBuffer):
    """Messages for browsers, which any thread may add."""

    def __init__(self, *arguments: Any, **options: Any) -> None:  # noqa: ANN401 (viser's own)
        super().__init__(*arguments, **options)
        self.message_event = _LoopEvent()


vars(_infra)["AsyncMessageBuffer"] = _MessageBuffer


class PageServer(viser.ViserServer):
    """viser's server, without its offer to share the page through a server on the internet."""

    @override
    def request_share_url(self, verbose: bool = True) -> str | None:
        """Shares nothing: the page stays on this computer, or behind its token."""
        return None


@contextmanager
def serving(access: PageAccess, title: str, say: Callable[[str], None]) -> Iterator[PageServer]:
    """Serves the page of this title while the block runs. `say` takes why browsers cannot connect, human-readable.

    Raises:
        InvalidArgumentError: The address cannot be listened on.

    """
    sockets = _Sockets(_listener(access.host, access.port, say))
    with _guarded(access, title, sockets):
        server = PageServer(access.host, access.port, verbose=False)
    try:
        yield server
    finally:
        sockets.leave_the_silent()
        with _quiet():
            server.stop()


def _listener(host: str, port: int, say: Callable[[str], None]) -> PageSocket:
    """Returns the socket of an address. viser's own would try a thousand other ports, and then wait for ever."""
    try:
        return PageSocket(host, port, say)
    except OSError as error:
        number = error.errno or 0
        why = os.strerror(number) if number > 0 else error.strerror  # Python adds the address to its own words
        raise InvalidArgumentError(f"{host}:{port} cannot be listened on: {why}; give another --port") from None


def _is_ours(record: logging.LogRecord) -> bool:
    """Returns whether an error of `websockets` is one of ours, and not of a browser that left before its request."""
    error = record.exc_info[1] if record.exc_info else None
    return not isinstance(error, (InvalidHandshake, OSError, EOFError))


_log = logging.getLogger(__name__)
_log.addFilter(_is_ours)


class _Sockets:
    """The socket that listens, and the connections of the page's server, once it has begun."""

    def __init__(self, listener: PageSocket) -> None:
        self.listener = listener
        self._loop: asyncio.AbstractEventLoop | None = None
        self._serving: Any = None

    def begin(self, serving: Any) -> None:  # noqa: ANN401 (websockets' own)
        """Takes what serves them, on its event loop."""
        self._serving, self._loop = serving, asyncio.get_running_loop()
        self._loop.set_exception_handler(self.listener.note)

    def leave_the_silent(self) -> None:
        """Ends connections without a request: the end would wait for them."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._leave)

    def _leave(self) -> None:
        for each in self._serving.server.handlers:
            if each.state is State.CONNECTING:
                each.transport.abort()


@contextmanager
def _guarded(access: PageAccess, title: str, sockets: _Sockets) -> Iterator[None]:
    real = websockets_server.serve

    def serve(handler: Any, _host: str, _port: int, *, process_request: _Answer, **options: Any) -> Any:  # noqa: ANN401 (websockets' own)
        options |= {"ssl": access.tls, "max_size": _LARGEST_MESSAGE_BYTES, "sock": sockets.listener, "logger": _log}
        if access.tls is not None:
            options["ssl_handshake_timeout"] = _HANDSHAKE_S
        made = real(handler, process_request=_checked(access.guard, process_request, title), **options)
        sockets.begin(made)
        return made

    names = vars(websockets_server)
    names["serve"] = serve
    try:
        with _quiet():
            yield
    finally:
        names["serve"] = real


def _quiet() -> redirect_stdout[io.StringIO]:
    """Keeps viser from printing its own address."""
    return redirect_stdout(io.StringIO())


def _checked(guard: Guard, answer: _Answer, title: str) -> _Answer:
    """Returns what answers a request: the guard first, then viser."""

    def checked(connection: ServerConnection, request: Request) -> Response | None:
        headers = {name.lower(): value for name, value in request.headers.raw_items()}
        refusal = guard.refusal(request.path, headers)
        if refusal:
            return connection.respond(http.HTTPStatus.FORBIDDEN, f"ual view: {refusal}\n")
        response = answer(connection, request)
        return None if response is None else _with_headers(response, guard.cookie(request.path, headers), title)

    return checked


def _with_headers(response: Response, cookie: str | None, title: str) -> Response:
    more = {**HEADERS, **({} if cookie is None else {"Set-Cookie": cookie})}
    headers, body = response.headers.copy(), response.body
    if headers.get("Content-Type", "").startswith("text/html"):
        body = with_shell(bytes(body), headers.get("Content-Encoding", ""), title)
        del headers["Content-Length"]
        headers["Content-Length"] = str(len(body))
    headers.update(more)
    return Response(response.status_code, response.reason_phrase, headers, body)
