"""Reads numbers from text as people write them.

`float` also takes ``1_000``, ``infinity``, ``nan`` and digits of other scripts, which in a file are slips.
"""

from __future__ import annotations

import math
import re

_DECIMAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


def parse_number(text: str) -> float:
    """Parses a finite decimal number: ``12``, ``-0.5``, ``1e3``. Raises `ValueError`."""
    if not _DECIMAL.fullmatch(text.strip(" \t\r\n")):
        raise ValueError(f"{shown(text)} is not a decimal number")
    value = float(text)
    if math.isinf(value):
        raise ValueError(f"{shown(text)} is too large")
    return value


def shown(value: object) -> str:
    """Returns a value of a file as one short line for a message."""
    text = value if isinstance(value, str) else repr(value)
    return repr(text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}...")


_LONGEST_SHOWN = 60
