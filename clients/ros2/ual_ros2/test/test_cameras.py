"""The camera of a light UAV in ROS: its topics, its frames, and the services that take pictures."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import pytest
from conftest import ARMED_FAST, Processes
from flying import Client, waited
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from tf2_msgs.msg import TFMessage
from ual_msgs import srv

import ual

UAL = "/uav_1/ual"
CAMERA = f"{UAL}/camera_0"
SMALL = "light.cameras=[{width_px: 64, height_px: 48}]"


@pytest.fixture(scope="module")
def uav(processes: Processes) -> Iterator[ual.Uav]:
    processes.daemon(*ARMED_FAST, "--set", SMALL)
    processes.node("ns:=uav_1", "camera_rate_hz:=20.0")
    with ual.Uav("uav_1") as uav:
        yield uav


@pytest.mark.usefixtures("flying")
def test_pictures_have_their_intrinsics_and_frames(client: Client) -> None:
    images = client.hear(CompressedImage, f"{CAMERA}/image/compressed")
    infos = client.hear(CameraInfo, f"{CAMERA}/camera_info")
    depths = client.hear(Image, f"{CAMERA}/depth/image")
    frames = client.hear(TFMessage, "/tf")
    waited(lambda: images and depths)
    image, depth = images[-1], depths[-1]
    assert (image.format, bytes(image.data[:4])) == ("png", b"\x89PNG")
    assert image.header.frame_id == depth.header.frame_id == "uav_1/camera_0_optical"
    assert (depth.encoding, depth.width, depth.height, depth.step) == ("32FC1", 64, 48, 256)
    [middle_m] = struct.unpack_from("<f", bytes(depth.data), 256 * 24 + 4 * 32)
    assert middle_m == pytest.approx(3.0, abs=0.4)
    waited(lambda: infos and infos[-1].k[0] > 0.0)
    assert (infos[-1].width, infos[-1].k[2], infos[-1].k[8]) == (64, 31.5, 1.0)
    waited(lambda: parents(frames).get("uav_1/camera_0_optical"))
    assert parents(frames)["uav_1/camera_0_optical"] == "uav_1/camera_0"
    assert parents(frames)["uav_1/camera_0"] == "uav_1/base_link"


def parents(frames: list[Any]) -> dict[str, str]:
    """The parent of each frame that was told."""
    return {each.child_frame_id: each.header.frame_id for message in list(frames) for each in message.transforms}


def test_pictures_are_taken_by_services(client: Client, uav: ual.Uav) -> None:
    taken = client.call(srv.TakePhoto, f"{UAL}/take_photo", camera=0)
    assert (taken.success, taken.photo.number, taken.photo.is_stored) == (True, 0, True)
    seen = taken.photo.viewpoint
    assert seen.body.header.frame_id == seen.optical.header.frame_id == "uav_1/odom"
    assert seen.stamp.sec > 0
    assert client.call(srv.StartPhotos, f"{UAL}/start_photos", camera=0, distance=5.0).success
    waited(lambda: uav.cameras[0].status().distance_m == 5.0)
    for name in ("stop_photos", "start_video", "stop_video"):
        assert client.call(srv.OrderCamera, f"{UAL}/{name}", camera=0).success
    assert not uav.cameras[0].status().is_taking_photos
    refused = client.call(srv.StartPhotos, f"{UAL}/start_photos", camera=0)
    assert (refused.success, refused.reason) == (False, "INVALID_ARGUMENT")
    absent = client.call(srv.TakePhoto, f"{UAL}/take_photo", camera=7)
    assert (absent.reason, "there is no camera 7" in absent.message) == ("INVALID_ARGUMENT", True)
