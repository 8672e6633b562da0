"""A colour of each UAV, by which its trail, its drop line and its line of the table belong together. Pure.

None is that of a way (orange) or of a fence (red).
"""

from __future__ import annotations

Colour = tuple[int, int, int]

_COLOURS: tuple[Colour, ...] = (
    (31, 119, 180),
    (44, 140, 60),
    (148, 80, 190),
    (140, 86, 75),
    (220, 60, 160),
    (110, 110, 20),
    (0, 150, 170),
    (20, 60, 40),
    (90, 90, 110),
    (60, 60, 150),
)


def colour(number: int) -> Colour:
    """Returns the colour of a UAV. After ten they come round."""
    return _COLOURS[number % len(_COLOURS)]


def css(rgb: Colour) -> str:
    """Returns a colour as a page writes it."""
    return f"rgb{rgb}"
