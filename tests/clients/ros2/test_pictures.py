"""Pictures as messages, without ROS."""

from __future__ import annotations

import math
import struct

import pytest

import ual
from ual.cameras import CameraIntrinsics, Image, ImageFormat, ImageKind
from ual_ros2 import pictures

DOWN = ual.Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)


def image(**values: object) -> Image:
    body = ual.PoseStamped(ual.Pose.at(1.0, 2.0, 3.0, math.pi / 2.0), "uav_1/odom")
    camera = ual.PoseStamped(ual.Pose(ual.Vector3(1.0, 2.5, 3.0), body.pose.orientation * DOWN), "uav_1/odom")
    known = {"data": b"\1\2", "format": ImageFormat.PNG, "width_px": 2, "height_px": 1, "stamp_s": 5.0}
    return Image(**{**known, "body": body, "camera": camera, **values})  # type: ignore[arg-type]


def test_the_optical_frame_is_in_the_camera_and_that_in_the_body() -> None:
    mount, optical = pictures.links("uav_1", 2, image())
    assert (mount.frame_id, mount.child_frame_id) == ("uav_1/base_link", "uav_1/camera_2")
    assert (optical.frame_id, optical.child_frame_id) == ("uav_1/camera_2", "uav_1/camera_2_optical")
    assert (mount.translation - ual.Vector3(0.5)).norm() < 1e-9
    whole = mount.compose(optical)
    for optical_axis, body_axis in (
        (ual.Vector3(0.0, 0.0, 1.0), ual.Vector3(0.0, 0.0, -1.0)),  # it looks down
        (ual.Vector3(1.0), ual.Vector3(0.0, -1.0)),  # the right of its picture is the UAV's right
        (ual.Vector3(0.0, 1.0), ual.Vector3(-1.0)),  # the bottom of its picture is behind
    ):
        assert (whole.rotation.rotate(optical_axis) - body_axis).norm() < 1e-9


@pytest.mark.parametrize("unknown", ["body", "camera"])
def test_a_mounting_that_is_not_known_is_no_frame(unknown: str) -> None:
    assert pictures.links("uav_1", 0, image(**{unknown: None})) == []


def test_the_matrices_are_those_of_the_pinhole_and_zeros_where_it_is_not_known() -> None:
    told = pictures.camera_info(image(intrinsics=CameraIntrinsics(64, 48, 50.0, 51.0, 31.5, 23.5)))
    assert (told["width"], told["height"], told["distortion_model"]) == (64, 48, "plumb_bob")
    assert told["k"] == [50.0, 0.0, 31.5, 0.0, 51.0, 23.5, 0.0, 0.0, 1.0]
    assert told["p"] == [50.0, 0.0, 31.5, 0.0, 0.0, 51.0, 23.5, 0.0, 0.0, 0.0, 1.0, 0.0]
    assert told["d"] == [0.0] * 5
    assert pictures.camera_info(image()) == {"width": 2, "height": 1}, "the rest is zeros in a new message"


def test_bytes_and_distances_are_passed_as_they_are() -> None:
    told = pictures.compressed(image())
    assert (told["format"], bytes(told["data"])) == ("png", b"\1\2")
    data = struct.pack("<2f", 1.5, math.inf)
    told = pictures.distances(image(data=data, format=ImageFormat.FLOAT32, kind=ImageKind.DEPTH))
    assert (told["width"], told["height"], told["step"]) == (2, 1, 8)
    assert (told["encoding"], told["is_bigendian"]) == ("32FC1", 0)
    assert bytes(told["data"]) == data
