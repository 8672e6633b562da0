"""Handling of a call by every transport, with a real client."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from queue import SimpleQueue
from typing import Any, TypeAlias, TypeVar

import grpc
import pytest

from tests.conftest import TIMES_TO_BEGIN_S
from tests.ual_daemon.server.raw import RESET, answer_to
from tests.ual_daemon.server.serving import taking
from tests.waiting import LIMIT_S, until
from ual_daemon.server.transport import selection
from ual_daemon.server.transport.base import ServedCall, Transport, TransportServer
from ual_daemon.server.transport.selection import Choice

T = TypeVar("T")
Served: TypeAlias = Callable[[Callable[[ServedCall], None]], AbstractContextManager[grpc.Channel]]


class Loop:
    """An event loop in a thread of its own: the tests block."""

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.start()

    def run(self, work: Awaitable[T]) -> T:
        async def run() -> T:
            return await work

        return asyncio.run_coroutine_threadsafe(run(), self._loop).result(LIMIT_S)

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(LIMIT_S)
        self._loop.close()


@pytest.fixture
def loop() -> Iterator[Loop]:
    loop = Loop()
    yield loop
    loop.close()


@pytest.fixture
def served(loop: Loop, transport: Choice) -> Served:
    """Serves calls that `take` takes until the block ends; a client's channel."""

    @contextmanager
    def served(take: Callable[[ServedCall], None]) -> Iterator[grpc.Channel]:
        with ExitStack() as stack:
            serving = taking(transport, take)
            address = loop.run(serving.__aenter__())
            stack.callback(lambda: loop.run(serving.__aexit__(None, None, None)))
            yield stack.enter_context(grpc.insecure_channel(address))

    return served


def stream(channel: grpc.Channel) -> Any:
    """A method of bytes that asks and answers by streams."""
    return channel.stream_stream("/a.B/C")


def test_a_call_has_its_method_metadata_and_peer(served: Served) -> None:
    taken: SimpleQueue[ServedCall] = SimpleQueue()

    def take(call: ServedCall) -> None:
        taken.put(call)
        call.finish(b"answer")

    with served(take) as channel:
        unary: Any = channel.unary_unary("/a.B/C")
        assert unary(b"", metadata=(("key", "value"), ("key-bin", b"\0"))) == b"answer"
        call = taken.get(timeout=LIMIT_S)
        assert call.method == "/a.B/C"
        assert ("key", "value") in call.metadata
        assert ("key-bin", b"\0") in call.metadata
        assert call.peer().startswith("ipv4:127.0.0.1:")
        del call


def test_messages_come_in_their_order_and_then_none(served: Served) -> None:
    def take(call: ServedCall) -> None:
        received: list[bytes] = []

        def on_message(message: bytes | None) -> None:
            if message is None:
                call.finish(b"".join(received))
            else:
                received.append(message)
                call.receive(on_message)

        call.receive(on_message)

    with served(take) as channel:
        assert list(stream(channel)(iter([b"a", b"b", b"c"]))) == [b"abc"]


def test_one_message_after_the_other_is_sent_then_the_status(served: Served) -> None:
    def take(call: ServedCall) -> None:
        left = [b"1", b"2", b"3"]

        def send(is_out: bool = True) -> None:
            assert is_out
            if left:
                call.send(left.pop(0), send)
            else:
                call.finish(code=grpc.StatusCode.ABORTED, details="that is all", metadata=(("why-bin", b"x"),))

        call.begin()
        send()

    with served(take) as channel:
        answers = stream(channel)(iter([]))
        assert [next(answers) for _ in range(3)] == [b"1", b"2", b"3"]
        with pytest.raises(grpc.RpcError):
            next(answers)
        assert answers.code() is grpc.StatusCode.ABORTED
        assert answers.details() == "that is all"
        assert ("why-bin", b"x") in answers.trailing_metadata()


