"""`ual view`: the geofence of a configuration file, the tree of frames, and clicks on the ground, without a page."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from ual._cli.view import orders, tree
from ual._cli.view.fence import Fence, lines
from ual._cli.view.fence_file import fences
from ual.errors import InvalidArgumentError
from ual.geometry import Quaternion, Transform, Vector3
from ual.types import Frame, GeoPoint, State, Telemetry

SQUARE = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "daemon.yaml"
    file.write_text(text)
    return file


def test_the_fence_of_a_configuration(tmp_path: Path) -> None:
    text = "ns: uav_2\nbackend: light\ngeofence: {polygon: [[0, 0], [10, 0], [10, 10], [0, 10]], max_height_m: 30}\n"
    assert fences(written(tmp_path, text)) == [Fence("uav_2", SQUARE, "uav_2/odom", max_height_m=30.0)]


def test_the_fences_of_a_fleet(tmp_path: Path) -> None:
    text = "ns: uav_3\nfleet: 2\ngeofence: {polygon_geo: [[1, 2], [3, 4], [5, 6]], frame_id: map}\n"
    assert [(each.ns, each.is_geo, each.frame_id) for each in fences(written(tmp_path, text))] == [
        ("uav_3", True, "map"),
        ("uav_4", True, "map"),
    ]


def test_a_configuration_without_a_fence(tmp_path: Path) -> None:
    assert fences(written(tmp_path, "backend: light\n")) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("geofence: {polygon: [[0, 0], [1, 1]]}", "1: geofence.polygon: expected at least 3 corners"),
        ("geofence:\n  polygon: [[0, 0], [1, x], [2, 2]]", r"2: geofence.polygon\[1\]\[1\]: expected a number"),
        ("geofence: {polygon: [[0, 0, 0], [1, 1], [2, 2]]}", "expected two numbers"),
        ("- 1", "expected 'key: value' lines"),
        ("a: [", "daemon.yaml"),
    ],
)
def test_what_is_no_configuration_is_refused_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InvalidArgumentError, match=words):
        fences(written(tmp_path, text))


def test_the_lines_of_a_fence_are_in_map() -> None:
    frame = Transform(Vector3(100.0, 0.0, 1.0), Quaternion.from_yaw(math.pi / 2))
    fence = Fence("uav_1", SQUARE, "uav_1/odom", max_height_m=5.0)
    found = lines(fence, frame, None)
    assert len(found) == 12
    heights = {round(end.z, 6) for line in found for end in line}
    assert heights == {1.0, 6.0}
    assert min(end.x for line in found for end in line) == pytest.approx(90.0)
    assert len(lines(dataclasses.replace(fence, max_height_m=None), frame, None)) == 4


def test_a_geographic_fence_lies_where_the_uav_says_that_earth_is() -> None:
    fence = Fence("uav_1", [(0.0, 0.0), (0.001, 0.0), (0.001, 0.001)], "uav_1/odom", is_geo=True)
    assert lines(fence, Transform(), None) == []
    here = Telemetry(State.FLYING_AUTO, transform=Transform(Vector3(5.0, 6.0, 7.0)), position_geo=GeoPoint(0.0, 0.0))
    (first, second), (_, third), _ = lines(fence, Transform(), here)
    assert (first.x, first.y) == (5.0, 6.0)
    assert second.y - first.y == pytest.approx(110.574, abs=0.001)  # 0.001 degrees of latitude at the equator
    assert third.x - first.x == pytest.approx(111.319, abs=0.001)


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
