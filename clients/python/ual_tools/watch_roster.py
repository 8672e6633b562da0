"""Subscribes to the chosen UAVs of this computer, also to those whose daemons start later, until their daemons end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from ual.discovery import Registration
from ual.errors import UalError
from ual.shared.guard import WorkGuard
from ual_tools.output import error_text
from ual_tools.selection import chosen_daemons
from ual_tools.session import CommandSession, note
from ual_tools.watch_board import Board

if TYPE_CHECKING:
    from ual import Uav

_SCAN_S = 1.0
_RETRY_S = 1.0
_CLOSE_TIMEOUT_S = 2.0


@contextmanager
def all_subscribed(session: CommandSession, board: Board, rate_hz: float, *, is_quiet: bool) -> Iterator[None]:
    """Subscribes to all UAVs while the block runs. Unless it is quiet, it notes on stderr what goes wrong."""
    with kept_up_to_date(WatchRoster(session, board, rate_hz, (lambda _: None) if is_quiet else note)):
        yield


@contextmanager
def kept_up_to_date(roster: WatchRoster) -> Iterator[None]:
    """Looks for daemons that appear or end, repeatedly, while the block runs. Then it closes the roster."""
    roster.update()
    is_closing, guard = threading.Event(), WorkGuard("roster")

    def scan() -> None:
        while not is_closing.wait(_SCAN_S):
            guard.contain(roster.refresh)

    scanner = threading.Thread(target=scan, daemon=True)
    scanner.start()
    try:
        yield
    finally:
        is_closing.set()
        scanner.join(_CLOSE_TIMEOUT_S)
        roster.close()


class WatchRoster:
    """One subscription for each daemon, each on a thread of its own: one that does not answer delays no other.

    Args:
        session: Its options are those of each connection.
        board: Where the samples go.
        rate_hz: How many samples of each come in a second; 0: every one.
        say: Takes what goes wrong, human-readable.
        choose: Returns the daemons. When not given, they are those of this computer that were chosen.
        attend: Is called with each UAV once it is subscribed to, and returns when the event is set.

    """

    def __init__(
        self,
        session: CommandSession,
        board: Board,
        rate_hz: float,
        say: Callable[[str], None],
        choose: Callable[[], Sequence[Registration]] | None = None,
        attend: Callable[[str, Uav, threading.Event], None] | None = None,
    ) -> None:
        self._session = session
        self._board = board
        self._rate_hz = rate_hz
        self._say = say
        self._choose = choose or partial(chosen_daemons, session)
        self._attend = attend or _wait
        self._threads: dict[Registration, tuple[threading.Thread, threading.Event]] = {}
        self._is_blind = False

    def update(self) -> None:
        """Begins a subscription to each daemon that has appeared, and ends those of daemons that have ended."""
        daemons = dict.fromkeys(self._choose())  # one that was started again is another one
        for daemon in self._threads.keys() - daemons.keys():
            _, is_ended = self._threads.pop(daemon)
            is_ended.set()
            self._board.remove(daemon.ns)
            self._say(f"ual: {daemon.ns}: its daemon has ended")
        for daemon in daemons:
            if daemon not in self._threads:
                self._board.add(daemon.ns)
                is_ended = threading.Event()
                thread = threading.Thread(target=self._subscribe, args=(daemon, is_ended), daemon=True)
                self._threads[daemon] = (thread, is_ended)
                thread.start()

    def refresh(self) -> None:
        """Updates. Where the daemons cannot be looked for (no file descriptor is left), those that are known stay."""
        try:
            self.update()
        except OSError as error:
            if not self._is_blind:
                self._say(f"ual: daemons that begin or end are not seen now: {error.strerror}")
            self._is_blind = True
        else:
            self._is_blind = False

    def close(self) -> None:
        """Ends all subscriptions. A thread that still waits for an answer ends with the process."""
        for _, is_ended in self._threads.values():
            is_ended.set()
        end_s = time.monotonic() + _CLOSE_TIMEOUT_S
        for thread, _ in self._threads.values():
            thread.join(max(0.0, end_s - time.monotonic()))

    def _subscribe(self, daemon: Registration, is_ended: threading.Event) -> None:
        is_noted = False
        while not is_ended.is_set():
            try:
                with (
                    self._session.connect_to(daemon) as uav,
                    uav.subscribe(partial(self._board.put, daemon.ns), self._rate_hz),
                ):
                    self._attend(daemon.ns, uav, is_ended)
            except UalError as error:
                self._board.put_error(daemon.ns, error)
                if not is_noted:
                    self._say(f"ual: {daemon.ns}: {error_text(error)}")
                is_noted = True
                is_ended.wait(_RETRY_S)


def _wait(_ns: str, _uav: Uav, is_ended: threading.Event) -> None:
    is_ended.wait()
