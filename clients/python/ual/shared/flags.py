"""Values of a switch: on or off. A text is no such thing: ``"no"`` would count as true."""

from __future__ import annotations

from ual.errors import InvalidArgumentError

SWITCHES = "True or False"


def shown(value: object) -> str:
    """Returns a value of any type as one line of text."""
    return " ".join(repr(value).split())[:100]


def is_flag(value: object) -> bool:
    """Returns whether a value is True or False, also as 1 or 0, and as NumPy's."""
    if isinstance(value, int):
        return value in (0, 1)
    return type(value).__name__ in ("bool", "bool_")


def flag(value: object, field: str) -> bool:
    """Returns what a caller switches.

    Raises:
        InvalidArgumentError: It is neither True nor False.

    """
    if not is_flag(value):
        raise InvalidArgumentError(f"{field}: {shown(value)} is not {SWITCHES}", {"field": field})
    return bool(value)
