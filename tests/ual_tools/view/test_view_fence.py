"""`ual view`: the edges of a geofence, the tree of frames, and clicks on the ground, without a page."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from ual.geometry import Quaternion, Transform, Vector3
from ual.types import Circle, Frame, Geofence
from ual_tools.view import orders, tree
from ual_tools.view.fence import fence_edges

SQUARE = (Vector3(0.0, 0.0, 9.0), Vector3(10.0, 0.0, 9.0), Vector3(10.0, 10.0, 9.0), Vector3(0.0, 10.0, 9.0))


def test_the_edges_of_a_fence() -> None:
    found = fence_edges(Geofence(corners=SQUARE, min_z_m=1.0, max_z_m=5.0))
    assert len(found) == 12
    assert {point.z for line in found for point in line} == {1.0, 5.0}
    assert found[0] == (Vector3(0.0, 0.0, 1.0), Vector3(10.0, 0.0, 1.0))
    assert found[-1] == (Vector3(0.0, 10.0, 1.0), Vector3(0.0, 10.0, 5.0))


def test_a_fence_without_a_top_is_drawn_on_the_ground() -> None:
    found = fence_edges(Geofence(corners=SQUARE))
    assert len(found) == 4
    assert {point.z for line in found for point in line} == {0.0}


def test_a_fence_without_sides_has_no_edges() -> None:
    assert fence_edges(Geofence(min_z_m=0.0, max_z_m=120.0)) == []


def test_a_circle_is_a_ring_of_its_radius() -> None:
    centre = Vector3(3.0, -4.0, 0.0)
    found = fence_edges(Geofence(circle=Circle(centre, 20.0)))
    assert all(math.isclose((point - centre).norm(), 20.0) for line in found for point in line)
    assert all(after[0] == before[1] for before, after in pairwise(found))
    assert found[-1][1] == found[0][0]


def frame(name: str, parent: str, x: float | None, yaw_rad: float = 0.0) -> Frame:
    transform = None if x is None else Transform(Vector3(x, 0.0, 0.0), Quaternion.from_yaw(yaw_rad), parent, name)
    return Frame(name, parent, transform, is_static=True)


def test_the_frames_are_placed_in_map() -> None:
    found = tree.in_map(
        [
            Frame("map", "", None, is_static=True),
            frame("uav_1/odom", "map", 10.0, math.pi / 2),
            frame("uav_1/base_link", "uav_1/odom", 2.0),
            frame("camera", "uav_1/base_link", None),
            frame("lens", "camera", 1.0),
            frame("a", "b", 1.0),
            frame("b", "a", 1.0),
        ]
    )
    assert set(found) == {"map", "uav_1/odom", "uav_1/base_link"}
    place = found["uav_1/base_link"].translation
    assert (place - Vector3(10.0, 2.0, 0.0)).norm() < 1e-9


@pytest.mark.parametrize(
    ("direction", "ground_m", "place"),
    [
        ((0.0, 0.0, -1.0), 0.0, Vector3(1.0, 2.0, 0.0)),
        ((1.0, 0.0, -1.0), 0.0, Vector3(6.0, 2.0, 0.0)),
        ((1.0, 0.0, -1.0), 1.0, Vector3(5.0, 2.0, 1.0)),
        ((0.0, 0.0, 1.0), 0.0, None),
        ((1.0, 0.0, 0.0), 0.0, None),
        ((1.0, 0.0, -1e-5), 0.0, None),
    ],
)
def test_a_click_on_the_ground(direction: tuple[float, float, float], ground_m: float, place: Vector3 | None) -> None:
    assert orders.on_ground((1.0, 2.0, 5.0), direction, ground_m) == place
