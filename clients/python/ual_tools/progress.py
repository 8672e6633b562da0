"""Shows the progress of a manoeuvre on a terminal: state, distance left, time. Shows nothing without a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ual.types import Telemetry

if TYPE_CHECKING:
    from ual import Uav

_TELEMETRY_RATE_HZ = 5.0


@contextmanager
def shown(uav: Uav) -> Iterator[None]:
    """Shows the progress during the block, on stderr if that is a terminal."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[left]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        shown_task = bar.add_task(uav.ns, total=None, left="")

        def show(telemetry: Telemetry) -> None:
            task = telemetry.task
            progress = None if task is None else task.progress
            left = None if task is None else task.distance_left_m
            bar.update(
                shown_task,
                description=f"{_doing(telemetry):<15}",
                total=None if progress is None else 1.0,
                completed=0.0 if progress is None else progress,
                left="" if left is None else f"{left:6.2f} m left",
            )

        with uav.subscribe(show, _TELEMETRY_RATE_HZ):
            yield


def _doing(telemetry: Telemetry) -> str:
    task = telemetry.task
    return "paused" if task is not None and task.is_paused else telemetry.state.name