def test_only_the_first_end_counts_and_what_is_sent_after_it_is_left_out(served: Served) -> None:
    def take(call: ServedCall) -> None:
        call.finish(b"first")
        call.finish(code=grpc.StatusCode.INTERNAL)
        call.send(b"late", lambda _: None)
        call.receive(lambda _: None)
        assert call.is_finished

    with served(take) as channel:
        assert list(stream(channel)(iter([]))) == [b"first"]


def test_a_caller_who_gives_up_learns_of(served: Served) -> None:
    told, taken = threading.Event(), SimpleQueue[ServedCall]()

    def take(call: ServedCall) -> None:
        call.watch(told.set)
        taken.put(call)

    with served(take) as channel:
        answers = stream(channel)(iter([]))
        call = taken.get(timeout=LIMIT_S)
        assert not call.is_cancelled
        answers.cancel()
        assert told.wait(LIMIT_S)
        assert call.is_cancelled
        del call


def test_a_call_that_ended_well_is_not_reported_as_abandoned(served: Served) -> None:
    told = threading.Event()

    def take(call: ServedCall) -> None:
        call.watch(told.set)
        call.finish(b"answer")

    with served(take) as channel:
        assert list(stream(channel)(iter([]))) == [b"answer"]
    assert not told.is_set()  # the core has ended: nothing comes any more


def test_a_deadline_that_passes_is_a_caller_who_gives_up(served: Served) -> None:
    told, taken = threading.Event(), threading.Event()

    def take(call: ServedCall) -> None:
        call.watch(told.set)
        taken.set()

    with served(take) as channel:
        for limit_s in TIMES_TO_BEGIN_S:
            with pytest.raises(grpc.RpcError, match="Deadline Exceeded"):
                next(stream(channel)(iter([]), timeout=limit_s))
            if taken.is_set():
                break
        assert told.wait(LIMIT_S)


def test_a_send_that_a_vanished_caller_never_gets_ends_as_not_out(served: Served) -> None:
    ended: SimpleQueue[bool] = SimpleQueue()

    def take(call: ServedCall) -> None:
        def flood(is_out: bool = True) -> None:
            if is_out:
                call.send(bytes(100_000), flood)
            else:
                ended.put(is_out)

        flood()

    with served(take) as channel:
        answers = stream(channel)(iter([]))
        next(answers)
        answers.cancel()
        assert ended.get(timeout=LIMIT_S) is False


