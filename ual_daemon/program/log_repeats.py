"""Counts log lines that are repeated, so that a caller or a fault that repeats itself does not fill the log.

The first line of its kind is written at once. Those that say the same within a while after it are counted, and their
number is written when the while is over.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass

REPEAT_PERIOD_S = 10.0
_MOST_KINDS = 100
"""Most different lines that are remembered; further ones are written as they come."""
_COUNTED_EVENTS = ("call_failed", "caller_gone")
"""Events that are counted, though they are no warnings."""
_WRITTEN_EVENTS = ("state",)
"""Warnings that are always written: the sequence of states must be complete."""
_NOT_COMPARED = ("caller", "repeated", "reboots_count", "detail")


@dataclass(slots=True)
class _Kind:
    """A line that was written, and how often it was repeated since."""

    record: logging.LogRecord
    since_s: float
    count: int = 0


class Repeats:
    """The lines of the last `REPEAT_PERIOD_S`. Not thread-safe: a handler calls it while it holds its lock."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._kinds: dict[Hashable, _Kind] = {}

    def is_repeated(self, record: logging.LogRecord) -> bool:
        """Counts a line, and returns True, if it says the same as one before. Call `due` first."""
        key = _key(record)
        if key is None:
            return False
        known = self._kinds.get(key)
        if known is not None:
            known.count += 1 + _left_out(record)
            return True
        if len(self._kinds) < _MOST_KINDS:
            self._kinds[key] = _Kind(record, self._clock())
        return False

    def due(self, *, is_end: bool = False) -> Iterator[logging.LogRecord]:
        """Returns the records of how often lines were repeated whose time is over; at the end, of all."""
        over_s = self._clock() - REPEAT_PERIOD_S
        for key, kind in list(self._kinds.items()):
            if is_end or kind.since_s <= over_s:
                del self._kinds[key]
                if kind.count:
                    yield _summary(kind)


def _key(record: logging.LogRecord) -> Hashable | None:
    """Returns what two lines have in common that say the same; None for a line that is always written."""
    name: str | None = getattr(record, "ual_event", None)
    if name is None:
        return (record.name, record.getMessage()) if record.levelno >= logging.WARNING else None
    is_warning = record.levelno >= logging.WARNING and name not in _WRITTEN_EVENTS
    if not is_warning and name not in _COUNTED_EVENTS:
        return None
    fields: dict[str, object] = getattr(record, "ual_fields", {})
    compared = tuple((key, str(value)) for key, value in fields.items() if key not in _NOT_COMPARED)
    return (record.name, name, compared)


def _left_out(record: logging.LogRecord) -> int:
    """Returns how many lines its logger left out before it."""
    return int(getattr(record, "ual_fields", {}).get("repeated", 0))


def _summary(kind: _Kind) -> logging.LogRecord:
    """Returns a line as `kind.record`, which says how often that was repeated."""
    record = kind.record
    name: str | None = getattr(record, "ual_event", None)
    text = f"repeated {kind.count} times: {record.getMessage()}" if name is None else name
    summary = logging.LogRecord(record.name, record.levelno, record.pathname, record.lineno, text, None, None)
    if name is not None:
        fields: dict[str, object] = getattr(record, "ual_fields", {})
        kept = {key: value for key, value in fields.items() if key not in _NOT_COMPARED}
        summary.__dict__.update(ual_event=name, ual_fields={"repeated": kind.count, **kept})
    return summary
