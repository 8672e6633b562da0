"""Positions that an autopilot would drop, as they lie beyond its own fence."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.snapshots import changed
from ual.geometry import Vector3
from ual.types import GeoPoint
from ual_daemon.backends.values import AutopilotFence, EarthReference, FenceLimit, Snapshot, Zone
from ual_daemon.flight.policy.dropped_positions import DroppedPositions
from ual_daemon.frames.fence import Fence
from ual_daemon.geodesy import FlatProjection

ORIGIN = FlatProjection(47.0, 8.0, 500.0)
POND = ORIGIN.to_geo(Vector3(20.0, 0.0, 0.0))
OWN = AutopilotFence(
    radius=FenceLimit(40.0, "FENCE_RADIUS"),
    highest=FenceLimit(30.0, "FENCE_ALT_MAX"),
    zones=(Zone("exclusion circle 1 of 1", False, ((POND.latitude_deg, POND.longitude_deg),), 5.0),),
)
FENCED = Snapshot(
    0.0,
    autopilot_fence=OWN,
    earth=EarthReference(projection=ORIGIN, home_geo=GeoPoint(47.0, 8.0), home_altitude_amsl_m=500.0),
)
coordinates = st.floats(-45.0, 45.0)


def beyond_m(p: Vector3) -> float:
    """Returns the distance of a position beyond the fence; negative inside."""
    return max(math.hypot(p.x, p.y) - 40.0, p.z - 30.0, 5.0 - math.hypot(p.x - 20.0, p.y))


@given(st.lists(st.builds(Vector3, coordinates, coordinates, st.floats(0.0, 35.0)), min_size=1, max_size=20))
def test_those_beyond_its_fence_are_dropped_and_those_well_inside_are_not(positions: list[Vector3]) -> None:
    dropped = DroppedPositions()
    for position in positions:
        if beyond_m(position) > 0.05:
            assert dropped.has(position, FENCED)
        elif beyond_m(position) < -0.7:  # UAL's own reserve is 1 m
            assert not dropped.has(position, FENCED)


def test_none_is_dropped_without_a_fence_or_where_it_is_not_known_where_that_lies() -> None:
    far = Vector3(500.0, 0.0, 5.0)
    assert not DroppedPositions().has(far, FENCED._replace(autopilot_fence=None))
    assert not DroppedPositions().has(far, changed(FENCED, projection=None))
    assert not DroppedPositions().has(far, changed(FENCED, home_geo=None))


def test_a_fence_that_has_changed_counts_at_once() -> None:
    dropped, place = DroppedPositions(), Vector3(-30.0, 0.0, 5.0)
    assert not dropped.has(place, FENCED)
    assert dropped.has(place, FENCED._replace(autopilot_fence=OWN._replace(radius=FenceLimit(15.0, "FENCE_RADIUS"))))
    assert not dropped.has(place, FENCED)


def test_within_the_clearance_of_an_earlier_position_nothing_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    dropped = DroppedPositions()
    assert not dropped.has(Vector3(-10.0, 0.0, 10.0), FENCED)

    def fail(_: Fence, __: Vector3) -> float:
        raise AssertionError

    monkeypatch.setattr(Fence, "clearance_m", fail)
    for step in range(50):
        assert not dropped.has(Vector3(-10.0 + step / 10.0, 0.0, 10.0), FENCED)
