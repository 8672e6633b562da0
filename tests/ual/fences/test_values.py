"""Zones as values: the area that each encloses, the zone that forbids a place, and nothing is lost between messages and
values.
"""

from __future__ import annotations

import math

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from ual.fences import FencePlan, FenceZone, KeptFence, RallyPoint
from ual.fences.values import crossing, leaves_out
from ual.types import AltitudeReference
from ual.wire import fence as wire
from ual.wire import requests

FIELD = FenceZone(True, ((47.0, 8.0), (47.002, 8.0), (47.002, 8.002), (47.0, 8.002)))
POND = FenceZone(False, ((47.001, 8.001),), 20.0)
M_LATITUDE = math.degrees(1.0 / 6_371_000.0)


def test_a_polygon_encloses_what_is_between_its_sides() -> None:
    assert FIELD.encloses(47.001, 8.0001)
    assert not FIELD.encloses(47.0021, 8.0001)
    assert not FIELD.encloses(47.001, 7.9999)
    notched = FenceZone(True, (*FIELD.points, (47.001, 8.001)))
    assert not notched.encloses(47.0005, 8.001)
    assert notched.encloses(47.0015, 8.001)


@given(st.floats(-80.0, 80.0), st.floats(-179.0, 179.0), st.floats(1.0, 1000.0), st.floats(0.0, 6.28))
def test_a_circle_encloses_what_is_nearer_than_its_radius(
    latitude_deg: float, longitude_deg: float, radius_m: float, angle: float
) -> None:
    circle = FenceZone(True, ((latitude_deg, longitude_deg),), radius_m)

    def away(share: float) -> tuple[float, float]:
        north, east = share * radius_m * math.cos(angle), share * radius_m * math.sin(angle)
        east_deg = east * M_LATITUDE / math.cos(math.radians(latitude_deg))
        return latitude_deg + north * M_LATITUDE, longitude_deg + east_deg

    assert circle.encloses(*away(0.98))
    assert not circle.encloses(*away(1.02))


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ((47.0005, 8.0005), ""),
        ((47.003, 8.0005), "it is outside the inclusion polygon of 4 corners"),
        ((47.001, 8.001), "it is inside the exclusion circle of 20 m"),
    ],
)
def test_the_zone_that_forbids_a_position_is_named(place: tuple[float, float], why: str) -> None:
    assert leaves_out((FIELD, POND), *place) == why


def test_of_several_inclusions_all_count_unless_any_is_enough() -> None:
    other = FenceZone(True, ((48.0, 8.0),), 50.0)
    assert leaves_out((FIELD, other), 47.0005, 8.0005) == "it is outside the inclusion circle of 50 m"
    assert leaves_out((FIELD, other), 47.0005, 8.0005, unites_inclusions=True) == ""
    assert leaves_out((FIELD, other), 46.0, 8.0, unites_inclusions=True) != ""


@pytest.mark.parametrize("is_enabled", [None, False, True])
def test_nothing_is_lost_in_a_message(is_enabled: bool | None) -> None:
    points = (RallyPoint(1.5, 2.5, 20), RallyPoint(1.5, 2.5, -3, AltitudeReference.AMSL))
    kept = KeptFence((FIELD, POND), points, is_enabled, None if is_enabled else (47.1, 8.1))
    assert wire.kept_fence_from_proto(wire.kept_fence_to_proto(kept)) == kept
    plan = FencePlan(kept.zones, points)
    request = requests.upload_fence_request(plan, replace=True, enable=False, force=True)
    assert requests.upload_fence_arguments(request) == {"plan": plan, "replace": True, "enable": False, "force": True}


@pytest.mark.parametrize(
    ("corners", "sides"),
    [
        ([(0, 0), (0, 2), (2, 2), (2, 0)], None),
        ([(0, 0), (0, 2), (2, 2), (2, 0), (0, 0)], None),  # the first corner again at the end
        ([(0, 0), (2, 2), (0, 2), (2, 0)], (1, 3)),  # a bow tie
        ([(0, 0), (0, 2), (1, 0), (2, 2), (2, 0)], (2, 5)),  # a corner on another side
        ([(0, 0), (0, 2), (0, 1), (2, 1)], (1, 2)),  # a side that turns back
        ([(0, 0), (0, 1), (0, 2)], (1, 3)),  # without an area
    ],
)
def test_sides_that_cross_or_touch_are_found(corners: list[tuple[int, int]], sides: tuple[int, int] | None) -> None:
    assert crossing([(47.0 + a * 1e-4, 8.0 + b * 1e-4) for a, b in corners]) == sides


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=3, max_size=7))
def test_a_polygon_crosses_itself_where_shapely_says_so(corners: list[tuple[int, int]]) -> None:
    places = [each for i, each in enumerate(corners) if each != corners[i - 1]]
    if len(places) > 2:
        assert (crossing([(a * 1e-7, b * 1e-7) for a, b in places]) is None) == shapely.Polygon(places).is_valid
