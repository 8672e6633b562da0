"""The geofence of a UAV as lines in `map`. Pure; draws nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ual.geometry import Vector3
from ual.types import Circle, Geofence

Line = tuple[Vector3, Vector3]

_CIRCLE_SIDES = 48
"""Of a circle."""


def fence_edges(fence: Geofence) -> list[Line]:
    """Returns the edges of the fence: below, above, and between. One without sides, only with heights, has none."""
    low_m, high_m = fence.min_z_m, fence.max_z_m
    rings = [fence.corners] if fence.corners else []
    if fence.circle is not None:
        rings.append(_ring(fence.circle))
    return [line for ring in rings for line in _walls(ring, 0.0 if low_m is None else low_m, high_m)]


def _walls(corners: Sequence[Vector3], low_m: float, high_m: float | None) -> list[Line]:
    below = [Vector3(corner.x, corner.y, low_m) for corner in corners]
    if high_m is None:
        return _closed(below)
    above = [Vector3(corner.x, corner.y, high_m) for corner in corners]
    return [*_closed(below), *_closed(above), *zip(below, above, strict=True)]


def _closed(corners: Sequence[Vector3]) -> list[Line]:
    return list(zip(corners, [*corners[1:], *corners[:1]], strict=True))


def _ring(circle: Circle) -> tuple[Vector3, ...]:
    angles_rad = (math.tau * side / _CIRCLE_SIDES for side in range(_CIRCLE_SIDES))
    return tuple(
        circle.center + Vector3(circle.radius_m * math.cos(angle), circle.radius_m * math.sin(angle), 0.0)
        for angle in angles_rad
    )
