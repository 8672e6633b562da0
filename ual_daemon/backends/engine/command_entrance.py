"""Takes commands from any thread, and gives them to the runner on the loop's thread."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Generic, Protocol, TypeVar

from ual.errors import UalError, UalTimeoutError
from ual_daemon.backends import futures
from ual_daemon.backends.base import Clock
from ual_daemon.backends.command_snapshot import command_snapshot
from ual_daemon.backends.engine.command import Command, NotYetError
from ual_daemon.backends.engine.command_runner import CommandContext
from ual_daemon.backends.engine.contained import defect
from ual_daemon.backends.engine.limits import TEMPORARY_REFUSAL_S, UNSENT_COMMAND_S
from ual_daemon.backends.engine.loop import Loop

R = TypeVar("R")


class Submits(Protocol[R]):
    """A `CommandRunner`, or what stands before it."""

    def submit(self, command: Command[R], now_s: float, result: Future[None], asked: CommandContext) -> Future[None]:
        """See `CommandRunner.submit`."""
        ...


class CommandEntrance(Generic[R]):
    """Entrance of a `Backend`'s commands. From any thread.

    `access` takes the command's words for errors, and returns the runner of the vehicle, or the error that says
    why there is none. It may return another one later, as a vehicle may be replaced.
    """

    def __init__(self, loop: Loop, clock: Clock, access: Callable[[str], Submits[R] | UalError]) -> None:
        self._loop = loop
        self._clock = clock
        self._access = access

    def give(self, what: str, make: Callable[[], Command[R]]) -> Future[None]:
        """Has a command made and sent on the loop's thread. The future ends there; see `CommandRunner.submit`.

        `make` may raise a `UalError`, which ends the future. The mode that the caller saw counts as the one from which
        the command leads: a later change is not overruled.
        """
        runner = self._access(what)
        if isinstance(runner, UalError):
            return futures.failed(runner)
        asked = CommandContext.at(self._clock.now_s(), command_snapshot() or self._loop.newest)
        return self._loop.run_on_loop(what, partial(self._submit, what, make, asked))

    def _submit(
        self, what: str, make: Callable[[], Command[R]], asked: CommandContext, result: Future[None], now_s: float
    ) -> None:
        if result.cancelled():
            return
        try:
            self._require_runner(what, asked, now_s).submit(make(), now_s, result, asked)
        except UalError as error:
            if isinstance(error, NotYetError) and now_s - asked.time_s < TEMPORARY_REFUSAL_S:
                self._loop.retry(partial(self._submit, what, make, asked, result))
            else:
                futures.end(result, error)
        except Exception as error:  # noqa: BLE001  logged, and raised to the caller: the link goes on
            futures.end(result, defect(what, error))

    def _require_runner(self, what: str, asked: CommandContext, now_s: float) -> Submits[R]:
        if now_s - asked.time_s > UNSENT_COMMAND_S:
            raise UalTimeoutError(f"the command to {what} was not sent: this computer had no time for it")
        runner = self._access(what)
        if isinstance(runner, UalError):
            raise runner
        return runner
