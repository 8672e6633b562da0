"""A manoeuvre from its begin to its end: its progress, Ctrl-C, and how it ended."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

import click

from ual._cli import plot, progress
from ual._cli.app import INTERRUPTED, Session, note
from ual._cli.output import plan_text, task_text
from ual.interface import Task
from ual.types import Plan

if TYPE_CHECKING:
    from ual._client import Uav

CANCELLED = "cancelled: the UAV holds its position"


def wait_for(
    session: Session, uav: Uav, fly: Callable[[], Task], plot_file: Path | None = None, *, interrupted: str = CANCELLED
) -> None:
    """Shows the progress while it flies, and prints how that ended; `interrupted` is said after Ctrl-C.

    With `plot_file` the flown line is drawn against the wanted one, however it ended.
    """
    try:
        with progress.shown(uav), plot.drawn(uav, plot_file):
            task = fly()
    except KeyboardInterrupt:
        interrupt(interrupted)
    info = task.info()
    session.emit(info, task_text(info))


def interrupt(text: str) -> NoReturn:
    """Ends the program as interrupted."""
    note(f"ual: {text}")
    raise click.exceptions.Exit(INTERRUPTED)


def say(session: Session, plan: Plan) -> None:
    """Prints what a dry run says."""
    session.emit(plan, plan_text(plan))
