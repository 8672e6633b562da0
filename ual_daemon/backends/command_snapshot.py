"""The snapshot on which the caller based a command, and so the mode that the caller knew.

Between that and the command the safety pilot may take over. What the backend has heard of that must not count as known
to the caller, or the command would overrule the pilot.
"""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from typing import TypeVar

from ual_daemon.backends.values import Snapshot

T = TypeVar("T")

_snapshot: ContextVar[Snapshot | None] = ContextVar("ual_judged", default=None)


def call_with_snapshot(snapshot: Snapshot, command: Callable[[], T]) -> T:
    """Calls what commands the backend, by a snapshot in which that was assessed."""
    token = _snapshot.set(snapshot)
    try:
        return command()
    finally:
        _snapshot.reset(token)


def command_snapshot() -> Snapshot | None:
    """Returns the snapshot by which the present command was assessed; None for the newest one."""
    return _snapshot.get()
