"""Areas with holes and several parts, against an oracle that only counts sides and samples points."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from ual.geometry import Vector3
from ual_daemon.frames.area import Area, LocalZone, Point2
from ual_daemon.frames.fence import Disc, Fence

RESERVE_M = 1.0
SURE_M = 0.02
"""Nearer to an edge than this, the oracle does not judge."""
SQUARE = ((0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0))
HOLE = LocalZone("hole", False, ((8.0, 8.0), (12.0, 8.0), (12.0, 12.0), (8.0, 12.0)))
LEFT = LocalZone("left", True, ((0.0, 0.0), (8.0, 0.0), (8.0, 20.0), (0.0, 20.0)))
RIGHT = LocalZone("right", True, ((12.0, 0.0), (20.0, 0.0), (20.0, 20.0), (12.0, 20.0)))

coordinates = st.integers(-1500, 1500).map(lambda number: number / 100.0)  # places come in 1e-7 degrees, of 1 cm
points = st.tuples(coordinates, coordinates)
corners = st.lists(points, min_size=3, max_size=6).map(tuple)  # they may cross themselves


@st.composite
def zones(draw: st.DrawFn) -> list[LocalZone]:
    kinds = draw(st.lists(st.booleans(), min_size=1, max_size=4))
    return [LocalZone(str(i), is_inclusion, draw(corners)) for i, is_inclusion in enumerate(kinds)]


def is_in(point: Point2, polygon: Sequence[Point2]) -> bool:
    """Counts the sides to the right of a point."""
    x, y = point
    count = 0
    for (ax, ay), (bx, by) in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        if (ay > y) != (by > y) and x < ax + (bx - ax) * (y - ay) / (by - ay):
            count += 1
    return count % 2 == 1


def edge_m(point: Point2, polygon: Sequence[Point2]) -> float:
    """The distance of a point from the nearest side."""
    found = math.inf
    for a, b in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
        dx, dy = b[0] - a[0], b[1] - a[1]
        squared = dx * dx + dy * dy
        share = ((point[0] - a[0]) * dx + (point[1] - a[1]) * dy) / squared if squared > 0.0 else 0.0
        share = min(1.0, max(0.0, share))
        found = min(found, math.dist(point, (a[0] + share * dx, a[1] + share * dy)))
    return found


def margin_m(point: Point2, zones: Sequence[LocalZone]) -> float:
    """Returns the distance by which a point is on the right side of all zones with their reserve: negative where it is
    not.
    """
    found = math.inf
    for zone in zones:
        is_right = is_in(point, zone.corners) == zone.is_inclusion
        found = min(found, (1.0 if is_right else -1.0) * edge_m(point, zone.corners) - RESERVE_M)
    return found


def along(a: Point2, b: Point2, count: int = 200) -> list[Point2]:
    return [(a[0] + (b[0] - a[0]) * i / count, a[1] + (b[1] - a[1]) * i / count) for i in range(count + 1)]


@given(zones(), points)
def test_a_point_is_inside_where_it_is_on_the_right_side_of_each_zone(found: list[LocalZone], point: Point2) -> None:
    margin = margin_m(point, found)
    assume(abs(margin) > SURE_M)
    area = Area((), found, RESERVE_M)
    assert area.has(point) == (margin > 0.0)
    assert (area.zone_left(None, point) == "") == (margin > 0.0)
    assert (area.distance_m(point) == 0.0) == (margin > 0.0)


@given(zones(), points, st.floats(-math.pi, math.pi))
def test_the_distance_and_the_clearance_are_never_too_large(
    found: list[LocalZone], point: Point2, heading: float
) -> None:
    area = Area((), found, RESERVE_M)
    assume(not area.is_nowhere)
    is_inside = area.has(point)
    free_m = 0.999 * min(40.0, area.clearance_m(point) if is_inside else area.distance_m(point)) - SURE_M
    assume(free_m > 0.0)
    there = point[0] + free_m * math.cos(heading), point[1] + free_m * math.sin(heading)
    assert area.has(there) is is_inside


@given(zones(), points)
def test_the_distance_leads_out_of_each_zone(found: list[LocalZone], point: Point2) -> None:
    margin = margin_m(point, found)
    assume(margin < 0.0)
    assert Area((), found, RESERVE_M).distance_m(point) > -margin - SURE_M


@given(zones(), points, points)
def test_a_segment_is_inside_where_each_of_its_points_is(found: list[LocalZone], a: Point2, b: Point2) -> None:
    margins = [margin_m(point, found) for point in along(a, b)]
    step_m = math.dist(a, b) / 200
    area = Area((), found, RESERVE_M)
    if min(margins) > step_m + SURE_M:
        assert area.has_segment(a, b)
        assert area.zone_left(a, b) == ""
    elif min(margins) < -SURE_M:
        assert not area.has_segment(a, b)
        assert area.zone_left(a, b) != ""


def entries_count(found: list[LocalZone], a: Point2, b: Point2) -> int:
    """Returns the number of entries of a segment; discards segments that may enter between two samples of the
    oracle.
    """
    margins = [margin_m(point, found) for point in along(a, b)]
    sure_m = math.dist(a, b) / 200 + 2.0 * SURE_M  # a margin changes by no more than the way
    assume(all(p * q < 0.0 or abs(p) + abs(q) > sure_m for p, q in itertools.pairwise(margins)))
    return sum(q > 0.0 >= p for p, q in zip([-1.0, *margins], margins, strict=False))


@given(zones(), points, points)
def test_a_segment_is_entered_as_often_as_its_points_show(found: list[LocalZone], a: Point2, b: Point2) -> None:
    count, area = entries_count(found, a, b), Area((), found, RESERVE_M)
    assert area.is_touched(a, b) == (count > 0)
    assert area.is_entered_once(a, b) == (count <= 1)


@given(st.floats(-3.0, 23.0), st.floats(-3.0, 23.0))
def test_a_segment_past_a_hole_is_entered_twice_where_it_crosses_it(left_y: float, right_y: float) -> None:
    found = [HOLE, LocalZone("field", True, SQUARE)]
    a, b = (-5.0, left_y), (25.0, right_y)
    count, area = entries_count(found, a, b), Area((), found, RESERVE_M)
    assert area.is_touched(a, b) == (count > 0)
    assert area.is_entered_once(a, b) == (count <= 1)


@given(st.booleans(), points)
def test_united_inclusions_may_touch_each_other(is_left_first: bool, point: Point2) -> None:
    pair = [LEFT, LocalZone("middle", True, ((8.0, 0.0), (14.0, 0.0), (14.0, 20.0), (8.0, 20.0))), RIGHT]
    area = Area((), pair if is_left_first else pair[::-1], RESERVE_M, unites_inclusions=True)
    margin = margin_m(point, [LocalZone("field", True, SQUARE)])
    assume(abs(margin) > SURE_M)
    assert area.has(point) == (margin > 0.0)


def test_inclusions_hold_together_or_are_united() -> None:
    together, united = Area((), [LEFT, RIGHT], 1.0), Area((), [LEFT, RIGHT], 1.0, unites_inclusions=True)
    assert together.is_nowhere
    assert not together.has((4.0, 4.0))
    assert united.has((4.0, 4.0))
    assert united.has((16.0, 4.0))
    assert not united.has_segment((4.0, 4.0), (16.0, 4.0))
    assert united.zone_left((4.0, 4.0), (16.0, 4.0)) == "its 2 inclusions together"
    assert united.distance_m((10.0, 4.0)) == pytest.approx(3.0, abs=0.01)


def test_exclusions_alone_leave_the_area_unbounded() -> None:
    area = Area((), [HOLE], RESERVE_M)
    assert area.has((1e6, -1e6))
    assert area.has_segment((0.0, 0.0), (1e6, 0.0))
    assert not area.is_convex
    assert area.clearance_m((10.0, 110.0)) == pytest.approx(97.0, abs=0.01)
    assert area.distance_m((10.0, 11.0)) == pytest.approx(2.0, abs=0.01)


def test_a_polygon_is_cut_by_zones_and_names_only_these() -> None:
    area = Area(SQUARE, [HOLE], RESERVE_M)
    assert area.has((5.0, 5.0))
    assert not area.has((10.0, 10.0))
    assert not area.has((25.0, 5.0))
    assert area.zone_left(None, (25.0, 5.0)) == ""
    assert area.zone_left((1.0, 10.0), (19.0, 10.0)) == "hole"
    assert area.distance_m((10.0, 12.5)) == pytest.approx(0.5, abs=0.01)
    assert area.clearance_m((10.0, 15.0)) == pytest.approx(2.0, abs=0.01)


def test_a_zone_that_is_entered_en_route_is_named_before_one_that_is_left() -> None:
    other = LocalZone("other", False, ((14.0, 8.0), (18.0, 8.0), (18.0, 12.0), (14.0, 12.0)))
    area = Area((), [HOLE, other], RESERVE_M)
    assert area.zone_left((10.0, 10.0), (25.0, 10.0)) == "other"
    assert area.zone_left((10.0, 10.0), (5.0, 10.0)) == "hole"


# --- As a part of a fence ---------------------------------------------------------------------------------------------


def at(x: float, y: float, z: float = 5.0) -> Vector3:
    return Vector3(x, y, z)


def test_who_is_in_a_hole_may_come_out_but_not_through_the_next() -> None:
    other = LocalZone("other", False, ((16.0, 8.0), (20.0, 8.0), (20.0, 12.0), (16.0, 12.0)))
    fence = Fence([]).cut([HOLE, other], RESERVE_M, unites_inclusions=False)
    inside = at(12.5, 10.0)
    assert not fence.is_inside(inside)
    assert fence.exit_point([inside, at(14.0, 10.0)]) is None
    assert fence.exit_point([inside, at(13.5, 10.0), at(14.0, 30.0)]) is None
    assert fence.exit_point([inside, at(25.0, 10.0)]) == at(25.0, 10.0)  # out, and through the other one
    assert fence.exit_point([inside, at(18.0, 10.0)]) == at(18.0, 10.0)  # into the other one
    assert fence.exit_point([inside, at(11.0, 10.0)]) == at(11.0, 10.0)  # it stays in it
    assert fence.leads_back(inside, at(14.0, 10.0))
    assert not fence.leads_back(inside, at(25.0, 10.0))
    assert not fence.leads_back(inside, at(11.0, 10.0))
    assert not fence.leads_back(inside, at(15.2, 10.0))  # nearer to the edge of the other one than of this one


def test_a_polyline_leads_around_a_hole_but_not_through_it() -> None:
    fence = Fence(SQUARE).cut([HOLE], RESERVE_M, unites_inclusions=False)
    assert fence.exit_point([at(4.0, 10.0), at(4.0, 15.0), at(16.0, 15.0), at(16.0, 10.0)]) is None
    assert fence.exit([at(4.0, 10.0), at(16.0, 10.0), at(16.0, 15.0)]) == (at(16.0, 10.0), at(4.0, 10.0))
    assert not fence.is_free(at(4.0, 10.0), at(16.0, 10.0))
    assert fence.is_free(at(4.0, 4.0), at(16.0, 4.0))
    assert fence.corners == SQUARE  # as they are told to people


def test_zones_a_disc_and_a_band_hold_together() -> None:
    fence = Fence([]).cut([HOLE], RESERVE_M, unites_inclusions=False).narrowed(0.0, 9.0, Disc(10.0, 10.0, 15.0))
    assert fence.is_inside(at(10.0, 20.0))
    assert not fence.is_inside(at(10.0, 26.0))
    assert not fence.is_inside(at(10.0, 20.0, 9.5))
    assert fence.distance_m(at(10.0, 10.0, 12.0)) == pytest.approx(math.hypot(3.0, 3.0), abs=0.01)
    assert fence.clearance_m(at(10.0, 15.0)) == pytest.approx(2.0, abs=0.01)
    assert fence.exit_point([at(-8.0, 10.0), at(2.0, 10.0)]) is None
    assert fence.exit_point([at(-8.0, 10.0), at(18.0, 10.0)]) == at(18.0, 10.0)  # in, and through the hole
