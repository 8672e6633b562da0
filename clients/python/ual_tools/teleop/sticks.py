"""The four axes that a device gives, whatever it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Sticks:
    """Deflections from -1 to 1: forward, left and up of the nose (headless: forward is north, left is west).

    `turn` is counter-clockwise seen from above.
    """

    forward: float = 0.0
    left: float = 0.0
    up: float = 0.0
    turn: float = 0.0

    def is_centred(self) -> bool:
        """Returns True if no axis is deflected."""
        return self == CENTRED


CENTRED = Sticks()
