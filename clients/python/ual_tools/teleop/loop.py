"""Flies until the operator leaves: reads the device at a fixed rate, draws the screen, and stops the UAV at any end."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, NoReturn, Protocol

from ual_tools.keys import TerminalKeys
from ual_tools.teleop import board
from ual_tools.teleop.echo import Echo
from ual_tools.teleop.pilot import Pilot
from ual_tools.teleop.screen import Screen, screen
from ual_tools.terminal import keyboard
from ual_tools.watch_screen import as_text

if TYPE_CHECKING:
    from rich.console import RenderableType

LOOP_PERIOD_S = 0.05
"""Ten velocities within the daemon's time-out."""
LATE_LOOP_S = 0.5
"""After such a pause (a process that was suspended) the daemon has stopped the UAV. What was pressed meanwhile must not
start it again."""
SLOW_LINK_S = 1.0
"""Delay in s of a terminal's answer or picture (a slow link) at which the operator no longer sees the UAV, and a
released key still flies.
"""
_LATE = "sticks: released, because the terminal is slow, or the process was suspended"
_ANSWER_S = 0.5
_DRAW_S = 0.2
"""A screen is some 2 kB: 10 kB/s over SSH."""
_HUNG_UP_STATUS = 129
"""The exit status of a program that SIGHUP ends."""


class Controls(Protocol):
    """A device, with what its keys and buttons mean."""

    @property
    def title(self) -> str:
        """Name on the screen."""
        ...

    @property
    def help(self) -> Sequence[tuple[str, str]]:
        """Keys or buttons, and what each does in a few words."""
        ...

    def question(self, now_s: float) -> str:
        """Returns what is to be confirmed; empty if nothing is."""
        ...

    def forget(self) -> None:
        """Forgets what was held."""
        ...

    def control(self, pilot: Pilot, read: bytes, now_s: float, *, is_late: bool) -> None:
        """Does what the device says.

        Args:
            pilot: Executes the commands.
            read: What the terminal has sent since the last call.
            now_s: When (monotonic).
            is_late: Whether it may have waited for a while. Then it can only end a motion.

        """
        ...


def fly(pilot: Pilot, controls: Controls, say: Callable[[str], None]) -> None:
    """Flies until the operator quits, and says what became of the UAV.

    Ctrl-Z stops the UAV and suspends; resumed, all sticks are centred.

    Raises:
        KeyboardInterrupt: Ctrl-C. The UAV was stopped, as by any other exception.
        SystemExit: SIGTERM, or the terminal is gone.

    """
    with _suspension() as suspension, _exit_at_hangup():
        while not pilot.has_quit:
            controls.forget()
            _fly_on_screen(pilot, controls, suspension, say)
            suspension.suspend()


def _fly_on_screen(pilot: Pilot, controls: Controls, suspension: _Suspension, say: Callable[[str], None]) -> None:
    message, echo = "", Echo()
    try:
        with keyboard() as keys, screen() as shown:
            try:
                _loop(pilot, controls, keys, shown, echo, suspension)
            finally:
                message = pilot.stop()  # before the terminal is restored, which may take long
                _await_answer(keys, echo)
    except OSError:  # it takes no output any more
        raise SystemExit(_HUNG_UP_STATUS) from None
    finally:
        if message:
            say(message)


def _loop(
    pilot: Pilot, controls: Controls, keys: TerminalKeys, shown: Screen, echo: Echo, suspension: _Suspension
) -> None:
    last_s = drawn_s = time.monotonic() - LOOP_PERIOD_S
    while not (pilot.has_quit or suspension.is_asked):
        read = keys.read(max(0.0, last_s + LOOP_PERIOD_S - time.monotonic()))
        now_s = time.monotonic()
        read = echo.filtered(read, now_s)
        is_late = now_s - last_s > LATE_LOOP_S or max(shown.stuck_s(), echo.lag_s(now_s)) > SLOW_LINK_S
        if is_late:
            pilot.release(_LATE)
        controls.control(pilot, read, now_s, is_late=is_late)
        last_s = now_s
        if keys.is_gone or shown.is_gone:
            raise SystemExit(_HUNG_UP_STATUS)
        if now_s - drawn_s >= _DRAW_S:
            shown.show(_picture(pilot, controls, shown), is_asking=echo.asks(now_s))
            drawn_s = now_s


def _await_answer(keys: TerminalKeys, echo: Echo) -> None:
    """Takes the answer of the terminal that is still to come, or the shell would take it for input."""
    end_s = time.monotonic() + _ANSWER_S
    while echo.is_awaited and not keys.is_gone and (left_s := end_s - time.monotonic()) > 0.0:
        echo.filtered(keys.read(left_s), time.monotonic())


def _picture(pilot: Pilot, controls: Controls, shown: Screen) -> RenderableType:
    width, height = shown.size
    view = pilot.view()
    question = controls.question(view.now_s)
    return as_text(board.screen_rows(view, controls.title, controls.help, question, width=width, height=height))


class _Suspension:
    """Whether Ctrl-Z was pressed."""

    def __init__(self) -> None:
        self.is_asked = False

    def ask(self, _: int, __: FrameType | None) -> None:
        """Handles SIGTSTP."""
        self.is_asked = True

    def suspend(self) -> None:
        """Suspends the process, if that was asked. Returns when it is resumed."""
        if not self.is_asked:
            return
        self.is_asked = False
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        signal.pthread_kill(threading.get_ident(), signal.SIGTSTP)
        signal.signal(signal.SIGTSTP, self.ask)


@contextmanager
def _suspension() -> Iterator[_Suspension]:
    suspension = _Suspension()
    if not hasattr(signal, "SIGTSTP"):  # Windows suspends nothing
        yield suspension
        return
    before = signal.signal(signal.SIGTSTP, suspension.ask)
    try:
        yield suspension
    finally:
        signal.signal(signal.SIGTSTP, before)


@contextmanager
def _exit_at_hangup() -> Iterator[None]:
    if not hasattr(signal, "SIGHUP"):  # nor does it hang up
        yield
        return
    before = signal.signal(signal.SIGHUP, _hang_up)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)


def _hang_up(_: int, __: FrameType | None) -> NoReturn:
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # another one must not interrupt the stop
    raise SystemExit(_HUNG_UP_STATUS)
