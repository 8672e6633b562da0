"""The firmware's parameters: what any thread requests goes to the engine's thread."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeVar

from typing_extensions import override

from ual.errors import LinkLostError
from ual.parameters.values import Parameter
from ual_daemon.backends import futures
from ual_daemon.backends.crazyflie.connecting import ALWAYS_SET, READ
from ual_daemon.backends.crazyflie.parameter_exchanges import ParameterExchanges
from ual_daemon.backends.crazyflie.session import CrazyflieSession
from ual_daemon.backends.offers.parameters import AutopilotParameters, Refusal

T = TypeVar("T")


class CrazyflieParameters(AutopilotParameters):
    """The parameters of one backend. `session` returns its session; None before there is one."""

    relied_on = frozenset((*READ, *ALWAYS_SET))

    def __init__(self, session: Callable[[], CrazyflieSession | None]) -> None:
        self._session = session

    @override
    def read(self, name: str) -> Future[Parameter]:
        return self._run_on_loop(lambda exchanges, future: exchanges.read(name, future))

    @override
    def read_all(self) -> Future[list[Parameter]]:
        return self._run_on_loop(ParameterExchanges.read_all)

    @override
    def write(self, parameter: Parameter, refusal: Refusal) -> Future[Parameter]:
        return self._run_on_loop(lambda exchanges, future: exchanges.write(parameter, refusal, future))

    def _run_on_loop(self, begin: Callable[[ParameterExchanges, Future[T]], None]) -> Future[T]:
        what, session = "exchange parameters", self._session()
        if session is None or not session.is_connected:
            return futures.failed(LinkLostError(f"cannot {what}: no Crazyflie is connected"))
        return session.loop.run_on_loop(what, lambda future, _: begin(session.parameters, future))
