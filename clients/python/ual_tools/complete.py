"""Completes values in a shell: namespaces, frames, faults, checks. Says nothing where a daemon does not answer."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from ual.errors import UalError
from ual_tools.session import session

if TYPE_CHECKING:
    from ual.interface import Uav

_QUERY_TIMEOUT_S = 1.0
"""A shell waits for the completion, so a daemon that does not answer by then is left out."""


def namespaces(context: click.Context, _: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the names of the UAVs of this computer, or of the network."""
    chosen = session(context)
    try:
        chosen.settle()
        return _items((each.ns for each in chosen.daemons()), incomplete)
    except UalError:
        return []


def frames(context: click.Context, _: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the names of the frames of the chosen UAV."""
    return _items(_answer_of_uav(context, lambda uav: [each.frame_id for each in uav.frames()]), incomplete)


def faults(context: click.Context, _: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the identifiers of the active faults of a simulated UAV."""
    return _items(_answer_of_uav(context, lambda uav: list(uav.simulation.faults())), incomplete)


def checks(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the names of the conformance checks."""
    from ual import conformance

    return _items((each.name for each in conformance.CHECKS), incomplete)


def _answer_of_uav(context: click.Context, ask: Callable[[Uav], list[str]]) -> list[str]:
    """Returns the answer of the chosen UAV; nothing where there is none in time."""
    chosen = session(context)
    try:
        chosen.settle()
        with chosen.connect(with_lease=False) as uav:
            end = threading.Timer(_QUERY_TIMEOUT_S, uav.close)
            end.start()
            try:
                return ask(uav)
            finally:
                end.cancel()
    except UalError:
        return []


def _items(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in names if name.startswith(incomplete)]
