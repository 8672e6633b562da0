"""Tests at start whether the transport on gRPC's core works with the grpcio that is installed.

gRPC's public client calls a server of it on loopback. The three calls use every operation of the binding that the
daemon uses.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import islice
from typing import Any

import grpc

from ual_daemon.server.transport.base import ServedCall, TransportServer
from ual_daemon.server.transport.core import CoreTransport

TEST_TIMEOUT_S = 2.0
"""For each call, and for the end. Each takes a millisecond where the core works, the first call some more."""
ABANDON_S = 0.5
"""For the end of what a failed test leaves."""

_METADATA = (("ual-self-test", "value"), ("ual-self-test-bin", b"\0\xff"))
_REQUEST = b"request"
_FIRST, _SECOND = b"first answer", b"second answer"
_DETAILS = "an error"
_SERVER_OPTIONS = (("grpc.so_reuseport", 0),)
_CLIENT_OPTIONS = (
    ("grpc.enable_http_proxy", 0),  # loopback, whatever the environment says
    ("grpc.use_local_subchannel_pool", 1),  # nothing of it stays
    ("SingleThreadedUnaryStream", 1),  # no thread for the stream; an experimental option, which gRPC may ignore
)


class SelfTestError(Exception):
    """The core works otherwise than it should; the message says how."""


async def run() -> None:
    """Runs the test. It blocks the event loop for some milliseconds, and leaves no thread behind.

    Raises:
        SelfTestError: The core does something else than it should.
        Exception: What the binding raised.

    """
    test = _SelfTest()
    try:
        test.call(await test.serve())
    except Exception as error:  # noqa: BLE001  what the server's thread raised says more
        await test.abandon()
        raise test.defect or _plain(error) from None
    await test.end()


def _plain(error: Exception) -> Exception:
    """Returns the error; that of a call, whose text has several lines, with its status only."""
    if not isinstance(error, grpc.RpcError):
        return error
    status: Any = error
    return SelfTestError(f"a call ends with {status.code().name}: {status.details()}")


class _SelfTest:
    """A server on the core, with three methods, and its caller."""

    def __init__(self) -> None:
        self.defect: Exception | None = None
        self._cancelled = threading.Event()
        self._channel: grpc.Channel | None = None
        self._server: TransportServer | None = None
        self._transport = CoreTransport(on_defect=self._on_defect)
        self._methods: dict[str, Callable[[ServedCall], None]] = {
            "/ual.SelfTest/Echo": self._echo,
            "/ual.SelfTest/Fail": self._fail,
            "/ual.SelfTest/Stream": self._stream,
        }

    async def serve(self) -> int:
        """Starts the server. Returns its port."""
        self._server = self._transport.server(_SERVER_OPTIONS, self._on_call)
        port = self._server.listen("127.0.0.1:0")
        await self._server.start()
        return port

    def call(self, port: int) -> None:
        """Calls each method, and compares."""
        with grpc.insecure_channel(f"127.0.0.1:{port}", _CLIENT_OPTIONS) as self._channel:
            echo: Any = self._channel.unary_unary("/ual.SelfTest/Echo")
            answer = echo(_REQUEST, metadata=_METADATA, timeout=TEST_TIMEOUT_S)
            _require(answer == _REQUEST, "a unary call has another answer")
            self._call_fail(self._channel.unary_unary("/ual.SelfTest/Fail"))
            self._call_stream(self._channel.unary_stream("/ual.SelfTest/Stream"))

    async def end(self) -> None:
        """Ends the server, and with it the test."""
        assert self._server is not None
        _require(await self._server.stop(TEST_TIMEOUT_S), "the server does not stop")
        _require(self._transport.end(TEST_TIMEOUT_S), "the thread does not end")
        if self.defect is not None:
            raise self.defect

    async def abandon(self) -> None:
        """Ends what can be ended. A thread that cannot stays, and keeps what it uses."""
        with suppress(Exception):
            if self._server is not None:
                await self._server.stop(ABANDON_S)
        with suppress(Exception):
            self._transport.end(ABANDON_S)

    # --- The caller ---------------------------------------------------------------------------------------------------

    def _call_fail(self, fail: Any) -> None:  # noqa: ANN401
        try:
            fail(_REQUEST, timeout=TEST_TIMEOUT_S)
        except grpc.RpcError as error:
            status: Any = error
            _require(status.code() is grpc.StatusCode.ABORTED, f"an error comes as {status.code()}: {status.details()}")
            _require(status.details() == _DETAILS, "an error has other details")
            _require(set(_METADATA) <= set(map(tuple, status.trailing_metadata())), "an error lacks its metadata")
        else:
            raise SelfTestError("an error does not come")

    def _call_stream(self, stream: Any) -> None:  # noqa: ANN401
        answers = stream(_REQUEST, timeout=TEST_TIMEOUT_S)
        _require(list(islice(answers, 2)) == [_FIRST, _SECOND], "a stream has other answers")
        answers.cancel()
        _require(self._cancelled.wait(TEST_TIMEOUT_S), "a call that is cancelled goes on")

    # --- The server, on its own thread --------------------------------------------------------------------------------

    def _on_defect(self, error: Exception) -> None:
        self.defect = self.defect or error
        if self._channel is not None:
            self._channel.close()  # the caller need not wait for its time limit

    def _on_call(self, call: ServedCall) -> None:
        self._methods[call.method](call)

    def _echo(self, call: ServedCall) -> None:
        _require(set(_METADATA) <= set(map(tuple, call.metadata)), "the metadata of a call are missing")
        _require(call.peer().startswith("ipv4:127.0.0.1:"), "the caller's address is missing")
        call.receive(call.finish)

    def _fail(self, call: ServedCall) -> None:
        error = partial(call.finish, None, grpc.StatusCode.ABORTED, _DETAILS, _METADATA)
        call.receive(lambda _: error())

    def _stream(self, call: ServedCall) -> None:
        def on_request(request: bytes | None) -> None:
            _require(request == _REQUEST, "a stream has another request")
            call.receive(on_end)

        def on_end(request: bytes | None) -> None:
            _require(request is None, "a request comes twice")
            call.send(_FIRST, on_sent)

        def on_sent(is_out: bool) -> None:
            _require(is_out, "a message does not go out")
            call.send(_SECOND, lambda _: None)

        call.begin()
        call.watch(self._cancelled.set)
        call.receive(on_request)


def _require(is_met: bool, fault: str) -> None:
    if not is_met:
        raise SelfTestError(fault)
