"""The page's server: viser's, behind our guard. The only module that knows how viser serves.

viser passes neither TLS nor a check of requests to `websockets`. So while it starts, its call of `serve` gets both.
"""

from __future__ import annotations

import http
import io
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import viser
from typing_extensions import override
from websockets.asyncio import server as websockets_server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from ual.errors import InvalidArgumentError
from ual_tools.view.access import Access
from ual_tools.view.guard import HEADERS, Guard
from ual_tools.view.shell import with_shell

_LARGEST_MESSAGE = 1 << 20
"""Of a browser. viser would take 50 MiB, for pictures that we do not ask for."""
_Answer = Callable[[ServerConnection, Request], "Response | None"]


class PageServer(viser.ViserServer):
    """viser's server, without its offer to share the page through a server on the internet."""

    @override
    def request_share_url(self, verbose: bool = True) -> str | None:
        """Shares nothing: the page stays on this computer, or behind its token."""
        return None


@contextmanager
def serving(access: Access, title: str) -> Iterator[PageServer]:
    """Serves the page of this title while the block runs.

    Raises:
        InvalidArgumentError: The address cannot be listened on.

    """
    _require_free(access.host, access.port)
    with _guarded(access, title):
        server = PageServer(access.host, access.port, verbose=False)
    try:
        yield server
    finally:
        with _quiet():
            server.stop()


def _require_free(host: str, port: int) -> None:
    """Refuses an address that cannot be listened on: viser would try a thousand other ports, and then wait for ever."""
    try:
        socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET).close()
    except OSError as error:
        number = error.errno or 0
        why = os.strerror(number) if number > 0 else error.strerror  # Python adds the address to its own words
        raise InvalidArgumentError(f"{host}:{port} cannot be listened on: {why}; give another --port") from None


@contextmanager
def _guarded(access: Access, title: str) -> Iterator[None]:
    real = websockets_server.serve

    def serve(*args: Any, process_request: _Answer, **options: Any) -> Any:  # noqa: ANN401 (websockets' own)
        options |= {"ssl": access.tls, "max_size": _LARGEST_MESSAGE}
        return real(*args, process_request=_checked(access.guard, process_request, title), **options)

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
