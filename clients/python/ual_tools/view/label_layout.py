"""Layout of labels, so that none covers another one. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from ual.geometry import Vector3
from ual_tools.view.camera import PageCamera

_LETTER_PX, _LINE_PX, _BORDER_PX = 6.4, 19.0, 8.0
_MOST_LINES = 6
"""A label that would have to be lifted by more is left out."""


class Wanted(NamedTuple):
    """A label: what it says, and the place above which it stands. `is_urgent`: it is never left out."""

    name: str
    text: str
    place: Vector3
    is_urgent: bool = False


class Fixed(NamedTuple):
    """A label whose middle stays at its place: those of the ground."""

    text: str
    place: Vector3


class _Box(NamedTuple):
    left: float
    right: float
    bottom: float

    def meets(self, other: _Box) -> bool:
        is_apart = self.right <= other.left or other.right <= self.left
        return not is_apart and abs(self.bottom - other.bottom) < _LINE_PX


def laid_out(wanted: Iterable[Wanted], camera: PageCamera, fixed: Iterable[Fixed] = ()) -> dict[str, Vector3]:
    """Returns where each label stands in the scene; what is behind the camera, or has no room, is not there.

    A label that would cover another one, or a `fixed` one, is lifted. Urgent ones are placed first, then the nearest.
    """
    placed = [_box(each.text, x, y + _LINE_PX / 2.0) for each in fixed for x, y in _pixels(each.place, camera)]
    found: dict[str, Vector3] = {}
    visible = [(label, pixel) for label in wanted if (pixel := camera.pixel(label.place)) is not None]
    for label, (x, y, ahead_m) in sorted(visible, key=lambda each: (not each[0].is_urgent, each[1][2], each[0].name)):
        lines = _free_row(_box(label.text, x, y), placed)
        if lines > _MOST_LINES and not label.is_urgent:
            continue
        placed.append(_box(label.text, x, y - lines * _LINE_PX))
        found[label.name] = label.place + camera.up * (lines * _LINE_PX / camera.pixels_per_m(ahead_m))
    return found


def _pixels(place: Vector3, camera: PageCamera) -> Iterator[tuple[float, float]]:
    if (pixel := camera.pixel(place)) is not None:
        yield pixel[0], pixel[1]


def _box(text: str, x: float, bottom: float) -> _Box:
    half = (len(text) * _LETTER_PX + _BORDER_PX) / 2.0
    return _Box(x - half, x + half, bottom)


def _free_row(box: _Box, placed: Sequence[_Box]) -> int:
    """Returns by how many lines a label has to be lifted."""
    lines = 0
    while lines <= 2 * len(placed):  # a fixed one may stand between two lines, and close both
        if not any(box._replace(bottom=box.bottom - lines * _LINE_PX).meets(other) for other in placed):
            return lines
        lines += 1
    return lines
