"""The parameters of a MAVLink autopilot: what any thread asks for goes to the thread that receives."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from typing_extensions import override

from ual.errors import UalError
from ual.parameters.values import Parameter
from ual_daemon.backends.mavlink.protocols.parameter_transfers import ParameterTransfers
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.session import Session
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal

T = TypeVar("T")


class MavlinkParameters(AutopilotParameters):
    """The parameters of one backend.

    Args:
        session: Returns the session, in reach or not; None before there was one.
        reach: Returns the session that is in reach, or why none is.
        post: Has something done on the thread that receives.

    """

    def __init__(
        self,
        session: Callable[[], Session | None],
        reach: Callable[[str], Session | UalError],
        post: Callable[[Callable[[Discovery], None]], None],
    ) -> None:
        self._session = session
        self._reach = reach
        self._post = post

    @property
    @override
    def relied_on(self) -> frozenset[str]:
        session = self._session()
        if session is None:
            return frozenset()
        return session.dialect.failsafe_parameters.union(session.dialect.parameters)

    @override
    def read(self, name: str) -> Future[Parameter]:
        return self._give("read its parameters", lambda transfers, future: transfers.read(name, future))

    @override
    def read_all(self) -> Future[list[Parameter]]:
        return self._give("read its parameters", ParameterTransfers.read_all)

    @override
    def write(self, parameter: Parameter, refusal: Refusal) -> Future[Parameter]:
        return self._give("write a parameter", lambda transfers, future: transfers.write(parameter, refusal, future))

    def _give(self, what: str, begin: Callable[[ParameterTransfers, Future[T]], None]) -> Future[T]:
        future: Future[T] = Future()
        session = self._reach(what)
        if isinstance(session, UalError):
            future.set_exception(session)
        else:
            self._post(lambda discovery: begin(discovery.protocols.parameters, future))
        return future
