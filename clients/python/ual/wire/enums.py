"""The enums of requests: what is no member, or not known, is refused and named."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import TypeVar

from ual.errors import InvalidArgumentError

E = TypeVar("E", bound=Enum)


def number_of(value: object, kind: type[Enum], field: str) -> int:
    """Returns the number of a member of an enum.

    Raises:
        InvalidArgumentError: It is none.

    """
    if not isinstance(value, kind):
        raise InvalidArgumentError(f"{field}: {value!r:.80} is no {kind.__name__}", {"field": field})
    number: int = value.value
    return number


def member_of(number: int, known: Mapping[int, E], field: str, unset: E | None = None) -> E:
    """Returns the member of a number. 0 is `unset`, where there is one.

    Raises:
        InvalidArgumentError: The number is not known, or not set.

    """
    found = known.get(number)
    if found is None and number == 0:
        found = unset
    if found is None:
        names = ", ".join(each.name for each in known.values())
        raise InvalidArgumentError(f"{field}: {number} is none of {names}", {"field": field})
    return found
