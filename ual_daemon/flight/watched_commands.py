"""Commands to the autopilot that are not manoeuvres (arming, disarming), watched until their effect shows."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future

from ual.errors import LinkLostError, UalError
from ual_daemon import logs
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.futures import end_future, running_future
from ual_daemon.flight.refusals import shutting_down
from ual_daemon.flight.state import Estimate

_log = logging.getLogger(__name__)


class _Watched:
    """A command, the condition that shows its effect, and the future that ends then."""

    def __init__(self, command: AutopilotCommand, is_done: Callable[[Snapshot], bool], *, is_callers: bool) -> None:
        self.command = command
        self.is_done = is_done
        self.is_callers = is_callers
        self.future = running_future()

    def end(self, error: UalError | None) -> None:
        """Withdraws the command and ends the future. Runs the callbacks of the future, so hold no lock."""
        self.command.withdraw()
        end_future(self.future, error)


class WatchedCommands:
    """The watched commands of one UAV. Any thread may call any member, except `step`: only the update thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watched: tuple[_Watched, ...] = ()
        self._is_closed = False

    @property
    def is_empty(self) -> bool:
        """Whether no command is watched."""
        return not self._watched

    def add(
        self, command: AutopilotCommand, is_done: Callable[[Snapshot], bool], *, is_callers: bool = False
    ) -> Future[None]:
        """Watches a command. The future ends when `is_done` holds, or with the error by which the command failed.

        `is_callers` says whether a caller has given it, so that it ends with the lease (`end_callers`).

        Raises:
            WrongStateError: UAL is shutting down.

        """
        watched = _Watched(command, is_done, is_callers=is_callers)
        with self._lock:
            if self._is_closed:
                raise shutting_down(command.what)
            self._watched = (*self._watched, watched)
        return watched.future

    def refuse_new(self) -> None:
        """Refuses new commands from now on."""
        with self._lock:
            self._is_closed = True

    def end_all(self, error: UalError) -> None:
        """Ends all commands with an error, and refuses new ones."""
        with self._lock:
            ended, self._watched, self._is_closed = self._watched, (), True
        for watched in ended:
            watched.end(error)

    def end_callers(self, error: UalError, snapshot: Snapshot) -> None:
        """Ends the commands of callers that show no effect yet, with an error: they are not sent any more."""
        for watched in self._watched:
            if watched.is_callers and not watched.is_done(snapshot) and self._remove(watched):
                watched.end(watched.command.left_behind(error))

    def drop(self, command: AutopilotCommand) -> None:
        """Forgets a command that was not sent. Nobody waits for it yet."""
        with self._lock:
            self._watched = tuple(each for each in self._watched if each.command is not command)

    def step(self, snapshot: Snapshot, estimate: Estimate) -> None:
        """Ends the commands whose effect shows in a snapshot, and those that failed: with a lost link, all did."""
        for watched in self._watched:
            is_done = estimate.is_link_up and watched.is_done(snapshot)
            error = None if is_done else _failure(watched.command, snapshot, estimate)
            if (is_done or error is not None) and self._remove(watched):
                if error is not None:
                    logs.event(_log, logging.WARNING, "command_failed", reason=error.reason, why=str(error))
                watched.end(error)

    def _remove(self, watched: _Watched) -> bool:
        """Returns whether it was still there: `end_all` may have ended it on another thread."""
        with self._lock:
            if watched not in self._watched:
                return False
            self._watched = tuple(other for other in self._watched if other is not watched)
            return True


def _failure(command: AutopilotCommand, snapshot: Snapshot, estimate: Estimate) -> UalError | None:
    if not estimate.is_link_up:
        return LinkLostError(f"{command.what}: {estimate.why}", {"state": estimate.state.name})
    return command.failure(snapshot)
