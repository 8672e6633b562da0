"""Structured logs: events with fields. `ual_daemon.program.log_output` writes them as text or as JSON."""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ual.errors import UalError

_LONGEST_VALUE_CHARACTERS = 300
"""In characters. Callers give names and values: they must not fill the log."""
_PLAIN_VALUE = re.compile(r"[^\s\"\\=\x00-\x1f\x7f]+")

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
    logger.log(level, "%s", _LogText(event, fields), extra={"ual_event": event, "ual_fields": fields}, stacklevel=2)


class _LogText:
    """An event as text. It is made only where a handler writes it, so that an event that is not written costs less."""

    __slots__ = ("_event", "_fields")

    def __init__(self, event: str, fields: Mapping[str, object]) -> None:
        self._event = event
        self._fields = fields

    def __str__(self) -> str:
        return event_text(self._event, self._fields)


def event_text(event: str, fields: Mapping[str, object]) -> str:
    """Returns an event as one line of text: ``state old=LANDED_ARMED new=TAKING_OFF``."""
    return " ".join([event, *(f"{name}={_text(value)}" for name, value in fields.items())])


def _text(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    text = clipped(str(value))
    # Quotes whatever is not one plain word, so that a value cannot look like another field or another line.
    return text if _PLAIN_VALUE.fullmatch(text) else json.dumps(text, ensure_ascii=False)


def clipped(text: str, longest: int = _LONGEST_VALUE_CHARACTERS) -> str:
    """Returns a text, cut off with its length where it is too long for a log."""
    return text if len(text) <= longest else f"{text[:longest]}... ({len(text)} characters)"
