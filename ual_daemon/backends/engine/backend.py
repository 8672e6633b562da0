"""Base class of backends on the engine: what every one of them would repeat."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Generic, TypeVar

from typing_extensions import override

from ual.errors import LinkLostError
from ual_daemon.backends import futures
from ual_daemon.backends.base import Backend
from ual_daemon.backends.engine.command import Command
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.engine.loop import Loop
from ual_daemon.backends.values import LinkReport, Snapshot

R = TypeVar("R")
T = TypeVar("T")


class EngineBackend(Backend, Generic[R]):
    """Backend whose data pass through the engine's loop, and whose commands, with requests of type `R`, through its
    command entrance. A subclass sets `_loop` and `_entrance` once it has them, at the latest in `open`.
    """

    _loop: Loop | None = None
    _entrance: CommandEntrance[R] | None = None
    _offers: tuple[object, ...] = ()
    """Offers besides flying, each for another kind of service."""

    @override
    def snapshot(self) -> Snapshot:
        now_s, loop = self.clock.now_s(), self._loop
        return Snapshot(now_s) if loop is None else loop.newest.at(now_s)

    @override
    def newest(self) -> tuple[Snapshot, float]:
        return Snapshot(0.0) if self._loop is None else self._loop.newest, self.clock.now_s()

    @override
    def link(self) -> LinkReport:
        return LinkReport() if self._loop is None else self._loop.link()

    @override
    def offer(self, kind: type[T]) -> T | None:
        return next((each for each in self._offers if isinstance(each, kind)), None)

    def _order(self, what: str, make: Callable[[], Command[R]]) -> Future[None]:
        """Has a command made and sent on the loop's thread; its future ends there. See `CommandEntrance.give`."""
        return futures.failed(self._unreached(what)) if self._entrance is None else self._entrance.give(what, make)

    def _unreached(self, what: str) -> LinkLostError:
        """Returns why there is nobody to `what`: "take off"."""
        return LinkLostError(f"cannot {what}: no autopilot is heard")
