"""Numbers of 32 bits, as autopilots keep them."""

from __future__ import annotations

import math
import struct

_REAL32_DIGITS = range(6, 10)
"""Nine significant digits tell any two numbers of 32 bits apart; mostly fewer do."""
LARGEST_REAL32: float = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]


def real32(value: float) -> float:
    """Returns the number of 32 bits that is next to this one. Infinite where it is too large."""
    try:
        nearest: float = struct.unpack("<f", struct.pack("<f", value))[0]
    except OverflowError:
        return math.copysign(math.inf, value)
    return nearest


def real32_text(value: float) -> str:
    """Returns the shortest text of which `real32` makes the same number."""
    if not math.isfinite(value):
        return str(value)
    texts = (f"{value:.{digits}g}" for digits in _REAL32_DIGITS)
    return next((text for text in texts if real32(float(text)) == real32(value)), repr(value))
