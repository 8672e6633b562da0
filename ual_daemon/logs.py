"""Structured logs: events with fields. `ual_daemon.program.log_output` writes them as text or as JSON."""

from __future__ import annotations

import json
import logging
import math
import re
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ual.errors import UalError

_LONGEST_VALUE_CHARACTERS = 300
"""In characters. Callers give names and values: they must not fill the log."""
CALM_S = 10.0
"""Seconds without an event that recurs after which it has settled."""
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


class RecurringEvent:
    """An event that data may cause with each update, as they go back and forth. Belongs to one thread.

    It is logged at once, and then not again until none has come for `CALM_S`. What it came to is logged then.
    """

    def __init__(self, logger: logging.Logger, level: int, name: str) -> None:
        self._logger, self._level, self._name = logger, level, name
        self._newest_s = -math.inf
        self._logged: Mapping[str, object] = {}
        self._left_out: Mapping[str, object] | None = None
        """Details of the newest event, where it was not logged."""

    def note(self, now_s: float, **fields: object) -> None:
        """Takes an event and its details. `now_s` is by any clock that is always the same."""
        is_first = not 0.0 <= now_s - self._newest_s < CALM_S
        self._newest_s = now_s
        if is_first:
            self._log(fields)
        else:
            self._left_out = fields

    def settle(self, now_s: float) -> bool:
        """Logs what it came to, if none has come for long. Returns whether nothing is left to log."""
        left_out = self._left_out
        if left_out is not None and now_s - self._newest_s >= CALM_S:
            if left_out != self._logged:
                self._log(left_out)
            self._left_out = None
        return self._left_out is None

    def _log(self, fields: Mapping[str, object]) -> None:
        self._logged, self._left_out = fields, None
        event(self._logger, self._level, self._name, **fields)


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
