"""Errors with the parameters of an autopilot, whatever protocol reaches it."""

from __future__ import annotations

import difflib

from ual.errors import InvalidArgumentError, RejectedByAutopilotError, UalError, UalTimeoutError
from ual.parameters.values import Parameter


def unknown(name: str, names: frozenset[str]) -> InvalidArgumentError:
    """Returns that there is no parameter of a name, with those that may be meant."""
    close = difflib.get_close_matches(name.upper(), names, n=3)
    meant = f"; did you mean {' or '.join(close)}?" if close else ""
    return InvalidArgumentError(f"name: the autopilot has no parameter {name}{meant}", {"field": "name"})


def not_kept(wanted: Parameter, kept: Parameter) -> RejectedByAutopilotError:
    """Returns that the autopilot keeps another value than the one that was written."""
    return RejectedByAutopilotError(
        f"{wanted.name} was not written: the autopilot keeps {kept.text}, not {wanted.text}",
        {"name": wanted.name, "kept": kept.text, "wanted": wanted.text},
    )


def in_doubt(error: UalError, wanted: Parameter) -> UalError:
    """Returns why a value is not sent any more that was sent already."""
    text = f"{error.message}; it is not known whether {wanted.name} is {wanted.text} now"
    return type(error)(text, error.metadata)


def unconfirmed(wanted: Parameter, what: str, tries_count: int) -> UalTimeoutError:
    """Returns that a value was ``not confirmed``, or ``not read back``, however often it was tried."""
    return UalTimeoutError(
        f"{wanted.name} was {what} in {tries_count} tries: it is not known whether it is {wanted.text} now; read it",
        {"name": wanted.name},
    )
