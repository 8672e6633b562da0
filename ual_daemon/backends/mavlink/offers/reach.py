"""How what is offered beside flying reaches the thread that receives."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import NamedTuple, TypeVar

from ual.errors import UalError
from ual_daemon.backends import futures
from ual_daemon.backends.engine.contained import defect
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.session import Session

T = TypeVar("T")


class Reach(NamedTuple):
    """The way from any thread to the protocols.

    Attributes:
        session: Returns the session, in reach or not; None before there was one.
        session_in_reach: Returns the session that is in reach, or why none is.
        post: Has something done on the thread that receives.

    """

    session: Callable[[], Session | None]
    session_in_reach: Callable[[str], Session | UalError]
    post: Callable[[Callable[[Discovery], None]], None]

    def give(self, what: str, begin: Callable[[Protocols, Future[T]], None]) -> Future[T]:
        """Returns a future that `begin` has something end, on the thread that receives. `what` is human-readable."""
        future: Future[T] = Future()
        session = self.session_in_reach(what)
        if isinstance(session, UalError):
            future.set_exception(session)
        else:
            self.post(lambda discovery: _begin(what, begin, discovery.protocols, future))
        return future


def _begin(what: str, begin: Callable[[Protocols, Future[T]], None], protocols: Protocols, future: Future[T]) -> None:
    """Begins it. A defect ends the future, and not the link on whose thread this runs."""
    try:
        begin(protocols, future)
    except Exception as error:  # noqa: BLE001 - logged, and raised to the caller
        futures.fail(future, defect(what, error))
