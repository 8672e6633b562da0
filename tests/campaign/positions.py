"""Positions on Earth, in metres: the judge's own arithmetic, good to a centimetre within 100 m."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tests.campaign.record import Place

_EQUATOR_M, _ECCENTRICITY_2 = 6378137.0, 6.69437999014e-3


@dataclass(frozen=True)
class Origin:
    """Origin of the simulator: degrees, and metres above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float

    def current_position(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> Place:
        """Returns metres east, north and up of the origin."""
        east_m, north_m = self._metres_per_degree()
        return (
            (longitude_deg - self.longitude_deg) * east_m,
            (latitude_deg - self.latitude_deg) * north_m,
            altitude_m - self.altitude_m,
        )

    def geo(self, place: Place) -> tuple[float, float, float]:
        """Returns latitude, longitude (degrees) and altitude above mean sea level (metres)."""
        east_m, north_m = self._metres_per_degree()
        return (
            self.latitude_deg + place[1] / north_m,
            self.longitude_deg + place[0] / east_m,
            self.altitude_m + place[2],
        )

    def _metres_per_degree(self) -> tuple[float, float]:
        latitude = math.radians(self.latitude_deg)
        w = 1.0 - _ECCENTRICITY_2 * math.sin(latitude) ** 2
        across, along = _EQUATOR_M / math.sqrt(w), _EQUATOR_M * (1.0 - _ECCENTRICITY_2) / w**1.5
        return math.radians(across * math.cos(latitude)), math.radians(along)


def distance_m(a: Place, b: Place) -> float:
    """Returns how far apart they are."""
    return math.dist(a, b)