def test_a_defect_in_what_is_called_back_is_logged_and_the_thread_goes_on(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    def take(call: ServedCall) -> None:
        if ("fail", "1") in call.metadata:
            call.watch(lambda: None)
            raise RuntimeError("a defect")
        call.finish(b"")

    with served(take) as channel, caplog.at_level(logging.ERROR, "ual_daemon"):
        unary: Any = channel.unary_unary("/a.B/C")
        failing = unary.future(b"", metadata=(("fail", "1"),))
        until(lambda: caplog.records)
        failing.cancel()
        assert unary(b"") == b""
    (record,) = caplog.records
    assert record.exc_info is not None


def test_a_path_that_is_no_text_does_not_keep_others_from_being_served(loop: Loop, transport: Choice) -> None:
    taken: list[str] = []

    def take(call: ServedCall) -> None:
        taken.append(call.method)
        call.finish(b"answer")

    def answer(unary: Callable[..., bytes]) -> bytes:
        """Returns the final answer: ``grpc.aio`` cancels a call, untaken, that comes just as its server ends."""
        deadline = time.monotonic() + LIMIT_S
        while True:
            try:
                return unary(b"", wait_for_ready=True, timeout=LIMIT_S)
            except grpc.RpcError as error:
                status = error.code() if isinstance(error, grpc.Call) else None
                if status is not grpc.StatusCode.CANCELLED or time.monotonic() > deadline:
                    raise

    serving = taking(transport, take)
    address = loop.run(serving.__aenter__())
    answer_to(address, {b":path": b"/\xff/x"})
    with grpc.insecure_channel(address) as channel:
        assert answer(channel.unary_unary("/a.B/C")) == b"answer"
    loop.run(serving.__aexit__(None, None, None))
    assert taken.count("/a.B/C") == 1


def test_metadata_that_are_none_get_a_status_and_one_kind_of_row(
    loop: Loop, transport: Choice, caplog: pytest.LogCaptureFixture
) -> None:
    serving = taking(transport, lambda call: call.finish(b"answer"))
    address = loop.run(serving.__aenter__())
    for number in range(3):
        assert b"answer" in answer_to(address, {b"ual-ns": b"\xff%d" % number})  # the handler of the call judges it
    for damaged, words in (({b"x-bin": b"!!!"}, b"illegal base64"), ({b"UAL": b"x"}, b"Illegal header key")):
        answer = answer_to(address, damaged)
        assert words in answer or RESET in answer
    loop.run(serving.__aexit__(None, None, None))
    lines = [record for record in caplog.records if record.levelno >= logging.WARNING]
    assert all(record.exc_info is None for record in lines)
    assert {record.getMessage() for record in lines} == {"a caller sends metadata that are no UTF-8"}


def descriptors() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.skipif(not hasattr(socket, "TCP_DEFER_ACCEPT"), reason="the system does not hold connections back")
def test_a_connection_on_which_nothing_was_reported_never_reaches_grpc(loop: Loop, transport: Choice) -> None:
    serving = taking(transport, lambda call: call.finish(b"answer"))
    address = loop.run(serving.__aenter__())
    host, _, port = address.partition(":")
    with grpc.insecure_channel(address) as channel, ExitStack() as silent:
        unary: Any = channel.unary_unary("/a.B/C")
        assert unary(b"", timeout=LIMIT_S) == b"answer"
        before = descriptors()
        for _ in range(50):
            silent.enter_context(socket.create_connection((host, int(port)), LIMIT_S))
        for _ in range(10):
            assert unary(b"", timeout=LIMIT_S) == b"answer"
        assert descriptors() - before < 75  # 50 are the callers' own; accepted ones would be as many again
    loop.run(serving.__aexit__(None, None, None))


def test_servers_of_one_transport_stop_each_by_itself(loop: Loop, transport: Choice) -> None:
    async def begin() -> tuple[Transport, list[TransportServer], list[int]]:
        made = await selection.choose(transport)
        servers = [
            made.server([("grpc.so_reuseport", 0)], lambda call, number=number: call.finish(b"%d" % number))  # type: ignore[misc]
            for number in range(20)
        ]
        ports = [server.listen("127.0.0.1:0") for server in servers]
        for server in servers:
            await server.start()
        return made, servers, ports

    made, servers, ports = loop.run(begin())
    for number, (port, server) in enumerate(zip(ports, servers, strict=True)):
        with grpc.insecure_channel(f"127.0.0.1:{port}") as channel:
            unary: Any = channel.unary_unary("/a.B/C")
            assert unary(b"") == b"%d" % number
        assert loop.run(server.stop(LIMIT_S))
    made.close()


def test_a_server_that_is_stopped_again_while_it_stops_is_stopped_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """gRPC's second stop of two at a time used a server that the first had freed: Python 3.14 crashed."""
    stops: list[float | None] = []

    async def run() -> None:
        kind: Any = type(grpc.aio.server())
        stop = kind.stop

        async def recorded(server: grpc.aio.Server, grace: float | None) -> None:
            stops.append(grace)
            await stop(server, grace)

        monkeypatch.setattr(kind, "stop", recorded)
        made = await selection.choose("aio")
        server = made.server([], lambda _: None)
        server.listen("127.0.0.1:0")
        await server.start()
        await server.stop(0.0)
        assert await server.stop(LIMIT_S)
        made.close()

    asyncio.run(run())
    assert stops == [0.0]


def test_an_address_that_cannot_be_had_is_an_error_and_the_server_can_still_be_left(transport: Choice) -> None:
    async def run() -> None:
        made = await selection.choose(transport)
        server = made.server([], lambda _: None)
        with pytest.raises(RuntimeError):
            server.listen("192.0.2.1:1")
        server.listen("127.0.0.1:0")
        assert await server.stop(LIMIT_S)  # never started
        made.close()

    asyncio.run(run())
