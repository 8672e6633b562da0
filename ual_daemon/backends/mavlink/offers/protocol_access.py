"""Access of the services other than flying to the thread that receives."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple, Protocol, TypeVar

from ual.errors import UalError
from ual_daemon.backends import futures
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.payload_messages import PayloadMessages
from ual_daemon.backends.mavlink.session.session import MavlinkSession

T = TypeVar("T")


class Give(Protocol):
    """Returns a future that `begin` has something end, on the thread that receives."""

    def __call__(self, what: str, begin: Callable[[Discovery, Future[T]], object], /) -> Future[T]:
        """See `Loop.run_on_loop`."""
        ...


class Orders(NamedTuple):
    """The way of orders that are commands.

    Attributes:
        reach: The way to the protocols.
        give: Passes a command to the autopilot, with a human-readable name.
        messages: The messages that it receives, besides those that the session needs.

    """

    reach: ProtocolAccess
    give: Callable[[str, LongCommand], Future[None]]
    messages: PayloadMessages


class ProtocolAccess(NamedTuple):
    """The way from any thread to the protocols.

    Attributes:
        session: Returns the session, in reach or not; None before there was one.
        session_in_reach: Returns the session that is in reach, or why none is.
        post: Has something done on the thread that receives.
        give_it: Returns a future that is ended there.

    """

    session: Callable[[], MavlinkSession | None]
    session_in_reach: Callable[[str], MavlinkSession | UalError]
    post: Callable[[Callable[[Discovery], None]], None]
    give_it: Give

    def run_on_loop(self, what: str, begin: Callable[[Protocols, Future[T]], None]) -> Future[T]:
        """Returns a future that `begin` has something end, on the thread that receives. `what` is human-readable."""
        session = self.session_in_reach(what)
        if isinstance(session, UalError):
            return futures.failed(session)
        return self.give_it(what, lambda discovery, future: begin(discovery.protocols, future))
