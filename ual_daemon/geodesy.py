"""Converts geographic positions to local metres and back. WGS 84; geodesics by Karney's GeographicLib."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from geographiclib.geodesic import Geodesic
from typing_extensions import override

from ual.geometry import Vector3, vector3
from ual.types import GeoPoint

_WGS84 = Geodesic.WGS84
_F = _WGS84.f
_POLAR_M = _WGS84.a * (1.0 - _F)
_SECOND_ECCENTRICITY_SQUARED = (2.0 - _F) * _F / (1.0 - _F) ** 2
_SERIES_RANGE_M = 100_000.0
"""Up to this distance Vincenty's series are within 1 micrometre of the geodesic."""
_LEAST_CHANGE_RAD = 1e-12
"""A round after which the angle has changed by less leaves an error of a thousandth of that."""
_ROUNDS_COUNT = 6

_ZERO_DEG = 1e-7
"""1 cm; MAVLink's integers have no finer step."""


def is_zero(latitude_deg: float, longitude_deg: float) -> bool:
    """Returns whether a position is at latitude and longitude 0: what is left where none were given."""
    return abs(latitude_deg) < _ZERO_DEG and abs(longitude_deg) < _ZERO_DEG


@dataclass(frozen=True, slots=True)
class Projection(ABC):
    """A local frame on Earth: its origin, and how its metres relate to latitude and longitude.

    Each autopilot has its own projection, and a goal must be in the autopilot's metres. Choose the class that computes
    as the autopilot does. z is the altitude above the origin's altitude (not above a tangent plane), as in autopilots.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_amsl_m: float

    @abstractmethod
    def to_local(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Vector3:
        """Converts a geographic position to east, north, up in metres."""

    @abstractmethod
    def to_geo(self, position: Vector3) -> GeoPoint:
        """Converts east, north, up in metres to a geographic position (altitude above mean sea level)."""


class EllipsoidProjection(Projection):
    """Azimuthal equidistant on the WGS 84 ellipsoid: distance and bearing from the origin are exact."""

    __slots__ = ()

    @override
    def to_local(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Vector3:
        line = _WGS84.Inverse(
            self.latitude_deg, self.longitude_deg, latitude_deg, longitude_deg, Geodesic.DISTANCE | Geodesic.AZIMUTH
        )
        azimuth = math.radians(line["azi1"])
        return Vector3(
            line["s12"] * math.sin(azimuth), line["s12"] * math.cos(azimuth), altitude_amsl_m - self.altitude_amsl_m
        )

    @override
    def to_geo(self, position: Vector3) -> GeoPoint:
        distance_m = position.horizontal_norm()
        if 0.0 < distance_m < _SERIES_RANGE_M:
            latitude_deg, longitude_deg = self._near(position.x / distance_m, position.y / distance_m, distance_m)
            return GeoPoint(latitude_deg, longitude_deg, self.altitude_amsl_m + position.z)
        azimuth = math.degrees(math.atan2(position.x, position.y))
        end = _WGS84.Direct(
            self.latitude_deg,
            self.longitude_deg,
            azimuth,
            distance_m,
            Geodesic.LATITUDE | Geodesic.LONGITUDE,
        )
        return GeoPoint(end["lat2"], end["lon2"], self.altitude_amsl_m + position.z)

    def _near(self, sin_azimuth: float, cos_azimuth: float, distance_m: float) -> tuple[float, float]:
        """Returns latitude and longitude in degrees at a distance from the origin.

        By T. Vincenty, "Direct and inverse solutions of geodesics on the ellipsoid", Survey Review 23 (176), 1975. It
        takes a twentieth of GeographicLib's time, and each sample of a UAV has a place on Earth.
        """
        tan_u = (1.0 - _F) * math.tan(math.radians(self.latitude_deg))  # of the reduced latitude, as are those below
        cos_u = 1.0 / math.sqrt(1.0 + tan_u * tan_u)
        sin_u = tan_u * cos_u
        sin_alpha = cos_u * sin_azimuth
        cos_squared_alpha = 1.0 - sin_alpha * sin_alpha
        root = math.sqrt(1.0 + cos_squared_alpha * _SECOND_ECCENTRICITY_SQUARED)
        k = (root - 1.0) / (root + 1.0)
        b = k * (1.0 - 0.375 * k * k)
        from_equator_rad = 2.0 * math.atan2(tan_u, cos_azimuth)
        first_rad = sigma_rad = distance_m * (1.0 - k) / (_POLAR_M * (1.0 + k * k / 4.0))
        for _ in range(_ROUNDS_COUNT):
            sin, cos, middle = math.sin(sigma_rad), math.cos(sigma_rad), math.cos(from_equator_rad + sigma_rad)
            off = 2.0 * middle * middle - 1.0
            more = b / 6.0 * middle * (4.0 * sin * sin - 3.0) * (4.0 * middle * middle - 3.0)
            last_rad, sigma_rad = sigma_rad, first_rad + b * sin * (middle + b / 4.0 * (cos * off - more))
            if abs(sigma_rad - last_rad) < _LEAST_CHANGE_RAD:
                break
        sin, cos, middle = math.sin(sigma_rad), math.cos(sigma_rad), math.cos(from_equator_rad + sigma_rad)
        across = sin_u * sin - cos_u * cos * cos_azimuth
        latitude_rad = math.atan2(sin_u * cos + cos_u * sin * cos_azimuth, (1.0 - _F) * math.hypot(sin_alpha, across))
        c = _F / 16.0 * cos_squared_alpha * (4.0 + _F * (4.0 - 3.0 * cos_squared_alpha))
        on_sphere_rad = math.atan2(sin * sin_azimuth, cos_u * cos - sin_u * sin * cos_azimuth)
        series_rad = sigma_rad + c * sin * (middle + c * cos * (2.0 * middle * middle - 1.0))
        longitude_rad = on_sphere_rad - (1.0 - c) * _F * sin_alpha * series_rad
        longitude_deg = math.remainder(self.longitude_deg + math.degrees(longitude_rad), 360.0)
        return math.degrees(latitude_rad), longitude_deg


class SphereProjection(Projection):
    """Azimuthal equidistant on a sphere of 6,371,000 m, as PX4's ``MapProjection`` (lib/geo/geo.cpp) computes."""

    __slots__ = ()

    RADIUS_M = 6_371_000.0

    @override
    def to_local(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Vector3:
        lat0, lat = math.radians(self.latitude_deg), math.radians(latitude_deg)
        d_lon = math.radians(longitude_deg - self.longitude_deg)
        sin_lat0, cos_lat0, sin_lat, cos_lat = math.sin(lat0), math.cos(lat0), math.sin(lat), math.cos(lat)
        cos_lon = math.cos(d_lon)
        cos_c = sin_lat0 * sin_lat + cos_lat0 * cos_lat * cos_lon
        c = math.acos(cos_c if -1.0 <= cos_c <= 1.0 else math.copysign(1.0, cos_c))  # rounding may lead beyond 1
        k = c / math.sin(c) if c > 0.0 else 1.0
        north = k * (cos_lat0 * sin_lat - sin_lat0 * cos_lat * cos_lon)
        east = k * cos_lat * math.sin(d_lon)
        return vector3(east * self.RADIUS_M, north * self.RADIUS_M, altitude_amsl_m - self.altitude_amsl_m)

    @override
    def to_geo(self, position: Vector3) -> GeoPoint:
        x, y = position.y / self.RADIUS_M, position.x / self.RADIUS_M
        c = math.hypot(x, y)
        lat0 = math.radians(self.latitude_deg)
        altitude = self.altitude_amsl_m + position.z
        if c == 0.0:
            return GeoPoint(self.latitude_deg, self.longitude_deg, altitude)
        lat = math.asin(math.cos(c) * math.sin(lat0) + x * math.sin(c) * math.cos(lat0) / c)
        lon = math.atan2(y * math.sin(c), c * math.cos(lat0) * math.cos(c) - x * math.sin(lat0) * math.sin(c))
        return GeoPoint(math.degrees(lat), math.remainder(self.longitude_deg + math.degrees(lon), 360.0), altitude)


class FlatProjection(Projection):
    """A flat Earth. The distance between meridians is that at the mean latitude of the position and the origin, as in
    ArduPilot's ``Location::offset`` and ``get_vector_xy_from_origin_NE`` (AP_Common/Location.cpp).
    """

    __slots__ = ()

    METRES_PER_DEGREE = 111_318.84502145034
    _LEAST_SCALE = 0.01

    @override
    def to_local(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Vector3:
        d_lon = math.remainder(longitude_deg - self.longitude_deg, 360.0)
        return Vector3(
            d_lon * self.METRES_PER_DEGREE * self._scale(latitude_deg),
            (latitude_deg - self.latitude_deg) * self.METRES_PER_DEGREE,
            altitude_amsl_m - self.altitude_amsl_m,
        )

    @override
    def to_geo(self, position: Vector3) -> GeoPoint:
        latitude_deg = self.latitude_deg + position.y / self.METRES_PER_DEGREE
        d_lon = position.x / (self.METRES_PER_DEGREE * self._scale(latitude_deg))
        longitude_deg = math.remainder(self.longitude_deg + d_lon, 360.0)
        return GeoPoint(latitude_deg, longitude_deg, self.altitude_amsl_m + position.z)

    def _scale(self, latitude_deg: float) -> float:
        return max(math.cos(math.radians((latitude_deg + self.latitude_deg) / 2.0)), self._LEAST_SCALE)
