"""Interface of the transports: they serve gRPC on addresses, and hand over each call as a `ServedCall`.

All callbacks of a transport come from one thread: for `aio` it is the event loop's, for `core` another one. They must
not block.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Protocol, TypeAlias

import grpc

Metadata: TypeAlias = Sequence[tuple[str, str | bytes]]
Options: TypeAlias = Sequence[tuple[str, int]]
MakeCredentials: TypeAlias = Callable[[], grpc.ServerCredentials]
"""TLS for one address: called once for each that is opened."""


class ServedCall(Protocol):
    """One call: what is received and sent in it, as bytes.

    Its methods may be called from any thread. One `receive` and one `send` may be in progress at the same time.
    """

    method: str
    """``/package.Service/Method``."""
    metadata: Metadata
    """Headers that the caller sent before its messages."""
    identity: str = ""
    """Identity of the caller, once it is known: see `ual_daemon.server.access`."""
    lease_id: str = ""
    """The lease by which the caller commands; empty where it has none."""
    is_finished: bool
    """Whether `finish` was called."""
    is_cancelled: bool
    """Whether the caller has given up or vanished, or its deadline passed. Set for calls that are watched."""

    @abstractmethod
    def peer(self) -> str:
        """Returns the caller's address as gRPC writes it. Call it once before the call ends; later it is remembered."""

    @abstractmethod
    def certificate_name(self) -> str | None:
        """Returns the name in the TLS certificate that the caller has shown; None where it has shown none."""

    @abstractmethod
    def watch(self, on_cancel: Callable[[], object]) -> None:
        """Calls back if it is cancelled. To be called once at most, for calls that may take a while."""

    @abstractmethod
    def receive(self, then: Callable[[bytes | None], object]) -> None:
        """Calls back with the next message of the caller, or with None after its last one."""

    @abstractmethod
    def begin(self) -> None:
        """Sends the initial metadata now instead of with the first message."""

    @abstractmethod
    def send(self, message: bytes, then: Callable[[bool], object]) -> None:
        """Sends a message, and calls back when the next may be sent: with True if this one went out, else with False.

        Does nothing, and does not call back, once the call is finished.
        """

    @abstractmethod
    def finish(
        self,
        message: bytes | None = None,
        code: grpc.StatusCode = grpc.StatusCode.OK,
        details: str = "",
        metadata: Metadata = (),
    ) -> None:
        """Ends the call, with a last message or with an error. Only the first call of it has an effect."""


def name_of_certificate(context: Mapping[str, Iterable[bytes]]) -> str | None:
    """Returns the name in the certificate of gRPC's authentication context: its common name, else its first other."""
    for key in ("x509_common_name", "x509_subject_alternative_name"):
        for name in context.get(key, ()):
            return name.decode(errors="replace")
    return None


class TransportServer(Protocol):
    """One server of a transport. To be used on the event loop that ran when it was made."""

    @abstractmethod
    def listen(self, address: str, credentials: MakeCredentials | None = None) -> int:
        """Opens an address, before `start`; with TLS where there are credentials. Returns its port, if it has one.

        Raises:
            RuntimeError: The address cannot be opened.

        """

    @abstractmethod
    async def start(self) -> None:
        """Begins to take calls."""

    @abstractmethod
    async def stop(self, grace_s: float) -> bool:
        """Takes no more calls, and waits for those that were taken.

        Those that still run after `grace_s` are cancelled, and waited for as long again. Returns whether all ended.
        Where they have not, it may be called again, only to wait longer.
        """


class Transport(Protocol):
    """One way to serve gRPC. The servers of a process share it."""

    name: str
    """As the setting `transport` names it."""
    is_on_loop: bool
    """Whether its callbacks come on the event loop. Then each message that another thread sends has to wake that."""

    @abstractmethod
    def server(self, options: Options, take: Callable[[ServedCall], None]) -> TransportServer:
        """Makes a server, with gRPC's options, that hands each call to `take`."""

    @abstractmethod
    def close(self) -> None:
        """Ends it, after its servers have stopped. Not to be called from a callback."""
