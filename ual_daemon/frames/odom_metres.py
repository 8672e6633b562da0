"""The metres of ``<ns>/odom``: how the autopilot's local metres lie in them, and so on Earth and in ``map``.

With `map_origin_geo`, ``map`` and ``<ns>/odom`` are azimuthal equidistant on the WGS 84 ellipsoid around their origins.
At the origin x is east and y is north, and z is the altitude above it. So both have true metres, and a rigid transform
relates them: a shift, and a turn by the convergence of their meridians. It is exact to 2 mm at 5 km, 13 mm at 10 km.

An autopilot's local metres are not true (see `Projection`). Every position passes here between them and ``<ns>/odom``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from geographiclib.geodesic import Geodesic
from typing_extensions import override

from ual.geometry import IDENTITY, Quaternion, Transform, Vector3
from ual_daemon.geodesy import EllipsoidProjection, Projection

_LARGEST_RANGE_M = 10_000.0
_LEAST_RANGE_M = 300.0
_FIT_TOLERANCE_M = 0.0005
"""Error in metres within which polynomials replace the geodesics, of which each costs a tenth of a millisecond."""

_Map = Callable[[float, float], tuple[float, float]]
_Coefficients = tuple[float, float, float, float, float, float, float, float, float]
"""Of x, y, x², xy, y², x³, x²y, xy², y³."""


class OdomMetres:
    """The metres of ``<ns>/odom`` where they are the autopilot's own. Immutable.

    Attributes:
        home: The origin of ``<ns>/odom`` in the local frame.
        projection: By which they are those of the ellipsoid; None where they are the autopilot's own.

    """

    __slots__ = ("_is_at_origin", "home", "projection")

    def __init__(self, home: Vector3, projection: Projection | None = None) -> None:
        self.home, self.projection = home, projection
        self._is_at_origin = home.x == home.y == home.z == 0.0

    def to_odom(self, local: Vector3) -> Vector3:
        """Converts a position in the autopilot's local frame."""
        return local if self._is_at_origin else local - self.home

    def to_local(self, in_odom: Vector3) -> Vector3:
        """Converts a position in ``<ns>/odom``."""
        return in_odom + self.home


class EarthMetres(OdomMetres):
    """The metres of ``<ns>/odom`` where they are those of the ellipsoid."""

    __slots__ = ("_ellipsoid", "_from_odom", "_from_odom_m", "_placed_by", "_to_odom", "_to_odom_m")

    def __init__(self, projection: Projection, home: Vector3) -> None:
        super().__init__(home, projection)
        self._placed_by = projection
        here = projection.to_geo(home)
        self._ellipsoid = EllipsoidProjection(here.latitude_deg, here.longitude_deg, 0.0)
        self._to_odom, self._to_odom_m = _fitted(self._exactly_to_odom)
        self._from_odom, self._from_odom_m = _fitted(self._exactly_from_odom)

    @override
    def to_odom(self, local: Vector3) -> Vector3:
        home = self.home
        x, y = local.x - home.x, local.y - home.y
        is_near = -self._to_odom_m <= x <= self._to_odom_m and -self._to_odom_m <= y <= self._to_odom_m
        x, y = _evaluate(self._to_odom, x, y) if is_near else self._exactly_to_odom(x, y)
        return Vector3(x, y, local.z - home.z)

    @override
    def to_local(self, in_odom: Vector3) -> Vector3:
        home, x, y = self.home, in_odom.x, in_odom.y
        is_near = -self._from_odom_m <= x <= self._from_odom_m and -self._from_odom_m <= y <= self._from_odom_m
        x, y = _evaluate(self._from_odom, x, y) if is_near else self._exactly_from_odom(x, y)
        return Vector3(x + home.x, y + home.y, in_odom.z + home.z)

    def in_map(self, origin: tuple[float, float, float]) -> tuple[Vector3, Quaternion]:
        """Returns where the origin of ``<ns>/odom`` is in a ``map`` with an origin on Earth, and its turn there."""
        here, (latitude_deg, longitude_deg, altitude_m) = self._ellipsoid, origin
        line = Geodesic.WGS84.Inverse(
            latitude_deg,
            longitude_deg,
            here.latitude_deg,
            here.longitude_deg,
            Geodesic.DISTANCE | Geodesic.AZIMUTH,
        )
        azimuth, length_m = math.radians(line["azi1"]), line["s12"]
        turn = Quaternion.from_yaw(math.radians(line["azi2"]) - azimuth) if length_m > 0.0 else IDENTITY
        height_m = self._placed_by.altitude_amsl_m + self.home.z - altitude_m
        return Vector3(length_m * math.sin(azimuth), length_m * math.cos(azimuth), height_m), turn

    def _exactly_to_odom(self, x: float, y: float) -> tuple[float, float]:
        place = self._placed_by.to_geo(Vector3(x + self.home.x, y + self.home.y, 0.0))
        in_odom = self._ellipsoid.to_local(place.latitude_deg, place.longitude_deg, 0.0)
        return in_odom.x, in_odom.y

    def _exactly_from_odom(self, x: float, y: float) -> tuple[float, float]:
        place = self._ellipsoid.to_geo(Vector3(x, y, 0.0))
        local = self._placed_by.to_local(place.latitude_deg, place.longitude_deg, 0.0)
        return local.x - self.home.x, local.y - self.home.y


