"""Reads numbers from text as people write them.

`float` also takes ``1_000``, ``infinity``, ``nan`` and digits of other scripts, which in a file are slips.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

_GROUPS = re.compile(r"[-+]?[1-9][0-9]{0,2}(?:,[0-9]{3})+")
"""Numbers that may be thousands, as ``1,000``, and with a decimal comma are 1."""
_DECIMAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


def parse_number(text: str) -> float:
    """Parses a finite decimal number: ``12``, ``-0.5``, ``1e3``. Raises `ValueError`."""
    if not _DECIMAL.fullmatch(text.strip(" \t\r\n")):
        raise ValueError(f"{shown(text)} is not a decimal number")
    value = float(text)
    if math.isinf(value):
        raise ValueError(f"{shown(text)} is too large")
    return value


def are_commas_decimal(fields: Iterable[str]) -> bool:
    """Returns whether the commas in the numbers of a file are decimal ones: at least one of them cannot separate
    thousands.
    """
    return any("," in field and not _GROUPS.fullmatch(field.strip()) for field in fields)


def with_point(field: str, *, is_decimal: bool) -> str:
    """Returns a number with a point instead of a decimal comma.

    Raises:
        ValueError: It has a comma, and those of its file may separate thousands.

    """
    if "," not in field:
        return field
    if not is_decimal:
        raise ValueError(f"{shown(field.strip())} may be a decimal comma, or thousands: write it with a point")
    return field if "." in field else field.replace(",", ".", 1)


def shown(value: object) -> str:
    """Returns a value of a file as one short line for a message."""
    text = value if isinstance(value, str) else repr(value)
    return repr(text if len(text) <= _LONGEST_TEXT_CHARACTERS else f"{text[:_LONGEST_TEXT_CHARACTERS]}...")


_LONGEST_TEXT_CHARACTERS = 60
