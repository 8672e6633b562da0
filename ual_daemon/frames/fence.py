"""The geometry of a geofence: a polygon and a height band in the backend's local frame.

Polygons are judged by shapely (GEOS), which is loaded only where a fence is configured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ual.geometry import Vector3
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from shapely import Polygon

_MARGIN_M = 0.001
"""What lies beyond the edge by no more than this (roundings between frames) is on the edge."""


class Fence:
    """A polygon (or none) and a height band in the local frame: pure geometry."""

    def __init__(
        self, corners: Sequence[tuple[float, float]], lowest_m: float = -math.inf, highest_m: float = math.inf
    ) -> None:
        """`corners` are x, y in metres in order, three at least, or none for a band without sides.

        Raises `ConfigError` for a polygon that crosses itself or has no area.
        """
        self._polygon = _polygon(corners) if corners else None
        self._lowest_m, self._highest_m = lowest_m - _MARGIN_M, highest_m + _MARGIN_M

    def is_inside(self, place: Vector3) -> bool:
        """Whether a place lies inside, or on the edge."""
        return self._is_in_band(place) and self._is_over_polygon(place)

    def place_of_leaving(self, way: Iterable[Vector3]) -> Vector3 | None:
        """The end of the first part of a way, given as a polyline, that lies outside; None where all of it is allowed.

        A way that begins outside (the safety pilot flew there) is allowed to come in, and then has to stay in. What
        lies behind the place that is told is not looked at.
        """
        before: Vector3 | None = None
        has_come_in = False
        for place in way:
            is_inside = self.is_inside(place)
            if has_come_in and before is not None:
                is_allowed = is_inside and self._is_segment_over_polygon(before, place)
            elif before is None:
                is_allowed = True
            elif is_inside:
                is_allowed = self._comes_in_once(before, place)
            else:
                is_allowed = not self._touches(before, place)
            if not is_allowed:
                return place
            before, has_come_in = place, is_inside
        return None if has_come_in else before

    def distance_m(self, place: Vector3) -> float:
        """How far outside a place is; 0 inside."""
        below, above = self._lowest_m - place.z, place.z - self._highest_m
        vertical = max(0.0, below, above)
        if self._polygon is None:
            return vertical
        from shapely import Point

        return math.hypot(self._polygon.distance(Point(place.x, place.y)), vertical)

    def clearance_m(self, place: Vector3) -> float:
        """How far inside a place is: so far may be flown from it in any direction. 0 outside."""
        if not self.is_inside(place):
            return 0.0
        vertical = min(place.z - self._lowest_m, self._highest_m - place.z)
        if self._polygon is None:
            return vertical
        from shapely import Point

        return min(vertical, self._polygon.boundary.distance(Point(place.x, place.y)))

    def outside_m(self, place: Vector3) -> float:
        """How far outside a place is; inside, how far from the edge, below 0."""
        return self.distance_m(place) - self.clearance_m(place)

    def _is_in_band(self, place: Vector3) -> bool:
        return self._lowest_m <= place.z <= self._highest_m

    def _is_over_polygon(self, place: Vector3) -> bool:
        from shapely import Point

        return self._polygon is None or self._polygon.covers(Point(place.x, place.y))

    def _is_segment_over_polygon(self, a: Vector3, b: Vector3) -> bool:
        from shapely import LineString

        return self._polygon is None or self._polygon.covers(LineString([(a.x, a.y), (b.x, b.y)]))

    def _comes_in_once(self, outside: Vector3, inside: Vector3) -> bool:
        """Whether a segment that comes in does so once and for all. (In height, one that ends inside always does.)"""
        from shapely import LineString

        if self._polygon is None:
            return True
        part = self._polygon.intersection(LineString([(outside.x, outside.y), (inside.x, inside.y)]))
        return part.geom_type in ("LineString", "Point")

    def _touches(self, a: Vector3, b: Vector3) -> bool:
        """Whether a segment between two places outside goes through the inside."""
        from shapely import LineString

        begin, end = 0.0, 1.0  # the share of it that lies in the band
        rise_m = b.z - a.z
        if rise_m != 0.0:
            crossings = sorted((level - a.z) / rise_m for level in (self._lowest_m, self._highest_m))
            begin, end = max(begin, crossings[0]), min(end, crossings[1])
        elif not self._is_in_band(a):
            return False
        if self._polygon is None or begin > end:
            return begin <= end
        c, d = a + (b - a) * begin, a + (b - a) * end
        return self._polygon.intersects(LineString([(c.x, c.y), (d.x, d.y)]))


def _polygon(corners: Sequence[tuple[float, float]]) -> Polygon:
    import shapely

    polygon = shapely.Polygon(corners)
    if not polygon.is_valid or polygon.area == 0.0:
        why = shapely.is_valid_reason(polygon) if not polygon.is_valid else "it has no area"
        raise ConfigError(f"is no polygon: {why}", "geofence")
    grown = polygon.buffer(_MARGIN_M, join_style="mitre")
    shapely.prepare(grown)
    return grown
