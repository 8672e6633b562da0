"""An orientation in another order than x, y, z, w is noticed where it can only be that. Other tilts are left out."""

from __future__ import annotations

import math

import pytest

from ual.errors import InvalidArgumentError
from ual.geometry import IDENTITY, KEEP_HEADING, Pose, PoseStamped, Quaternion, Transform, Vector3
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.settings import VehicleSettings

ODOM, BODY = "uav_1/odom", "uav_1/base_link"
TURNED, OPTICAL, OVER_THERE = Quaternion.from_yaw(1.0), Quaternion(-0.5, 0.5, -0.5, 0.5), Vector3(1.0, 2.0, 3.0)


@pytest.fixture
def frames() -> FrameResolver:
    frames = FrameResolver("uav_1", VehicleSettings())
    for name, parent, rotation in (
        ("pad", ODOM, TURNED),
        ("field", "map", TURNED),
        ("mast", BODY, TURNED),
        ("marker", ODOM, OPTICAL),
        ("camera", BODY, OPTICAL),
    ):
        frames.tree.add(Transform(OVER_THERE, rotation, parent, name))
    return frames


def heading_of(frames: FrameResolver, orientation: Quaternion, frame_id: str = "") -> float | None:
    rotation = frames.goal(PoseStamped(Pose(OVER_THERE, orientation), frame_id), "waypoint").rotation
    return None if rotation is None else rotation.yaw_rad


def reordered(q: Quaternion) -> Quaternion:
    """As of a caller that sends w, x, y, z."""
    return Quaternion(q.w, q.x, q.y, q.z)


@pytest.mark.parametrize("yaw_deg", [-89, -1, 0, 45, 89])
@pytest.mark.parametrize("frame_id", ["", ODOM, "map", BODY, "pad", "field", "mast"])
def test_another_order_is_refused_in_words_that_name_it(frames: FrameResolver, yaw_deg: float, frame_id: str) -> None:
    meant = Quaternion.from_yaw(math.radians(yaw_deg))
    with pytest.raises(InvalidArgumentError, match=r"level as w, x, y, z: the order is x, y, z, w") as refused:
        heading_of(frames, reordered(meant), frame_id)
    assert f"is tilted by {180 - abs(yaw_deg)} degrees" in refused.value.message
    assert refused.value.metadata["field"] == "waypoint.pose.orientation"


def test_the_orientation_of_a_uav_that_hovers_is_noticed_in_another_order(frames: FrameResolver) -> None:
    meant = Quaternion.from_euler(0.05, -0.08, 0.7)
    with pytest.raises(InvalidArgumentError, match="the order is x, y, z, w"):
        heading_of(frames, reordered(meant))
    assert heading_of(frames, meant) == pytest.approx(0.7)


@pytest.mark.parametrize("yaw_deg", [-180, -136, -90, 0, 30, 91, 180])
@pytest.mark.parametrize("tilt_deg", [0, 40, 80])
def test_a_tilt_that_a_uav_may_have_is_left_out(frames: FrameResolver, yaw_deg: float, tilt_deg: float) -> None:
    yaw_rad, tilt_rad = math.radians(yaw_deg), math.radians(tilt_deg)
    for orientation in (Quaternion.from_euler(tilt_rad, 0.0, yaw_rad), Quaternion.from_euler(0.0, tilt_rad, yaw_rad)):
        heading_rad = heading_of(frames, orientation)
        assert heading_rad is not None
        assert math.cos(heading_rad - yaw_rad) == pytest.approx(1.0)


def test_what_points_down_or_up_is_no_other_order(frames: FrameResolver) -> None:
    for pitch_deg in (-90, -60, 60, 90):
        assert heading_of(frames, Quaternion.from_euler(0.0, math.radians(pitch_deg), 0.5)) is not None
    assert heading_of(frames, KEEP_HEADING) is None


@pytest.mark.parametrize("frame_id", ["marker", "camera"])
def test_in_a_frame_whose_z_is_not_up_nothing_is_refused(frames: FrameResolver, frame_id: str) -> None:
    heading_of(frames, reordered(IDENTITY), frame_id)
    heading_of(frames, OPTICAL.inverse(), frame_id)  # level
