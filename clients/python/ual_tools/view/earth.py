"""From latitude and longitude to metres in `map`, and the tiles of a map in the web's usual numbering. Pure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from ual.geometry import Vector3

_EQUATOR_M = 6_378_137.0
_ECCENTRICITY_SQUARED = 6.694379990141e-3
_MOST_LATITUDE_DEG = 85.0511287798
"""Latitude in degrees at which the maps of the web end."""


class EarthPosition(NamedTuple):
    """A place on Earth, WGS 84."""

    latitude_deg: float
    longitude_deg: float


class Tile(NamedTuple):
    """A square of the map: at zoom `z`, counted from the west and from the north."""

    z: int
    x: int
    y: int

    def corners(self) -> tuple[EarthPosition, EarthPosition, EarthPosition, EarthPosition]:
        """Returns its corners: north-west, north-east, south-east, south-west."""
        west, east = (360.0 * x / (1 << self.z) - 180.0 for x in (self.x, self.x + 1))
        north, south = (self._latitude_deg(y) for y in (self.y, self.y + 1))
        return (
            EarthPosition(north, west),
            EarthPosition(north, east),
            EarthPosition(south, east),
            EarthPosition(south, west),
        )

    def _latitude_deg(self, y: int) -> float:
        return math.degrees(math.atan(math.sinh(math.pi * (1.0 - 2.0 * y / (1 << self.z)))))


@dataclass(frozen=True, slots=True)
class Origin:
    """Position of `map`'s origin on Earth. East is x and north is y, as near to it as a UAV flies."""

    position: EarthPosition

    @classmethod
    def of(cls, here: EarthPosition, in_map: Vector3) -> Origin:
        """Returns the origin of a `map` in which this place is there."""
        return cls(Origin(here).position_at(Vector3(-in_map.x, -in_map.y, 0.0)))

    def in_map(self, position: EarthPosition, z_m: float = 0.0) -> Vector3:
        """Returns where a place is in `map`."""
        north_m, east_m = self._metres_per_degree()
        east_deg = math.remainder(position.longitude_deg - self.position.longitude_deg, 360.0)
        return Vector3(east_deg * east_m, (position.latitude_deg - self.position.latitude_deg) * north_m, z_m)

    def position_at(self, in_map: Vector3) -> EarthPosition:
        """Returns which place is there in `map`."""
        north_m, east_m = self._metres_per_degree()
        longitude_deg = math.remainder(self.position.longitude_deg + in_map.x / east_m, 360.0)
        return EarthPosition(self.position.latitude_deg + in_map.y / north_m, longitude_deg)

    def _metres_per_degree(self) -> tuple[float, float]:
        """Returns how long a degree to the north and one to the east are here."""
        latitude_rad = math.radians(self.position.latitude_deg)
        w2 = 1.0 - _ECCENTRICITY_SQUARED * math.sin(latitude_rad) ** 2
        north_m = _EQUATOR_M * (1.0 - _ECCENTRICITY_SQUARED) / w2**1.5
        east_m = _EQUATOR_M / math.sqrt(w2) * max(1e-6, math.cos(latitude_rad))
        return math.radians(north_m), math.radians(east_m)


def tile_at(position: EarthPosition, zoom: int) -> Tile:
    """Returns the tile in which a place is."""
    count = 1 << zoom
    latitude_rad = math.radians(max(-_MOST_LATITUDE_DEG, min(_MOST_LATITUDE_DEG, position.latitude_deg)))
    x = int((position.longitude_deg + 180.0) / 360.0 * count)
    y = int((1.0 - math.asinh(math.tan(latitude_rad)) / math.pi) / 2.0 * count)
    return Tile(zoom, x % count, max(0, min(count - 1, y)))


def tiles_around(position: EarthPosition, zoom: int, count: int) -> list[Tile]:
    """Returns the tile of a place and those around it, the nearest first: `count` to each side."""
    middle, width = tile_at(position, zoom), 1 << zoom
    steps = sorted(
        ((dx, dy) for dx in range(-count, count + 1) for dy in range(-count, count + 1)),
        key=lambda step: (step[0] ** 2 + step[1] ** 2, step),
    )
    tiles = (Tile(zoom, (middle.x + dx) % width, middle.y + dy) for dx, dy in steps if 0 <= middle.y + dy < width)
    return list(dict.fromkeys(tiles))
