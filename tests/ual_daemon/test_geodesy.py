from __future__ import annotations

import math

import pytest
from geographiclib.geodesic import Geodesic
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Transformer

from tests.strategies import numbers
from ual.geometry import Vector3
from ual_daemon.geodesy import EllipsoidProjection, FlatProjection, Projection, SphereProjection

SEVILLE = (37.4117, -6.0013, 10.0)

ORIGINS = st.tuples(st.floats(-89.0, 89.0), st.floats(-180.0, 180.0), st.floats(-100.0, 5000.0))
OFFSETS = st.builds(Vector3, numbers(50_000.0), numbers(50_000.0), numbers(1_000.0))


def longitude_gap_deg(a: float, b: float) -> float:
    return abs(math.remainder(a - b, 360.0))


@pytest.mark.parametrize("kind", [EllipsoidProjection, SphereProjection])
@given(ORIGINS, OFFSETS)
def test_metres_become_degrees_and_metres_again(
    kind: type[Projection], origin: tuple[float, float, float], offset: Vector3
) -> None:
    projection = kind(*origin)
    point = projection.to_geo(offset)
    assert -90.0 <= point.latitude_deg <= 90.0
    assert -180.0 <= point.longitude_deg <= 180.0
    assert point.altitude_amsl_m is not None
    again = projection.to_local(point.latitude_deg, point.longitude_deg, point.altitude_amsl_m)
    assert (again - offset).norm() <= 1e-6


