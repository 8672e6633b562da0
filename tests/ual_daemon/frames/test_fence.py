"""The geometry of a disc as a part of a fence; polygons and bands are tested with the geofence."""

from __future__ import annotations

import math

import pytest

from ual.geometry import Vector3
from ual_daemon.frames.fence import Disc, Fence


def test_a_disc_is_a_part_of_the_fence_like_any_other() -> None:
    fence = Fence([]).narrowed(-1.0, 50.0, Disc(10.0, 0.0, 5.0))
    inside, outside = Vector3(12.0, 3.0, 5.0), Vector3(18.0, 0.0, 5.0)
    assert fence.is_inside(inside)
    assert not fence.is_inside(outside)
    assert fence.distance_m(outside) == pytest.approx(3.0, abs=0.01)
    assert fence.distance_m(Vector3(18.0, 0.0, 54.0)) == pytest.approx(5.0, abs=0.01)
    assert fence.clearance_m(inside) == pytest.approx(5.0 - math.hypot(2.0, 3.0), abs=0.01)
    assert fence.exit_point([inside, outside]) == outside
    assert fence.exit_point([outside, inside]) is None  # it comes in
    assert fence.exit_point([outside, Vector3(0.0, 0.0, 5.0)]) is not None  # it crosses
    assert fence.exit_point([outside, Vector3(18.0, 9.0, 5.0)]) is not None  # it stays outside


def test_a_polygon_and_a_disc_hold_together() -> None:
    fence = Fence([(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)]).narrowed(-1.0, 9.0, Disc(0.0, 0.0, 15.0))
    assert fence.is_inside(Vector3(5.0, 5.0, 1.0))
    assert not fence.is_inside(Vector3(19.0, 1.0, 1.0))
    assert not fence.is_inside(Vector3(-5.0, 5.0, 1.0))
    assert fence.clearance_m(Vector3(5.0, 1.0, 4.0)) == pytest.approx(1.0, abs=0.01)
    assert fence.distance_m(Vector3(19.0, 0.0, 4.0)) == pytest.approx(4.0, abs=0.01)
