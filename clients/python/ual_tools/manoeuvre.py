"""Runs a manoeuvre: shows its progress, handles Ctrl-C, and prints how it ended."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

from ual.errors import WrongStateError
from ual.interface import Task
from ual.types import Plan, State
from ual_tools import plot, progress
from ual_tools.output import plan_text, task_text
from ual_tools.session import INTERRUPTED_STATUS, CommandSession, note

if TYPE_CHECKING:
    from ual import Uav

STANDING = (State.LANDED_ARMED, State.LANDED_DISARMED)
CANCELLED = "cancelled: the UAV holds its position"


def wait_for(
    session: CommandSession,
    uav: Uav,
    fly: Callable[[], Task],
    plot_file: Path | None = None,
    *,
    interrupted: str = CANCELLED,
) -> None:
    """Calls `fly`, shows the progress, and prints how it ended. Prints `interrupted` after Ctrl-C.

    With `plot_file` draws the flown path and the wanted one, however the manoeuvre ended.
    """
    try:
        with _shown(session, uav), plot.drawn(uav, plot_file):
            task = fly()
    except KeyboardInterrupt:
        interrupt(interrupted)
    info = task.info()
    session.emit(info, task_text(info))


def standing_is_done(session: CommandSession, what: str) -> AbstractContextManager[None]:
    """Takes it for done that a UAV of several stands already, where `what` is to end its flight."""
    return already_done(session, what, STANDING)


@contextmanager
def already_done(session: CommandSession, what: str, wanted: Collection[State]) -> Iterator[None]:
    """Takes it for done that a UAV of several has a wanted state already, in which `what` is refused.

    A single one that is told to land on the ground may be another than was meant: there it stays refused.
    """
    try:
        yield
    except WrongStateError as error:
        if session.member is None or error.state not in {state.name for state in wanted}:
            raise
        session.emit({"done": what, "state": error.state}, f"stands on the ground already ({error.state})")


def _shown(session: CommandSession, uav: Uav) -> AbstractContextManager[None]:
    if session.member is None:
        return progress.shown(uav)
    session.member.is_flying = True
    return nullcontext()


def interrupt(text: str) -> NoReturn:
    """Prints a message and ends the program with the exit status of an interruption."""
    note(f"ual: {text}")
    raise click.exceptions.Exit(INTERRUPTED_STATUS)


def print_plan(session: CommandSession, plan: Plan) -> None:
    """Prints the result of a dry run."""
    session.emit(plan, plan_text(plan))
