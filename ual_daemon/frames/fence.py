"""The geometry of a geofence: an area, a disc and a height band in the backend's local frame."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from ual.geometry import Vector3
from ual_daemon.frames.area import EDGE_M, Area, LocalZone, Point2
from ual_daemon.frames.room import ROUNDING_MARGIN_M, Point3, Room


class Disc(NamedTuple):
    """A circle in the local frame, and what it encloses."""

    x: float
    y: float
    radius_m: float

    def beyond_m(self, point: Vector3) -> float:
        """Returns how far outside a point is; negative inside."""
        return math.hypot(point.x - self.x, point.y - self.y) - self.radius_m - EDGE_M

    def nearest_m(self, a: Vector3, b: Vector3) -> float:
        """Returns how far outside the nearest point of a segment is; negative inside."""
        dx, dy = b.x - a.x, b.y - a.y
        squared = dx * dx + dy * dy
        share = ((self.x - a.x) * dx + (self.y - a.y) * dy) / squared if squared > 0.0 else 0.0
        return self.beyond_m(a + (b - a) * min(max(share, 0.0), 1.0))


class Exit(NamedTuple):
    """The first part of a polyline that is not allowed: its end, and where it begins (None: it is a single point)."""

    point: Vector3
    before: Vector3 | None


class Fence:
    """A polygon (or none), cut by zones, a disc (or none) and a height band in the local frame: pure geometry."""

    def __init__(self, corners: Sequence[Point2], lowest_m: float = -math.inf, highest_m: float = math.inf) -> None:
        """`corners` are x, y in metres in order, at least three, or none for a height band without sides.

        Raises `ConfigError` if the polygon crosses itself or has no area.
        """
        self.corners: tuple[Point2, ...] = tuple(corners)
        """Corners of the polygon; the zones that cut it have others."""
        self._area = Area(corners)
        self.disc: Disc | None = None
        self._lowest_m, self._highest_m = lowest_m - EDGE_M, highest_m + EDGE_M

    def cut(self, zones: Sequence[LocalZone], reserve_m: float, *, unites_inclusions: bool) -> Fence:
        """Returns the part that the zones leave, with a reserve; see `Area`. Takes some milliseconds."""
        part = copy.copy(self)
        part._area = Area(self.corners, zones, reserve_m, unites_inclusions=unites_inclusions)  # noqa: SLF001  a Fence
        return part

    def narrowed(self, lowest_m: float, highest_m: float, disc: Disc | None = None) -> Fence:
        """Returns the part of the fence that is in another height band, and in a disc, too."""
        part = copy.copy(self)  # with the same area, which is expensive to prepare
        part._lowest_m = max(self._lowest_m, lowest_m - EDGE_M)  # noqa: SLF001  a Fence
        part._highest_m = min(self._highest_m, highest_m + EDGE_M)  # noqa: SLF001  a Fence
        part.disc = disc or self.disc
        return part

    @property
    def lowest_m(self) -> float:
        """The bottom of the height band."""
        return self._lowest_m + EDGE_M

    @property
    def highest_m(self) -> float:
        """The top of the height band."""
        return self._highest_m - EDGE_M

    @property
    def is_nowhere(self) -> bool:
        """Whether its zones leave nothing inside."""
        return self._area.is_nowhere

    def is_inside(self, point: Vector3) -> bool:
        """Returns whether a point lies inside, or on the edge."""
        is_over_disc = self.disc is None or self.disc.beyond_m(point) <= 0.0
        return is_over_disc and self._is_in_band(point) and self._area.has((point.x, point.y))

    def exit(self, polyline: Iterable[Vector3]) -> Exit | None:
        """Returns the first segment of a polyline that is not allowed; None if all of it is.

        A polyline that begins outside (the safety pilot flew there) may come in, and must then stay in. Points after
        the returned ones are not read.
        """
        before: Vector3 | None = None
        before_that: Vector3 | None = None
        has_come_in = False
        for point in polyline:
            is_inside = self.is_inside(point)
            if not self._is_allowed(before, point, has_come_in=has_come_in, is_inside=is_inside):
                return Exit(point, before)
            before_that, before, has_come_in = before, point, is_inside
        return None if has_come_in or before is None else Exit(before, before_that)

    def exit_point(self, polyline: Iterable[Vector3]) -> Vector3 | None:
        """Returns the end of the first segment of a polyline that is not allowed, as `exit`."""
        found = self.exit(polyline)
        return None if found is None else found.point

    def _is_allowed(self, before: Vector3 | None, point: Vector3, *, has_come_in: bool, is_inside: bool) -> bool:
        """Returns whether a segment is allowed; `before` is None for the first point."""
        if before is None:
            return True
        if has_come_in:
            return is_inside and self._area.has_segment((before.x, before.y), (point.x, point.y))
        return self._comes_in_once(before, point) if is_inside else not self._crosses(before, point)

    def leads_back(self, a: Vector3, b: Vector3) -> bool:
        """Returns whether a segment that begins outside brings nearer to the inside, without leaving it again."""
        if not self.distance_m(b) < self.distance_m(a):
            return False
        return self._comes_in_once(a, b) if self.is_inside(b) else not self._crosses(a, b)

    def is_free(self, a: Vector3, b: Vector3) -> bool:
        """Returns whether a segment stays over the area; always where that is convex."""
        return self._area.is_convex or self._area.has_segment((a.x, a.y), (b.x, b.y))

    def outside_m(self, polyline: Sequence[Vector3]) -> float:
        """Returns how much of a polyline passes over what is outside the area, as over a hole; 0 if that is convex.

        There, how far outside the end is says the same.
        """
        if self._area.is_convex:
            return 0.0
        return sum(self._area.outside_m((a.x, a.y), (b.x, b.y)) for a, b in pairwise(polyline))

    def room_around(self, points: Sequence[Point3]) -> Room | None:
        """Returns a convex part of the fence that contains points; None if they are not inside, or it finds none."""
        if not self.is_inside(Vector3(*points[0])):
            return None
        sides = self._area.sides_around(points)
        if sides is None:
            return None
        disc = self.disc and (self.disc.x, self.disc.y, (self.disc.radius_m + EDGE_M - ROUNDING_MARGIN_M) ** 2)
        room = Room(sides, self._lowest_m, self._highest_m, disc)
        return room if room.has(points) else None

    def zone_left(self, a: Vector3 | None, b: Vector3) -> str:
        """Returns the name of the zone that keeps from a point `b`, or from the way there from `a`; see `Area`."""
        return self._area.zone_left(None if a is None else (a.x, a.y), (b.x, b.y))

    def distance_m(self, point: Vector3) -> float:
        """Returns how far outside a point is; 0 inside."""
        below, above = self._lowest_m - point.z, point.z - self._highest_m
        vertical = max(0.0, below, above)
        sideways = 0.0 if self.disc is None else max(0.0, self.disc.beyond_m(point))
        return math.hypot(max(sideways, self._area.distance_m((point.x, point.y))), vertical)

    def clearance_m(self, point: Vector3) -> float:
        """Returns how far a UAV can fly from a point in any direction and stay inside; 0 outside."""
        if not self.is_inside(point):
            return 0.0
        clear = min(point.z - self._lowest_m, self._highest_m - point.z)
        if self.disc is not None:
            clear = min(clear, -self.disc.beyond_m(point))
        return min(clear, self._area.clearance_m((point.x, point.y)))

    def signed_distance_m(self, point: Vector3) -> float:
        """Returns how far a point is from the edge: positive outside, negative inside."""
        return self.distance_m(point) - self.clearance_m(point)

    def _is_in_band(self, point: Vector3) -> bool:
        return self._lowest_m <= point.z <= self._highest_m

    def _comes_in_once(self, outside: Vector3, inside: Vector3) -> bool:
        """Returns whether a segment that ends inside comes in only once. (In height, and into the disc, it always
        does.)
        """
        return self._area.is_entered_once((outside.x, outside.y), (inside.x, inside.y))

    def _crosses(self, a: Vector3, b: Vector3) -> bool:
        """Returns whether a segment between two points outside goes through the inside."""
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
        return self._area.is_touched((c.x, c.y), (d.x, d.y))
