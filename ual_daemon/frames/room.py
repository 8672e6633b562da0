"""A convex part of a fence: what was found inside for one setpoint serves the next ones, without polygons."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    from shapely.geometry.base import BaseGeometry

_DECIMALS = 9
ROUNDING_MARGIN_M = 1e-6
"""A room ends this far before the edge, so that no rounding matters."""

Point3 = tuple[float, float, float]
"""x, y and z in metres."""


class Side(NamedTuple):
    """A half-plane, seen from above: x * nx + y * ny <= most."""

    nx: float
    ny: float
    most: float


class Room(NamedTuple):
    """Half-planes, a disc (x, y and squared radius) and a height band: where points are in it, so are the straight
    ways between them.
    """

    sides: tuple[Side, ...]
    lowest_m: float
    highest_m: float
    disc: tuple[float, float, float] | None = None

    def has(self, points: Sequence[Point3]) -> bool:
        """Returns whether all points are in it."""
        lowest_m, highest_m, disc, sides = self.lowest_m, self.highest_m, self.disc, self.sides
        for x, y, z in points:
            if not lowest_m <= z <= highest_m:
                return False
            if disc is not None and (x - disc[0]) ** 2 + (y - disc[1]) ** 2 > disc[2]:
                return False
            for nx, ny, most in sides:
                if x * nx + y * ny > most:
                    return False
        return True

    def inside_m(self, point: Point3) -> float:
        """Returns how far a point is from its nearest bound; negative outside."""
        x, y, z = point
        inside_m = min(z - self.lowest_m, self.highest_m - z)
        for nx, ny, most in self.sides:
            inside_m = min(inside_m, most - x * nx - y * ny)
        if self.disc is not None:
            inside_m = min(inside_m, math.sqrt(self.disc[2]) - math.hypot(x - self.disc[0], y - self.disc[1]))
        return inside_m


class Edges(NamedTuple):
    """The straight pieces of the boundary of an area: as geometries, and their ends by piece, end, and x or y."""

    lines: npt.NDArray[np.object_]
    ends: npt.NDArray[np.float64]

    @classmethod
    def of(cls, boundary: BaseGeometry) -> Edges:
        """Returns those of a boundary, which may have several rings."""
        import numpy as np
        import shapely

        rings = [shapely.get_coordinates(ring) for ring in shapely.get_parts(boundary)]
        ends = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
        return cls(np.array(shapely.linestrings(ends)), ends)


def sides_around(points: Sequence[Point3], edges: Edges) -> tuple[Side, ...] | None:
    """Returns half-planes that contain the convex hull of some points, and nothing of any edge; None if there are none.

    Each half-plane ends at the edge that is nearest to the hull of those not yet beyond another half-plane, at right
    angles to the shortest way there. The hull and an edge are convex, so this line separates them: all of that edge is
    beyond it. (Planners find convex free space in this way: IRIS, Deits and Tedrake 2014; safe flight corridors, Liu et
    al. 2017.) What is convex, contains a point inside a fence, and nothing of its boundary, is inside as a whole.
    """
    import numpy as np
    import shapely

    # Rounded, as two points that almost coincide divide GEOS by zero; `Room.has` is asked of the exact ones.
    hull = shapely.MultiPoint([(round(x, _DECIMALS), round(y, _DECIMALS)) for x, y, _ in points]).convex_hull
    ways, ends = shapely.get_coordinates(shapely.shortest_line(hull, edges.lines)).reshape(-1, 2, 2), edges.ends
    distances = np.hypot(*(ways[:, 1] - ways[:, 0]).T)
    sides: list[Side] = []
    while len(distances):
        nearest = int(distances.argmin())
        distance_m = float(distances[nearest])
        if distance_m <= 2 * ROUNDING_MARGIN_M:
            return None
        (ax, ay), (bx, by) = ways[nearest].tolist()
        nx, ny = (bx - ax) / distance_m, (by - ay) / distance_m
        at_m = bx * nx + by * ny
        sides.append(Side(nx, ny, at_m - ROUNDING_MARGIN_M))
        is_left = (ends[:, :, 0] * nx + ends[:, :, 1] * ny).min(axis=1) < at_m - ROUNDING_MARGIN_M / 2
        if is_left[nearest]:
            return None  # by roundings, as where the edge is very long and very near
        ways, ends, distances = ways[is_left], ends[is_left], distances[is_left]
    return tuple(sides)
