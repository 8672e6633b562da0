"""Zones and rally points of an autopilot's fence, anywhere on Earth (WGS 84)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ual.contract.fence import FenceZone, KeptFence
from ual.contract.rally_point import RallyPoint

__all__ = ["FencePlan", "FenceZone", "KeptFence", "RallyPoint", "crossing", "leaves_out"]


@dataclass(frozen=True, slots=True)
class FencePlan:
    """Fence that an autopilot is to keep. Without rally points, those that it has stay.

    `left_out` lists, as human-readable text, what else is in the file that it was read from. It does not count for
    `==`.
    """

    zones: tuple[FenceZone, ...]
    rally_points: tuple[RallyPoint, ...] = ()
    left_out: tuple[str, ...] = field(default=(), compare=False)


def leaves_out(
    zones: Sequence[FenceZone], latitude_deg: float, longitude_deg: float, *, unites_inclusions: bool = False
) -> str:
    """Returns which of some zones forbids a place, human-readable; empty where none does.

    With `unites_inclusions` it is enough to be in one inclusion, as with ArduPilot's FENCE_OPTIONS.
    """
    inclusions = [each for each in zones if each.is_inclusion]
    outside = [each for each in inclusions if not each.encloses(latitude_deg, longitude_deg)]
    if outside and (not unites_inclusions or len(outside) == len(inclusions)):
        return f"it is outside the {outside[0].text}"
    inside = (each for each in zones if not each.is_inclusion and each.encloses(latitude_deg, longitude_deg))
    return next((f"it is inside the {each.text}" for each in inside), "")


def crossing(points: Sequence[tuple[float, float]]) -> tuple[int, int] | None:
    """Returns two sides of a polygon, counted from 1, that cross or touch each other; None where none do.

    Each corner is taken as an autopilot keeps it, in whole 1e-7 degrees, so that nothing is rounded.
    """
    kept = [(round(latitude_deg * 1e7), round(longitude_deg * 1e7)) for latitude_deg, longitude_deg in points]
    sides = [(a, b, i + 1) for i, (a, b) in enumerate(zip(kept, (*kept[1:], kept[0]), strict=True)) if a != b]
    for i, (a, b, number) in enumerate(sides):
        for j in range(i + 1, len(sides)):
            c, d, other = sides[j]
            is_next = j == i + 1 or (i == 0 and j == len(sides) - 1)
            if _turns_back(a, b, c, d) if is_next else _meet(a, b, c, d):
                return number, other
    return None


_GridPoint = tuple[int, int]


def _turn(a: _GridPoint, b: _GridPoint, c: _GridPoint) -> int:
    """Returns to which side of the way from `a` to `b` a place lies; 0: on it."""
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return (area > 0) - (area < 0)


def _is_between(a: _GridPoint, b: _GridPoint, c: _GridPoint) -> bool:
    """Returns whether a place on the line of two others lies between them."""
    return min(a[0], b[0]) <= c[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= c[1] <= max(a[1], b[1])


def _meet(a: _GridPoint, b: _GridPoint, c: _GridPoint, d: _GridPoint) -> bool:
    """Returns whether two sides have a place in common."""
    turns = _turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)
    if turns[0] != turns[1] and turns[2] != turns[3]:
        return True
    ends = ((a, b, c), (a, b, d), (c, d, a), (c, d, b))
    return any(not turn and _is_between(*each) for turn, each in zip(turns, ends, strict=True))


def _turns_back(a: _GridPoint, b: _GridPoint, c: _GridPoint, d: _GridPoint) -> bool:
    """Returns whether two sides that share a corner lie upon each other."""
    corner, one, other = (b, a, d) if b == c else (a, b, c)
    if _turn(corner, one, other):
        return False
    along = (one[0] - corner[0]) * (other[0] - corner[0]) + (one[1] - corner[1]) * (other[1] - corner[1])
    return along > 0