@dataclass(frozen=True, slots=True)
class FrameInLocal:
    """A fixed frame in the autopilot's local frame."""

    to_odom: Transform
    metres: OdomMetres

    def to_local(self, position: Vector3) -> Vector3:
        """Converts a position in the frame to the local frame."""
        return self.metres.to_local(self.to_odom.apply(position))

    def from_local(self, local: Vector3) -> Vector3:
        """Converts a position in the local frame to the frame."""
        return self.to_odom.inverse().apply(self.metres.to_odom(local))

    @property
    def rotation(self) -> Quaternion:
        """Its axes in the local frame."""
        return self.to_odom.rotation


def _fitted(exact: _Map) -> tuple[tuple[_Coefficients, _Coefficients], float]:
    """Returns polynomials for a map that leaves 0 where it is, and within how many metres of 0 in x and y they hold."""
    reach_m = _LARGEST_RANGE_M
    while reach_m >= _LEAST_RANGE_M:
        cubics = _cubics(exact, reach_m / 2.0)
        if all(
            math.dist(_evaluate(cubics, x * reach_m, y * reach_m), exact(x * reach_m, y * reach_m)) <= _FIT_TOLERANCE_M
            for x, y in ((1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (0.75, 0.25), (-0.25, 0.75))
        ):
            return cubics, reach_m
        reach_m /= 2.0
    return (_ZERO, _ZERO), -1.0


_ZERO: _Coefficients = (0.0,) * 9


def _cubics(exact: _Map, h: float) -> tuple[_Coefficients, _Coefficients]:
    """Returns the cubic polynomials of both values, by differences over a step of h."""
    places = {(i, j): exact(i * h, j * h) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j}
    places |= {(i, j): exact(i * h, j * h) for i, j in ((2, 0), (-2, 0), (0, 2), (0, -2))}
    first, second = ({place: value[k] for place, value in places.items()} for k in (0, 1))
    return _cubic(first, h), _cubic(second, h)


def _cubic(f: dict[tuple[int, int], float], h: float) -> _Coefficients:
    x, xx, xxx = _along(f[1, 0], f[-1, 0], f[2, 0], f[-2, 0])
    y, yy, yyy = _along(f[0, 1], f[0, -1], f[0, 2], f[0, -2])
    xy = (f[1, 1] - f[1, -1] - f[-1, 1] + f[-1, -1]) / 4.0
    xxy = (f[1, 1] - f[1, -1] + f[-1, 1] - f[-1, -1]) / 4.0 - y - yyy
    xyy = (f[1, 1] + f[1, -1] - f[-1, 1] - f[-1, -1]) / 4.0 - x - xxx
    h2, h3 = h * h, h * h * h
    return (x / h, y / h, xx / h2, xy / h2, yy / h2, xxx / h3, xxy / h3, xyy / h3, yyy / h3)


def _along(plus: float, minus: float, plus_2: float, minus_2: float) -> tuple[float, float, float]:
    """Returns the coefficients of degree 1, 2 and 3 on one axis, by the values at 1, -1, 2 and -2."""
    cubic = ((plus_2 - minus_2) / 2.0 - (plus - minus)) / 6.0
    return (plus - minus) / 2.0 - cubic, (8.0 * (plus + minus) - (plus_2 + minus_2) / 2.0) / 12.0, cubic


def _evaluate(cubics: tuple[_Coefficients, _Coefficients], x: float, y: float) -> tuple[float, float]:
    (a, b, c, d, e, f, g, h, i), (k, m, n, o, p, q, r, s, t) = cubics
    return (
        x * (a + x * (c + x * f + y * g) + y * (d + y * h)) + y * (b + y * (e + y * i)),
        x * (k + x * (n + x * q + y * r) + y * (o + y * s)) + y * (m + y * (p + y * t)),
    )
