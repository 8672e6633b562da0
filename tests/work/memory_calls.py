"""The daemon's server without gRPC: a test hands over each message, and gets what is sent, on its own thread."""

from __future__ import annotations

from collections.abc import Callable

import grpc
from typing_extensions import override

from ual_daemon.server.transport.base import MakeCredentials, Metadata, Options, ServedCall, Transport, TransportServer


class MemoryTransport(Transport):
    """Has one server, whose calls a test makes by `call`."""

    name = "memory"
    is_on_loop = False

    @override
    def server(self, options: Options, take: Callable[[ServedCall], None]) -> TransportServer:
        self._take = take
        return _MemoryServer()

    def call(self, method: str, metadata: Metadata = ()) -> MemoryCall:
        """Begins a call of a program on this computer."""
        call = MemoryCall(f"/ual.v1.UalService/{method}", metadata)
        self._take(call)
        return call

    @override
    def close(self) -> None:
        """It has nothing to close."""


class _MemoryServer(TransportServer):
    @override
    def listen(self, address: str, credentials: MakeCredentials | None = None) -> int:
        return 0

    @override
    async def start(self) -> None:
        """It serves from the beginning."""

    @override
    async def stop(self, grace_s: float) -> bool:
        return True


class MemoryCall(ServedCall):
    """A call: what was sent to its caller, and how it ended."""

    def __init__(self, method: str, metadata: Metadata) -> None:
        self.method, self.metadata = method, metadata
        self.is_finished = self.is_cancelled = False
        self.sent: list[bytes] = []
        self.code: grpc.StatusCode | None = None
        self.details = ""
        self._then: Callable[[bytes | None], object] | None = None

    def deliver(self, message: bytes | None) -> None:
        """Hands over a message of the caller; None after its last one."""
        then, self._then = self._then, None
        assert then is not None, f"{self.method} waits for no message: {self.code} {self.details}"
        then(message)

    @override
    def peer(self) -> str:
        return "ipv4:127.0.0.1:40000"

    @override
    def certificate_name(self) -> str | None:
        return None

    @override
    def watch(self, on_cancel: Callable[[], object]) -> None:
        """Its caller never gives up."""

    @override
    def receive(self, then: Callable[[bytes | None], object]) -> None:
        self._then = then

    @override
    def begin(self) -> None:
        """Nothing is sent for this."""

    @override
    def send(self, message: bytes, then: Callable[[bool], object]) -> None:
        self.sent.append(message)
        then(True)

    @override
    def finish(
        self,
        message: bytes | None = None,
        code: grpc.StatusCode = grpc.StatusCode.OK,
        details: str = "",
        metadata: Metadata = (),
    ) -> None:
        self.is_finished, self.code, self.details = True, code, details
        if message is not None:
            self.sent.append(message)
