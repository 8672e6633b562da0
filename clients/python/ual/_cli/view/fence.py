"""The geofence of a UAV as lines in `map`. Pure; draws nothing.

The contract does not tell the fence. So it comes from the daemon's configuration file, see `fence_file`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ual.geometry import Transform, Vector3
from ual.types import GeoPoint, Telemetry

Line = tuple[Vector3, Vector3]

_EQUATOR_M = 6_378_137.0
_FLATTENING_2 = 6.694379990141e-3
"""The first eccentricity of the WGS 84 ellipsoid, squared."""


@dataclass(frozen=True, slots=True)
class Fence:
    """A polygon with the heights that limit it, as in the configuration: in `frame_id`, or `is_geo` (degrees)."""

    ns: str
    corners: Sequence[tuple[float, float]]
    frame_id: str
    is_geo: bool = False
    min_height_m: float | None = None
    max_height_m: float | None = None


def lines(fence: Fence, frame: Transform, telemetry: Telemetry | None) -> list[Line]:
    """Returns the edges of the fence: below, above, and between; nothing where it is not known where it lies.

    Args:
        fence: The fence.
        frame: Takes its frame to `map`.
        telemetry: Of the UAV: it ties `map` to Earth, which the corners of a geographic fence need.

    """
    low_m, high_m = fence.min_height_m or 0.0, fence.max_height_m
    corners = _geo_corners(fence, telemetry) if fence.is_geo else [Vector3(x, y, 0.0) for x, y in fence.corners]

    def ring(height_m: float) -> list[Vector3]:
        if fence.is_geo:
            return [Vector3(each.x, each.y, frame.translation.z + height_m) for each in corners]
        return [frame.apply(Vector3(each.x, each.y, height_m)) for each in corners]

    below = ring(low_m)
    if high_m is None:
        return _closed(below)
    above = ring(high_m)
    return [*_closed(below), *_closed(above), *zip(below, above, strict=True)]


def _closed(corners: Sequence[Vector3]) -> list[Line]:
    return list(zip(corners, [*corners[1:], *corners[:1]], strict=True))


def _geo_corners(fence: Fence, telemetry: Telemetry | None) -> list[Vector3]:
    if telemetry is None or telemetry.position_geo is None or telemetry.transform is None:
        return []
    here, place = telemetry.position_geo, telemetry.transform.translation
    return [place + _east_north(here, latitude_deg, longitude_deg) for latitude_deg, longitude_deg in fence.corners]


def _east_north(here: GeoPoint, latitude_deg: float, longitude_deg: float) -> Vector3:
    """Returns how far east and north of here a place is, on the plane that touches Earth here."""
    latitude_rad = math.radians(here.latitude_deg)
    across = 1.0 - _FLATTENING_2 * math.sin(latitude_rad) ** 2
    east_radius_m = _EQUATOR_M / math.sqrt(across)
    north_radius_m = east_radius_m * (1.0 - _FLATTENING_2) / across
    east_m = math.radians(longitude_deg - here.longitude_deg) * east_radius_m * math.cos(latitude_rad)
    return Vector3(east_m, math.radians(latitude_deg - here.latitude_deg) * north_radius_m, 0.0)
