"""Convex parts of a fence: they contain what they are made for, and nothing outside."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual_daemon.frames.test_area import zones
from ual.geometry import Vector3
from ual_daemon.frames.area import LocalZone
from ual_daemon.frames.fence import Disc, Fence
from ual_daemon.frames.room import Point3, Room, Side

coordinates = st.floats(-18.0, 18.0)
places = st.tuples(coordinates, coordinates, st.floats(0.0, 30.0))
offsets = st.lists(st.tuples(*[st.floats(-9.0, 9.0)] * 3), max_size=4)
SQUARE = [(0.0, -1.0), (10.0, -1.0), (10.0, 10.0), (0.0, 10.0)]


@given(zones(), places, offsets, st.booleans(), st.lists(places, min_size=20, max_size=20))
def test_a_room_contains_its_points_and_only_what_is_inside(
    found: list[LocalZone], here: Point3, moves: list[Point3], has_disc: bool, others: list[Point3]
) -> None:
    points = [here, *((here[0] + x, here[1] + y, here[2] + z) for x, y, z in moves)]
    disc = Disc(2.0, 3.0, 12.0) if has_disc else None
    fence = Fence(()).cut(found, 1.0, unites_inclusions=False).narrowed(5.0, 25.0, disc)
    room = fence.room_around(points)
    if room is None:
        return
    assert room.has(points)
    near = [(here[0] + x / 6.0, here[1] + y / 6.0, z) for x, y, z in others]
    for point in (*points, *others, *near):
        if room.has([point]):
            assert fence.is_inside(Vector3(*point))
            assert fence.exit([Vector3(*here), Vector3(*point)]) is None


@given(zones(), places, offsets)
def test_a_room_is_found_where_the_hull_of_the_points_is_clear(
    found: list[LocalZone], here: Point3, moves: list[Point3]
) -> None:
    fence = Fence(()).cut(found, 1.0, unites_inclusions=False)
    longest_m = max([0.0, *(math.hypot(x, y) for x, y, _ in moves)])
    if fence.clearance_m(Vector3(*here)) > longest_m + 0.01:
        assert fence.room_around([here, *((here[0] + x, here[1] + y, here[2] + z) for x, y, z in moves)]) is not None


def test_a_room_in_a_convex_fence_is_all_of_it() -> None:
    room = Fence(SQUARE, 1.0, 5.0).room_around([(8.0, 3.0, 2.0), (9.0, 4.0, 3.0)])
    assert room is not None
    assert room.has([(0.001, 0.001, 1.0), (9.999, 9.999, 5.0), (0.001, 9.999, 3.0)])
    for beyond in ((10.01, 5.0, 3.0), (5.0, -1.01, 3.0), (5.0, 5.0, 0.9), (5.0, 5.0, 5.1)):
        assert not room.has([(5.0, 5.0, 3.0), beyond])


def test_next_to_a_hole_a_room_reaches_along_it() -> None:
    hole = LocalZone("hole", False, ((2.0, -50.0), (4.0, -50.0), (4.0, 50.0), (2.0, 50.0)))
    room = Fence(()).cut([hole], 0.0, unites_inclusions=False).room_around([(1.5, 0.0, 5.0), (1.5, 3.0, 5.0)])
    assert room is not None
    assert room.has([(1.9, 40.0, 5.0), (1.9, -40.0, 5.0), (-1e5, 0.0, 5.0)])
    assert not room.has([(2.1, 0.0, 5.0)])


@pytest.mark.parametrize("outside", [(12.0, 5.0, 3.0), (5.0, 5.0, 30.0)])
def test_there_is_no_room_around_what_is_outside(outside: Point3) -> None:
    fence = Fence(SQUARE, 0.0, 20.0)
    assert fence.room_around([outside]) is None
    assert fence.room_around([(5.0, 5.0, 5.0), outside]) is None


def test_each_bound_of_a_room_holds() -> None:
    room = Room((Side(1.0, 0.0, 3.0),), 0.0, 2.0, (0.0, 0.0, 16.0))
    assert room.has([(3.0, 0.0, 0.0), (-4.0, 0.0, 2.0)])
    for beyond in ((3.1, 0.0, 1.0), (-4.1, 0.0, 1.0), (0.0, 0.0, -0.1), (0.0, 0.0, 2.1)):
        assert not room.has([(0.0, 0.0, 1.0), beyond])


def test_points_that_almost_coincide_are_one() -> None:
    """GEOS divides by zero between them, and numpy warns."""
    room = Fence(SQUARE).room_around([(5.0, 0.0, 5.0), (5.0, 5.893e-277, 5.0)])
    assert room is not None
    assert room.has([(9.9, 9.9, 5.0)])
