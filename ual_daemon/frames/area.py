"""Area that may be flown over, seen from above: a polygon or everything, cut by named zones. Local frame, metres.

The geometry is that of shapely (GEOS), which is loaded only if there is a polygon or a zone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from ual_daemon.frames.room import Edges, Point3, Side, sides_around
from ual_daemon.settings import ConfigError

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

EDGE_M = 0.001
"""A point that lies beyond the edge by no more than this (roundings between frames) counts as on the edge."""

Point2 = tuple[float, float]
"""x and y in metres."""


class LocalZone(NamedTuple):
    """A polygon by its corners in order: an inclusion, which is not to be left, or an exclusion, not to be entered.

    Where its sides cross each other, the inside is what an odd number of them surrounds: so autopilots compute it, too
    (Polygon_outside of ArduPilot, Geofence::insidePolygon of PX4).
    """

    name: str
    is_inclusion: bool
    corners: tuple[Point2, ...]


class _NamedZone(NamedTuple):
    """A zone as it counts: an inclusion made smaller by the reserve, or an exclusion made larger."""

    name: str
    is_inclusion: bool
    shape: BaseGeometry

    def admits(self, line: BaseGeometry) -> bool:
        """Returns whether a point or a line lies on the right side of it."""
        return bool(self.shape.covers(line) if self.is_inclusion else not self.shape.intersects(line))


class Area:
    """Pure geometry. Immutable, so that any thread may use it.

    `_inside` is what the area covers, None where it is unbounded; `_obstacle` is what is cut out of an unbounded area.
    """

    def __init__(
        self,
        corners: Sequence[Point2] = (),
        zones: Sequence[LocalZone] = (),
        reserve_m: float = 0.0,
        *,
        unites_inclusions: bool = False,
    ) -> None:
        """`corners` are those of a polygon in order, at least three, or none for everything.

        Of that, the area is what is inside all inclusions (in any, with `unites_inclusions`) and in no exclusion, and
        `reserve_m` away from the edges of these zones.

        Raises `ConfigError` if the polygon crosses itself or has no area.
        """
        self._zones = tuple(_named(zones, reserve_m - EDGE_M, unites_inclusions=unites_inclusions)) if zones else ()
        self._inside = _polygon(corners) if corners else None
        self._obstacle: BaseGeometry | None = None
        if self._zones:
            self._inside, self._obstacle = _combine(self._inside, self._zones)
        self._edge = None if self._inside is None else self._inside.boundary
        self._is_convex = self._obstacle is None and (self._inside is None or _is_convex(self._inside))
        shapes = [self._inside, self._obstacle, *(zone.shape for zone in self._zones)]
        _prepare([shape for shape in shapes if shape is not None])

    @property
    def is_everywhere(self) -> bool:
        """Whether it has no edge at all."""
        return self._inside is None and self._obstacle is None

    @property
    def is_nowhere(self) -> bool:
        """Whether nothing is inside: the zones leave no room."""
        return self._inside is not None and self._inside.is_empty

    @property
    def is_convex(self) -> bool:
        """Whether the straight way between any two points inside stays inside."""
        return self._is_convex

    def has(self, point: Point2) -> bool:
        """Returns whether a point lies inside, or on the edge."""
        return self.is_everywhere or self._covers(_point(point))

    def has_segment(self, a: Point2, b: Point2) -> bool:
        """Returns whether all of a segment lies inside, or on the edge."""
        return self.is_everywhere or self._covers(_edge_between(a, b))

    def is_entered_once(self, a: Point2, b: Point2) -> bool:
        """Returns whether the part of a segment that lies inside is in one piece at most."""
        if self.is_everywhere:
            return True
        part = self._part(_edge_between(a, b))
        if part.geom_type == "MultiLineString":  # also where it only touches a corner
            from shapely import line_merge

            part = line_merge(part)
        return part.geom_type in ("LineString", "Point")

    def is_touched(self, a: Point2, b: Point2) -> bool:
        """Returns whether any part of a segment lies inside, or on the edge."""
        if self._inside is not None:
            return self._inside.intersects(_edge_between(a, b))
        return self._obstacle is None or not self._obstacle.covers(_edge_between(a, b))

    def outside_m(self, a: Point2, b: Point2) -> float:
        """Returns how much of a segment lies outside."""
        if self.is_everywhere:
            return 0.0
        line = _edge_between(a, b)
        return max(0.0, line.length - self._part(line).length)

    def distance_m(self, point: Point2) -> float:
        """Returns how far outside a point is: 0 inside, and infinite if nothing is inside."""
        if self.is_nowhere:
            return math.inf
        if self._inside is not None:
            return self._inside.distance(_point(point))
        if self._obstacle is None or not self._obstacle.intersects(_point(point)):
            return 0.0
        return self._obstacle.boundary.distance(_point(point))

    def clearance_m(self, point: Point2) -> float:
        """Returns how far a point inside is from the edge; infinite if there is none."""
        if self._edge is not None:
            return self._edge.distance(_point(point))
        return math.inf if self._obstacle is None else self._obstacle.distance(_point(point))

    def sides_around(self, points: Sequence[Point3]) -> tuple[Side, ...] | None:
        """Returns the sides of a convex part that contains some points inside; None if it finds none."""
        return () if self.is_everywhere else sides_around(points, self._edges)

    @cached_property
    def _edges(self) -> Edges:
        boundary = self._edge if self._obstacle is None else self._obstacle.boundary
        assert boundary is not None
        return Edges.of(boundary)

    def zone_left(self, a: Point2 | None, b: Point2) -> str:
        """Returns the name of the zone on whose wrong side a point `b` lies, or else a part of the way there from `a`.

        Empty if there is none.
        """
        if not self._zones:
            return ""
        goal = _point(b)
        found = next((zone.name for zone in self._zones if not zone.admits(goal)), "")
        if found or a is None:
            return found
        way, start = _edge_between(a, b), _point(a)
        crossed = [zone for zone in self._zones if not zone.admits(way)]
        crossed.sort(key=lambda zone: not zone.admits(start))  # first those that are not left, but entered on the way
        return crossed[0].name if crossed else ""

    def _covers(self, shape: BaseGeometry) -> bool:
        if self._inside is not None:
            return self._inside.covers(shape)
        return self._obstacle is None or not self._obstacle.intersects(shape)

    def _part(self, shape: BaseGeometry) -> BaseGeometry:
        if self._inside is not None:
            return self._inside.intersection(shape)
        return shape if self._obstacle is None else shape.difference(self._obstacle)


def _named(zones: Sequence[LocalZone], reserve_m: float, *, unites_inclusions: bool) -> Iterator[_NamedZone]:
    from shapely import union_all

    inclusions = [(zone.name, _shape(zone)) for zone in zones if zone.is_inclusion]
    if unites_inclusions and len(inclusions) > 1:  # before the reserve is taken off, as they may touch each other
        inclusions = [(f"its {len(inclusions)} inclusions together", union_all([shape for _, shape in inclusions]))]
    for name, shape in inclusions:
        yield _NamedZone(name, True, shape.buffer(-reserve_m))
    for zone in zones:
        if not zone.is_inclusion:
            yield _NamedZone(zone.name, False, _shape(zone).buffer(reserve_m))


def _combine(
    inside: BaseGeometry | None, zones: Sequence[_NamedZone]
) -> tuple[BaseGeometry | None, BaseGeometry | None]:
    """Returns what is inside, and what is cut out of everything where that is unbounded."""
    from shapely import union_all

    for zone in zones:
        if zone.is_inclusion:
            inside = zone.shape if inside is None else _areas(inside.intersection(zone.shape))
    exclusions = [zone.shape for zone in zones if not zone.is_inclusion]
    obstacle = union_all(exclusions) if exclusions else None
    if inside is not None and obstacle is not None:
        return _areas(inside.difference(obstacle)), None
    return inside, obstacle


def _areas(shape: BaseGeometry) -> BaseGeometry:
    """Returns a geometry without the points and lines in which polygons may touch each other."""
    if shape.geom_type != "GeometryCollection":
        return shape if shape.area > 0.0 else shape.buffer(0.0)
    from shapely import get_parts, union_all

    return union_all([part for part in get_parts(shape) if part.area > 0.0])


def _prepare(shapes: Sequence[BaseGeometry]) -> None:
    if shapes:
        from shapely import prepare

        prepare(list(shapes))


def _shape(zone: LocalZone) -> BaseGeometry:
    import shapely

    return shapely.make_valid(shapely.Polygon(zone.corners))


def _point(point: Point2) -> BaseGeometry:
    from shapely import Point

    return Point(point)


def _edge_between(a: Point2, b: Point2) -> BaseGeometry:
    from shapely import LineString

    return LineString([a, b])


def _is_convex(shape: BaseGeometry) -> bool:
    return bool(shape.convex_hull.area - shape.area < EDGE_M * shape.length)


def _polygon(corners: Sequence[Point2]) -> BaseGeometry:
    import shapely

    polygon = shapely.Polygon(corners)
    if not polygon.is_valid or polygon.area == 0.0:
        why = shapely.is_valid_reason(polygon) if not polygon.is_valid else "it has no area"
        raise ConfigError(f"is no polygon: {why}", "geofence")
    return polygon.buffer(EDGE_M, join_style="mitre")
