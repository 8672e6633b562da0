"""JSON as the files of others have it: strict about numbers, which are all floats."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from ual.routes._route import FaultError
from ual.shared import strict_json
from ual.shared.numbers import shown
from ual.shared.strict_json import PLAN_KEYS, AmbiguousJsonError, JsonError, NotJson, parsed

__all__ = [
    "PLAN_KEYS",
    "AmbiguousJsonError",
    "JsonError",
    "NotJson",
    "number",
    "optional",
    "parsed",
    "require_spelled",
    "whole",
]


def require_spelled(values: Mapping[str, object], known: Collection[str], where: str = "") -> None:
    """Refuses a key that looks like a known one that is missing. Raises `FaultError`."""
    try:
        strict_json.require_spelled(values, known)
    except ValueError as error:
        raise FaultError(f"has a key that is none: {error}", where) from None


def number(value: object, what: str, where: str) -> float:
    """Accepts a finite number of JSON. Raises `FaultError`."""
    if isinstance(value, NotJson):
        raise FaultError(
            f"{what} is {value}, which JSON does not have: give a number, or null where that is allowed", where
        )
    if value is None:
        raise FaultError(f"{what} is not given (null)", where)
    if not isinstance(value, float) or not math.isfinite(value):
        raise FaultError(f"{what} is {shown(value)}, not a number", where)
    return value


def optional(value: object, what: str, where: str) -> float | None:
    """As `number`, but None for null."""
    return None if value is None else number(value, what, where)


def whole(value: object, what: str, where: str) -> int:
    """Accepts a whole number of JSON. Raises `FaultError`."""
    found = number(value, what, where)
    if not found.is_integer():
        raise FaultError(f"{what} is {found:g}, not a whole number", where)
    return int(found)
