"""Reads JSON of users' files strictly: what a reader could take in two ways is refused, with its line."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from ual.shared.numbers import shown

_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\]:,]', re.DOTALL)


PLAN_KEYS = ("fileType", "version", "groundStation", "mission", "geoFence", "rallyPoints")
"""The keys of QGroundControl's plans."""
_NAME_SIMILARITY = 0.8


class JsonError(ValueError):
    """The text is not accepted. `line` counts from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


class AmbiguousJsonError(JsonError):
    """The text is JSON, and an object has one key with two values."""


class NotJson(str):
    """``NaN``, ``Infinity`` or ``-Infinity``, which some programs write and JSON does not have."""

    __slots__ = ()


def parsed(text: str, constant: Callable[[str], object] = NotJson) -> Any:  # noqa: ANN401  whatever the file has
    """Parses a whole document. Numbers are floats; `constant` makes what stands for NaN and infinity.

    Raises:
        JsonError: It is no JSON, or is nested too deeply.
        AmbiguousJsonError: A key has two values.

    """
    try:
        return json.loads(text, parse_int=float, parse_constant=constant, object_pairs_hook=_object)
    except RecursionError:
        raise JsonError("it is nested too deeply", 1) from None
    except json.JSONDecodeError as error:
        raise JsonError(error.msg, error.lineno) from None
    except _TwoValuesError as error:
        raise AmbiguousJsonError(f"{shown(error.key)} is given twice", _row_of_second(text, error.key)) from None


def require_spelled(values: Mapping[str, object], known: Collection[str]) -> None:
    """Refuses a key that is not known and looks like one that is missing, or differs from one by its case only.

    Others may have keys of their own.

    Raises:
        ValueError: There is such a key.

    """
    by_lower = {key.lower(): key for key in known}
    missing = [lower for lower, key in by_lower.items() if key not in values]
    for key in values:
        lower = key.lower()
        alike = [lower] if lower in by_lower else difflib.get_close_matches(lower, missing, 1, _NAME_SIMILARITY)
        if key not in known and alike:
            raise ValueError(f"{shown(key)} is not known: is {shown(by_lower[alike[0]])} meant?")


class _TwoValuesError(Exception):
    def __init__(self, key: str) -> None:
        super().__init__(key)
        self.key = key


def _object(pairs: Sequence[tuple[str, object]]) -> dict[str, object]:
    found: dict[str, object] = {}
    for key, value in pairs:
        if key in found and found[key] != value:
            raise _TwoValuesError(key)
        found[key] = value
    return found


def _row_of_second(text: str, key: str) -> int:
    """Returns the line of the first key of this name that an object has twice."""
    keys: list[set[str]] = []
    before = ""
    for token in _TOKEN.finditer(text):
        mark = token[0]
        if mark in "{[":
            keys.append(set())
        elif mark in "}]":
            keys.pop()
        elif mark == ":":
            name = json.loads(before)
            if name == key and name in keys[-1]:
                return text.count("\n", 0, token.start()) + 1
            keys[-1].add(name)
        before = mark
    return 1
