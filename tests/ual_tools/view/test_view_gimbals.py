"""`ual view`: where gimbals look, without a page."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

from ual.geometry import Pose, Quaternion, Transform, Vector3
from ual.types import Frame
from ual_tools.view.gimbals import views

BODY = Pose(Vector3(10.0, 20.0, 5.0), Quaternion.from_yaw(math.pi / 2.0))
DOWN = Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)


def frame(name: str, rotation: Quaternion | None, parent: str = "uav_1/base_link") -> Frame:
    place = None if rotation is None else Transform(Vector3(0.5, 0.0, 0.0), rotation, parent, name)
    return Frame(name, parent, place, is_static=False)


def test_a_pyramid_begins_at_the_gimbal_and_opens_along_its_x() -> None:
    lines = views("uav_1", BODY, [frame("uav_1/gimbal_0", DOWN)])
    assert len(lines) == 8
    apex = Vector3(10.0, 20.5, 5.0)  # ahead of the nose, which looks along y
    assert all((begin - apex).norm() < 1e-9 for begin, _ in lines[:4])
    corners = [end for _, end in lines[:4]]
    assert all(abs(each.z - 4.0) < 1e-9 for each in corners)  # 1 m below
    middle = Vector3(sum(each.x for each in corners) / 4.0, sum(each.y for each in corners) / 4.0, 4.0)
    assert (middle - Vector3(10.0, 20.5, 4.0)).norm() < 1e-9
    # The picture is wider than high: its width lies across the UAV, which is along x.
    assert {round(abs(each.x - 10.0), 6) for each in corners} == {0.3}
    assert {round(abs(each.y - 20.5), 6) for each in corners} == {0.2}


def test_each_gimbal_has_one_and_one_that_does_not_say_where_it_points_has_none() -> None:
    frames = [frame("uav_1/gimbal_0", None), frame("uav_1/gimbal_1", DOWN), frame("uav_1/gimbal_12", DOWN)]
    assert len(views("uav_1", BODY, frames)) == 16


@pytest.mark.parametrize("name", ["uav_2/gimbal_0", "uav_1/gimbal_0x", "uav_1/gimbal_", "uav_1/base_link", "map"])
def test_other_frames_are_no_gimbals(name: str) -> None:
    assert views("uav_1", BODY, [frame(name, DOWN)]) == []
    assert views("uav_1", BODY, [frame("uav_1/gimbal_0", DOWN, parent="map")]) == []
