"""The geometry of a geofence: a polygon and a height band in the backend's local frame.

The geometry of polygons is that of shapely (GEOS), which is loaded only if a polygon is configured.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ual.geometry import Vector3
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from shapely import Polygon

_MARGIN_M = 0.001
"""A point that lies beyond the edge by no more than this (roundings between frames) counts as on the edge."""


class Disc(NamedTuple):
    """A circle in the local frame, and what it encloses."""

    x: float
    y: float
    radius_m: float

    def beyond_m(self, point: Vector3) -> float:
        """Returns how far outside a point is; negative inside."""
        return math.hypot(point.x - self.x, point.y - self.y) - self.radius_m - _MARGIN_M

    def nearest_m(self, a: Vector3, b: Vector3) -> float:
        """Returns how far outside the nearest point of a segment is; negative inside."""
        dx, dy = b.x - a.x, b.y - a.y
        squared = dx * dx + dy * dy
        share = ((self.x - a.x) * dx + (self.y - a.y) * dy) / squared if squared > 0.0 else 0.0
        return self.beyond_m(a + (b - a) * min(max(share, 0.0), 1.0))


class Fence:
    """A polygon (or none), a disc (or none) and a height band in the local frame: pure geometry."""

    def __init__(
        self, corners: Sequence[tuple[float, float]], lowest_m: float = -math.inf, highest_m: float = math.inf
    ) -> None:
        """`corners` are x, y in metres in order, at least three, or none for a height band without sides.

        Raises `ConfigError` if the polygon crosses itself or has no area.
        """
        self.corners: tuple[tuple[float, float], ...] = tuple(corners)
        self._polygon = _polygon(corners) if corners else None
        self._is_convex = self._polygon is None or _is_convex(self._polygon)
        self.disc: Disc | None = None
        self._lowest_m, self._highest_m = lowest_m - _MARGIN_M, highest_m + _MARGIN_M

    def narrowed(self, lowest_m: float, highest_m: float, disc: Disc | None = None) -> Fence:
        """Returns the part of the fence that is in another height band, and in a disc, too."""
        part = copy.copy(self)  # with the same polygon, which is expensive to prepare
        part._lowest_m = max(self._lowest_m, lowest_m - _MARGIN_M)  # noqa: SLF001  a Fence
        part._highest_m = min(self._highest_m, highest_m + _MARGIN_M)  # noqa: SLF001  a Fence
        part.disc = disc or self.disc
        return part

    @property
    def lowest_m(self) -> float:
        """The bottom of the height band."""
        return self._lowest_m + _MARGIN_M

    @property
    def highest_m(self) -> float:
        """The top of the height band."""
        return self._highest_m - _MARGIN_M

    def is_inside(self, point: Vector3) -> bool:
        """Returns whether a point lies inside, or on the edge."""
        is_over_disc = self.disc is None or self.disc.beyond_m(point) <= 0.0
        return is_over_disc and self._is_in_band(point) and self._is_over_polygon(point)

    def exit_point(self, polyline: Iterable[Vector3]) -> Vector3 | None:
        """Returns the end of the first segment of a polyline that is not allowed; None if all of it is.

        A polyline that begins outside (the safety pilot flew there) may come in, and must then stay in. Points after
        the returned one are not read.
        """
        before: Vector3 | None = None
        has_come_in = False
        for point in polyline:
            is_inside = self.is_inside(point)
            if not self._is_allowed(before, point, has_come_in=has_come_in, is_inside=is_inside):
                return point
            before, has_come_in = point, is_inside
        return None if has_come_in else before

    def _is_allowed(self, before: Vector3 | None, point: Vector3, *, has_come_in: bool, is_inside: bool) -> bool:
        """Whether a segment is allowed; `before` is None for the first point."""
        if before is None:
            return True
        if has_come_in:
            return is_inside and self._is_segment_over_polygon(before, point)
        return self._comes_in_once(before, point) if is_inside else not self._crosses(before, point)

    def is_free(self, a: Vector3, b: Vector3) -> bool:
        """Returns whether a segment stays over the polygon; always where that has no corner that points inwards."""
        return self._is_convex or self._is_segment_over_polygon(a, b)

    def distance_m(self, point: Vector3) -> float:
        """Returns how far outside a point is; 0 inside."""
        below, above = self._lowest_m - point.z, point.z - self._highest_m
        vertical = max(0.0, below, above)
        sideways = 0.0 if self.disc is None else max(0.0, self.disc.beyond_m(point))
        if self._polygon is not None:
            from shapely import Point

            sideways = max(sideways, self._polygon.distance(Point(point.x, point.y)))
        return math.hypot(sideways, vertical)

    def clearance_m(self, point: Vector3) -> float:
        """Returns how far a UAV can fly from a point in any direction and stay inside; 0 outside."""
        if not self.is_inside(point):
            return 0.0
        clear = min(point.z - self._lowest_m, self._highest_m - point.z)
        if self.disc is not None:
            clear = min(clear, -self.disc.beyond_m(point))
        if self._polygon is None:
            return clear
        from shapely import Point

        return min(clear, self._polygon.boundary.distance(Point(point.x, point.y)))

    def signed_distance_m(self, point: Vector3) -> float:
        """Returns how far a point is from the edge: positive outside, negative inside."""
        return self.distance_m(point) - self.clearance_m(point)

    def _is_in_band(self, point: Vector3) -> bool:
        return self._lowest_m <= point.z <= self._highest_m

    def _is_over_polygon(self, point: Vector3) -> bool:
        if self._polygon is None:
            return True
        from shapely import Point

        return self._polygon.covers(Point(point.x, point.y))

    def _is_segment_over_polygon(self, a: Vector3, b: Vector3) -> bool:
        if self._polygon is None:
            return True
        from shapely import LineString

        return self._polygon.covers(LineString([(a.x, a.y), (b.x, b.y)]))

    def _comes_in_once(self, outside: Vector3, inside: Vector3) -> bool:
        """Whether a segment that ends inside comes in only once. (In height it always does.)"""
        if self._polygon is None:
            return True
        from shapely import LineString

        part = self._polygon.intersection(LineString([(outside.x, outside.y), (inside.x, inside.y)]))
        return part.geom_type in ("LineString", "Point")

    def _crosses(self, a: Vector3, b: Vector3) -> bool:
        """Whether a segment between two points outside goes through the inside."""
        begin, end = 0.0, 1.0  # the part of the segment in the height band, as shares of its length
        rise_m = b.z - a.z
        if rise_m != 0.0:
            crossings = sorted((level - a.z) / rise_m for level in (self._lowest_m, self._highest_m))
            begin, end = max(begin, crossings[0]), min(end, crossings[1])
        elif not self._is_in_band(a):
            return False
        if begin > end:
            return False
        c, d = a + (b - a) * begin, a + (b - a) * end
        if self.disc is not None and self.disc.nearest_m(c, d) > 0.0:
            return False
        if self._polygon is None:
            return True
        from shapely import LineString

        return self._polygon.intersects(LineString([(c.x, c.y), (d.x, d.y)]))


def _is_convex(polygon: Polygon) -> bool:
    return bool(polygon.convex_hull.area - polygon.area < _MARGIN_M * polygon.length)


def _polygon(corners: Sequence[tuple[float, float]]) -> Polygon:
    import shapely

    polygon = shapely.Polygon(corners)
    if not polygon.is_valid or polygon.area == 0.0:
        why = shapely.is_valid_reason(polygon) if not polygon.is_valid else "it has no area"
        raise ConfigError(f"is no polygon: {why}", "geofence")
    grown = polygon.buffer(_MARGIN_M, join_style="mitre")
    shapely.prepare(grown)
    return grown