@pytest.mark.parametrize("kind", [EllipsoidProjection, SphereProjection])
@given(ORIGINS, st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_degrees_become_metres_and_degrees_again(
    kind: type[Projection], origin: tuple[float, float, float], north_deg: float, east_deg: float
) -> None:
    projection = kind(*origin)
    latitude = max(-90.0, min(90.0, origin[0] + north_deg))
    longitude = math.remainder(origin[1] + east_deg, 360.0)
    again = projection.to_geo(projection.to_local(latitude, longitude, 0.0))
    assert again.latitude_deg == pytest.approx(latitude, abs=1e-10)
    assert longitude_gap_deg(again.longitude_deg, longitude) * math.cos(math.radians(latitude)) <= 1e-10


@pytest.mark.parametrize("kind", [EllipsoidProjection, SphereProjection])
@given(ORIGINS)
def test_the_origin_is_at_zero(kind: type[Projection], origin: tuple[float, float, float]) -> None:
    projection = kind(*origin)
    assert projection.to_local(*origin).norm() <= 1e-9
    point = projection.to_geo(Vector3())
    assert point.latitude_deg == pytest.approx(origin[0], abs=1e-12)
    assert longitude_gap_deg(point.longitude_deg, origin[1]) <= 1e-12
    assert point.altitude_amsl_m == origin[2]


@pytest.mark.parametrize("kind", [EllipsoidProjection, SphereProjection])
def test_axes_are_east_north_up(kind: type[Projection]) -> None:
    projection = kind(*SEVILLE)
    east = projection.to_local(SEVILLE[0], SEVILLE[1] + 1e-4, SEVILLE[2])
    north = projection.to_local(SEVILLE[0] + 1e-4, SEVILLE[1], SEVILLE[2])
    up = projection.to_local(SEVILLE[0], SEVILLE[1], SEVILLE[2] + 7.0)
    assert east.x == pytest.approx(8.84, abs=0.02)
    assert north.y == pytest.approx(11.11, abs=0.02)
    assert (abs(east.y), abs(north.x)) == pytest.approx((0.0, 0.0), abs=1e-4)
    assert up == Vector3(0.0, 0.0, 7.0)


@given(ORIGINS, OFFSETS)
def test_the_ellipsoid_agrees_with_proj(origin: tuple[float, float, float], offset: Vector3) -> None:
    latitude, longitude, altitude = origin
    proj = Transformer.from_pipeline(
        f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f"+step +proj=aeqd +lat_0={latitude!r} +lon_0={longitude!r} +ellps=WGS84"
    )
    point = EllipsoidProjection(*origin).to_geo(offset)
    x, y = proj.transform(point.longitude_deg, point.latitude_deg)
    assert (x, y) == pytest.approx((offset.x, offset.y), abs=1e-3)  # PROJ takes what is within 0.6 mm for the origin
    assert point.altitude_amsl_m == pytest.approx(altitude + offset.z)


@pytest.mark.parametrize(
    # What PX4's formulas (src/lib/geo/geo.cpp, MapProjection::project), compiled as C++ with its types, answer.
    ("origin", "place", "north_m", "east_m"),
    [
        ((47.397742, 8.545594), (47.398742, 8.546594), 111.195412, 75.2669678),
        ((47.397742, 8.545594), (47.3977424, 8.5455945), 0.0444779694, 0.0376341976),
        ((37.4117, -6.0013), (37.5117, -5.9013), 11124.1729, 8820.30664),
        ((-33.8568, 151.2153), (-33.9568, 151.1153), -11123.9805, -9223.16602),
        ((0.0, 0.0), (0.001, -0.001), 111.194923, -111.194923),
        ((64.1, -179.9999), (64.101, 179.9999), 111.194939, -9.71367931),
        ((-77.8463, 166.6683), (-77.8, 167.0), 5126.27051, 7794.32715),
    ],
)
def test_the_sphere_agrees_with_px4(
    origin: tuple[float, float], place: tuple[float, float], north_m: float, east_m: float
) -> None:
    found = SphereProjection(*origin, 0.0).to_local(*place, 0.0)
    assert (found.y, found.x) == pytest.approx((north_m, east_m), rel=1e-7)  # PX4 answers in single precision


@given(ORIGINS, st.floats(-90.0, 90.0), st.floats(-180.0, 180.0))
def test_the_sphere_is_px4s_formula_to_the_last_bit(
    origin: tuple[float, float, float], latitude_deg: float, longitude_deg: float
) -> None:
    lat0, lat = math.radians(origin[0]), math.radians(latitude_deg)
    d_lon = math.radians(longitude_deg - origin[1])
    cos_c = math.sin(lat0) * math.sin(lat) + math.cos(lat0) * math.cos(lat) * math.cos(d_lon)
    c = math.acos(max(-1.0, min(1.0, cos_c)))
    k = c / math.sin(c) if c > 0.0 else 1.0
    north = k * (math.cos(lat0) * math.sin(lat) - math.sin(lat0) * math.cos(lat) * math.cos(d_lon))
    east = k * math.cos(lat) * math.sin(d_lon)
    found = SphereProjection(*origin).to_local(latitude_deg, longitude_deg, 7.0)
    assert found == Vector3(east * SphereProjection.RADIUS_M, north * SphereProjection.RADIUS_M, 7.0 - origin[2])


@given(st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.builds(Vector3, numbers(1000.0), numbers(1000.0)))
def test_sphere_and_ellipsoid_differ_by_less_than_one_percent(
    latitude: float, longitude: float, offset: Vector3
) -> None:
    point = EllipsoidProjection(latitude, longitude, 0.0).to_geo(offset)
    on_sphere = SphereProjection(latitude, longitude, 0.0).to_local(point.latitude_deg, point.longitude_deg, 0.0)
    assert (on_sphere - offset).norm() <= 0.01 * offset.norm() + 1e-6


@given(st.tuples(st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.floats(-100.0, 5000.0)), OFFSETS)
def test_a_flat_earth_becomes_degrees_and_metres_again(origin: tuple[float, float, float], offset: Vector3) -> None:
    projection = FlatProjection(*origin)
    point = projection.to_geo(offset)
    assert -180.0 <= point.longitude_deg <= 180.0
    assert point.altitude_amsl_m is not None
    assert (projection.to_local(point.latitude_deg, point.longitude_deg, point.altitude_amsl_m) - offset).norm() <= 1e-6


def test_a_flat_earth_is_near_the_true_one_and_as_wrong_as_ardupilots() -> None:
    flat, true = FlatProjection(*SEVILLE), EllipsoidProjection(*SEVILLE)
    there = flat.to_local(SEVILLE[0] + 0.01, SEVILLE[1] + 0.01, SEVILLE[2])
    # by hand: 0.01 degrees of 111.3188 km each, the longitude's by the cosine of the latitude half way
    assert (there.x, there.y) == pytest.approx((1113.188 * math.cos(math.radians(37.4167)), 1113.188), abs=0.01)
    assert 1.0 < (there - true.to_local(SEVILLE[0] + 0.01, SEVILLE[1] + 0.01, SEVILLE[2])).norm() < 5.0


@pytest.mark.parametrize("latitude_deg", [-90.0, -89.9999, 0.0, 45.0, 89.9999, 90.0])
@pytest.mark.parametrize("distance_m", [1e-9, 1.0, 10_000.0, 99_999.0, 100_001.0, 5_000_000.0])
def test_near_and_far_are_on_the_geodesic(latitude_deg: float, distance_m: float) -> None:
    for azimuth_deg in range(-180, 180, 15):
        line = Geodesic.WGS84.Direct(latitude_deg, 179.999, azimuth_deg, distance_m)
        azimuth_rad = math.radians(azimuth_deg)
        offset = Vector3(distance_m * math.sin(azimuth_rad), distance_m * math.cos(azimuth_rad), 0.0)
        point = EllipsoidProjection(latitude_deg, 179.999, 0.0).to_geo(offset)
        apart = Geodesic.WGS84.Inverse(line["lat2"], line["lon2"], point.latitude_deg, point.longitude_deg)
        assert apart["s12"] <= 1e-6
