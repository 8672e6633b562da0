"""The zones of the autopilot's own fence in the local frame, where the autopilot itself has them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from ual.geometry import Vector3
from ual_daemon.backends.values import Zone
from ual_daemon.frames.area import LocalZone, Point2
from ual_daemon.geodesy import Projection

CIRCLE_SIDES = 64
"""Sides of the polygon that a circle becomes, on the safe side by up to 0.12 % of its radius."""
_EDGE_STEP_M = 1000.0
"""A side is straight in latitude and longitude, as both autopilots compute it (Polygon_outside of ArduPilot,
Geofence::insidePolygon of PX4). So in the local frame it is bent: by 2 m on 10 km at a latitude of 47 degrees. Cut into
parts of this length it is off by 2 cm."""
_MAX_STEPS = 200


def local_zones(zones: tuple[Zone, ...], projection: Projection) -> list[LocalZone]:
    """Returns the zones in metres. Takes about a millisecond each."""
    return [LocalZone(zone.name, zone.is_inclusion, tuple(_corners(zone, projection))) for zone in zones]


def _corners(zone: Zone, projection: Projection) -> Iterator[Point2]:
    return _polygon(zone, projection) if zone.radius_m is None else _circle(zone, zone.radius_m, projection)


def _polygon(zone: Zone, projection: Projection) -> Iterator[Point2]:
    for begin, end in zip(zone.points, (*zone.points[1:], zone.points[0]), strict=True):
        a, b = _local(begin, projection), _local(end, projection)
        count = min(_MAX_STEPS, max(1, math.ceil(math.dist(a, b) / _EDGE_STEP_M)))
        yield a
        for step in range(1, count):
            share = step / count
            yield _local((_between(begin[0], end[0], share), _between(begin[1], end[1], share)), projection)


def _between(begin: float, end: float, share: float) -> float:
    return begin + (end - begin) * share


def _circle(zone: Zone, radius_m: float, projection: Projection) -> Iterator[Point2]:
    """Yields a polygon that lies within an inclusion, or around an exclusion.

    Its radius is measured as the autopilot does, from the centre. In a local frame that begins far away the circle is
    none: ArduPilot's metres to the east depend on the latitude half way to the origin.
    """
    ((latitude_deg, longitude_deg),) = zone.points
    around = replace(projection, latitude_deg=latitude_deg, longitude_deg=longitude_deg)
    corner_m = radius_m if zone.is_inclusion else radius_m / math.cos(math.pi / CIRCLE_SIDES)
    for side in range(CIRCLE_SIDES):
        angle = 2.0 * math.pi * side / CIRCLE_SIDES
        place = around.to_geo(Vector3(corner_m * math.cos(angle), corner_m * math.sin(angle), 0.0))
        yield _local((place.latitude_deg, place.longitude_deg), projection)


def _local(place: tuple[float, float], projection: Projection) -> Point2:
    point = projection.to_local(*place, 0.0)
    return point.x, point.y
