"""Completes values in a shell: namespaces, frames, faults, checks. Says nothing where a daemon does not answer."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeVar

import click
from click.shell_completion import CompletionItem

from ual.errors import UalError

if TYPE_CHECKING:
    from ual._calls import Call

_PATIENCE_S = 1.0
"""A shell waits for the completion, so a daemon that does not answer by then is left out."""

T = TypeVar("T")


def namespaces(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the names of the UAVs of this computer."""
    from ual import _discovery

    return _items((each.ns for each in _discovery.list_daemons()), incomplete)


def frames(context: click.Context, _: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the names of the frames of the chosen UAV."""
    from ual import _calls

    return _items((each.frame_id for each in _asked(context, _calls.list_frames(), [])), incomplete)


def faults(context: click.Context, _: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the identifiers of the active faults of a simulated UAV."""
    from ual import _calls

    found = _asked(context, _calls.list_faults(), {})
    return _items(found, incomplete)


def checks(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """Completes the names of the conformance checks."""
    from ual import conformance

    return _items((each.name for each in conformance.CHECKS), incomplete)


def _asked(context: click.Context, call: Call[T], otherwise: T) -> T:
    """Returns the answer of the chosen UAV, or `otherwise` if there is none."""
    from ual._connection import Connection
    from ual._target import Target
    from ual_tools.app import session

    chosen = session(context)
    try:
        connection = Connection(Target(chosen.ns, chosen.address, chosen.tls_ca, chosen.credentials))
    except UalError:
        return otherwise
    try:
        return connection.run(call, _PATIENCE_S)
    except UalError:
        return otherwise
    finally:
        connection.close()


def _items(names: Iterable[str], incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(name) for name in names if name.startswith(incomplete)]
