"""The server of `ual view`: without file descriptors, and at its end."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from functools import partial

import pytest

pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

from typing_extensions import override
from websockets.asyncio import server as websockets_server

from tests.descriptors import no_descriptors
from tests.waiting import LIMIT_S, until, until_async
from ual.errors import InvalidArgumentError
from ual_tools.view.access import PageAccess
from ual_tools.view.listener import PageSocket
from ual_tools.view.server import serving


class Waiters(deque[asyncio.Future[bool]]):
    """Waiters of an event, with the names of the threads that wake them."""

    def __init__(self) -> None:
        super().__init__()
        self.wakers: set[str] = set()

    @override
    def __iter__(self) -> Iterator[asyncio.Future[bool]]:
        self.wakers.add(threading.current_thread().name)
        return super().__iter__()


def test_a_message_of_another_thread_wakes_what_sends_it_on_the_event_loop_alone() -> None:
    """Else it fails where that begins to wait in the same moment, and the page that was being made stays empty."""
    with serving(PageAccess("127.0.0.1", 0), "a title", lambda _: None) as server:
        waiters = Waiters()
        event = server._websock_server.get_message_buffer().message_event

        async def send() -> bool:
            event.clear()
            event._waiters = waiters
            return await event.wait()

        sent = asyncio.run_coroutine_threadsafe(send(), server.get_event_loop())
        until(lambda: len(waiters) == 1, "what waits")
        server.gui.add_html("a text")
        assert sent.result(LIMIT_S)
    assert len(waiters.wakers) == 1
    assert threading.current_thread().name not in waiters.wakers


RETRY_S = 1
"""asyncio's pause after a connection that could not be accepted."""


def test_without_descriptors_it_is_reported_once_and_asyncio_tries_once_each_second(
    caplog: pytest.LogCaptureFixture,
) -> None:
    said: list[str] = []
    tries: list[int] = []

    async def serve() -> None:
        loop = asyncio.get_running_loop()
        listener = PageSocket("127.0.0.1", 0, said.append)
        loop.set_exception_handler(listener.note)
        later = loop.call_later
        waiting: list[None] = []

        def call_later(delay_s: float, callback: Callable[..., None], *arguments: object) -> asyncio.TimerHandle:
            if delay_s != RETRY_S:
                return later(delay_s, callback, *arguments)

            def call() -> None:
                waiting.pop()
                callback(*arguments)

            waiting.append(None)
            tries.append(len(waiting))
            return later(0.01, call)

        loop.call_later = call_later  # type: ignore[method-assign, assignment]
        connected = asyncio.Event()

        async def greet(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.close()
            connected.set()

        async with await asyncio.start_server(greet, sock=listener):
            with closing(socket.socket()) as asking:
                asking.setblocking(False)
                with no_descriptors():
                    with suppress(BlockingIOError):
                        asking.connect(listener.getsockname())
                    await until_async(lambda: len(tries) >= 3, "three tries")
                await connected.wait()

    asyncio.run(serve())
    assert set(tries) == {1}
    assert said == ["browsers cannot connect (Too many open files): it is tried again each second"]
    assert not caplog.records


def test_the_end_waits_for_no_connection_without_a_request(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(websockets_server, "serve", partial(websockets_server.serve, open_timeout=None))
    with caplog.at_level(logging.ERROR):
        with serving(PageAccess("127.0.0.1", 0), "a title", lambda _: None) as server:
            silent = socket.create_connection(("127.0.0.1", server.get_port()), LIMIT_S)
            silent.sendall(b"GET / HT")
            other = socket.create_connection(("127.0.0.1", server.get_port()), LIMIT_S)
            other.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1:1\r\n\r\n")
            assert other.recv(4) == b"HTTP"
        with closing(silent), closing(other), suppress(ConnectionError):
            assert silent.recv(1) == b""
    assert not caplog.records


def test_a_port_that_is_taken_is_refused_and_a_browser_that_leaves_is_no_error(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with serving(PageAccess("127.0.0.1", 0), "a title", lambda _: None) as server:
        port = server.get_port()
        with (
            pytest.raises(
                InvalidArgumentError, match=f"127.0.0.1:{port} cannot be listened on: Address already in use"
            ),
            serving(PageAccess("127.0.0.1", port), "a title", lambda _: None),
        ):
            pass
        with socket.create_connection(("127.0.0.1", port), LIMIT_S) as leaving:
            leaving.sendall(b"GET / HT")
        with socket.create_connection(("127.0.0.1", port), LIMIT_S) as asking:
            asking.sendall(b"nonsense\r\n\r\n")
            until(lambda: asking.recv(1000) == b"", "the end of the connection")
    assert not caplog.records
