"""Structured logs: events with fields. `ual_daemon.program.log_output` writes them as text or as JSON."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ual.errors import UalError

caller: ContextVar[Callable[[], str] | None] = ContextVar("ual_caller", default=None)
"""Returns the address of the peer that gave the present command; None for a command from this process."""

uav: ContextVar[str] = ContextVar("ual_uav", default="")
"""The namespace of the UAV that the event is about, if the process flies several; else empty."""


def caller_text() -> str:
    """Returns the address of the peer that gave the present command; empty for a command from this process."""
    get_caller = caller.get()
    return "" if get_caller is None else get_caller()


def refused(logger: logging.Logger, command: str, error: UalError, repeated: int = 0) -> None:
    """Logs that a command was refused, and how often before without a line."""
    count = {"repeated": repeated} if repeated else {}
    event(logger, logging.WARNING, "refused", command=command, reason=error.reason, why=str(error), **count)


def event(logger: logging.Logger, level: int, event: str, /, **fields: object) -> None:
    """Logs an event: its name in snake_case, and its details as fields.

    Adds the field ``caller`` for a command from outside the process, and ``ns`` if the process flies several UAVs.
    """
    if not logger.isEnabledFor(level):
        return
    ns = uav.get()
    if ns:
        fields = {"ns": ns, **fields}
    get_caller = caller.get()
    if get_caller is not None:
        fields.setdefault("caller", get_caller())
    logger.log(level, "%s", event, extra={"ual_event": event, "ual_fields": fields}, stacklevel=2)
