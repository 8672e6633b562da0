"""The cameras of a light UAV: what they see is where it is, and what they say of themselves is so."""

from __future__ import annotations

import dataclasses
import math
import os
import signal
import struct
import sys
import zlib
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.ual_daemon.backends.light.drone import Drone
from tests.waiting import LIMIT_S, until
from ual.cameras import CameraIntrinsics, CameraMode, ImageFormat, ImageKind, StorageState
from ual.errors import InvalidArgumentError, LinkLostError, RejectedByAutopilotError, ResourceExhaustedError, UalError
from ual.geometry import Pose, Quaternion, Vector3
from ual.simulation import LinkLost
from ual_daemon.backends.light import camera, painter, painting
from ual_daemon.backends.light.painter import Painter
from ual_daemon.backends.light.png import encode
from ual_daemon.backends.light.scene import Marker, PaintedScene, PaintOrder
from ual_daemon.backends.light.settings import ARUCO_0, LightCameraSettings, LightMarkerSettings
from ual_daemon.backends.offers.cameras import CameraDriver, CameraDrivers
from ual_daemon.backends.values import PositionSetpoint, VelocitySetpoint
from ual_daemon.settings import ConfigError, convert

VIEW = CameraIntrinsics.of_view(161, 121, 1.2)
DOWN = Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)


@pytest.fixture(autouse=True)
def closed_drones() -> Iterator[None]:
    yield
    while Drone.opened:
        Drone.opened.pop().backend.close()


def picture(pose: Pose, *markers: Marker, view: CameraIntrinsics = VIEW, **options: Any) -> np.ndarray[Any, Any]:
    """Returns the picture of a camera at a pose: rows of columns of colours."""
    return painting.paint(pose, view, PaintedScene(0.0, markers), **options).astype(int)


def pixel_of(camera: Pose, point: Vector3) -> tuple[int, int]:
    """The row and column at which a point is to be seen, by `CameraIntrinsics`."""
    forward, left, up = camera.orientation.inverse().rotate(point - camera.position)
    column = VIEW.focal_length_x_px * -left / forward + VIEW.centre_x_px
    row = VIEW.focal_length_y_px * -up / forward + VIEW.centre_y_px
    return round(row), round(column)


def is_about(colour: Any, wanted: tuple[float, ...]) -> bool:
    return bool(np.abs(np.array(colour) - np.array(wanted)).max() < 30)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("pitch_rad", [math.pi / 2.0, 0.8])
def test_what_lies_at_a_position_is_observed_where_the_intrinsics_say(yaw_rad: float, pitch_rad: float) -> None:
    pose = Pose(Vector3(-0.4, 0.3, 3.0), Quaternion.from_euler(0.0, pitch_rad, yaw_rad))
    cells = tuple(tuple(each == "1" for each in row) for row in ARUCO_0)
    ahead = pose.orientation.rotate(Vector3(1.0))
    centre = pose.position + ahead * (-3.0 / ahead.z)
    marker = Marker(centre.x, centre.y, 1.2, 0.4, cells)
    seen = picture(pose, marker)
    for row in range(4):
        for column in range(4):
            right, up = (column - 1.5) * 0.2, (1.5 - row) * 0.2
            x = centre.x + right * math.cos(0.4) - up * math.sin(0.4)
            y = centre.y + right * math.sin(0.4) + up * math.cos(0.4)
            colour = seen[pixel_of(pose, Vector3(x, y, 0.0))]
            assert is_about(colour, painting.WHITE if cells[row][column] else painting.BLACK), (row, column)


def test_the_axes_are_on_the_ground_and_the_sky_above_the_horizon() -> None:
    pose = Pose(Vector3(0.3, 0.2, 2.0), DOWN)
    seen = picture(pose)
    assert is_about(seen[pixel_of(pose, Vector3(0.7, 0.0, 0.0))], painting.RED)
    assert is_about(seen[pixel_of(pose, Vector3(0.0, 0.6, 0.0))], painting.GREEN)
    assert is_about(seen[pixel_of(pose, Vector3(0.5, 0.5, 0.0))], painting.GROUND)
    assert is_about(seen[pixel_of(pose, Vector3(1.0, 0.5, 0.0))], painting.LINE)
    level = picture(Pose(Vector3(0.0, 0.3, 2.0), Quaternion()))
    middle = VIEW.height_px // 2
    assert is_about(level[middle - 2, 40], painting.HORIZON)
    assert (level[0, :, 2] > level[0, :, 0] + 30).all()
    assert is_about(level[-1, 10], painting.GROUND) or is_about(level[-1, 10], painting.LINE)


def test_noise_is_the_same_for_a_seed_and_as_large_as_reported() -> None:
    pose = Pose(Vector3(0.5, 0.5, 1.0), DOWN)
    clear, noisy = picture(pose), picture(pose, noise=5.0, seed=3)
    assert 4.5 < float((noisy - clear).std()) < 5.5
    assert (noisy == picture(pose, noise=5.0, seed=3)).all()
    assert (noisy != picture(pose, noise=5.0, seed=4)).any()


def test_a_camera_that_lies_on_the_ground_sees_something() -> None:
    assert picture(Pose(Vector3(), DOWN)).shape == (121, 161, 3)
    assert picture(Pose(Vector3(0.0, 0.0, -1.0), Quaternion())).shape == (121, 161, 3)


@pytest.mark.parametrize("pitch_rad", [math.pi / 2.0, 0.8, 0.0, -0.3])
def test_how_far_the_ground_is_is_reported_for_each_pixel_and_infinity_for_the_sky(pitch_rad: float) -> None:
    pose = Pose(Vector3(-0.4, 0.3, 3.0), Quaternion.from_euler(0.1, pitch_rad, 0.5))
    depth, far = (measure(pose, VIEW, PaintedScene(1.0)) for measure in (painting.depths, painting.ranges))
    for row in range(0, VIEW.height_px, 10):
        for column in range(0, VIEW.width_px, 10):
            left = (VIEW.centre_x_px - column) / VIEW.focal_length_x_px
            up = (VIEW.centre_y_px - row) / VIEW.focal_length_y_px
            ray = pose.orientation.rotate(Vector3(1.0, left, up))
            wanted_m = 2.0 / -ray.z if ray.z < -1e-6 else math.inf
            assert depth[row, column] == pytest.approx(wanted_m, rel=1e-3)
            assert far[row, column] == pytest.approx(wanted_m * ray.norm(), rel=1e-3)


def test_each_marker_the_ground_and_the_sky_have_a_label() -> None:
    pose = Pose(Vector3(0.0, 0.0, 3.0), Quaternion.from_euler(0.0, 0.4, 0.0))
    markers = [Marker(4.0, each, 0.6, 0.3, ((True, False), (False, True))) for each in (0.9, -0.9)]
    labels = painting.segments(pose, VIEW, PaintedScene(0.0, markers))
    assert (labels == labels[..., :1]).all()
    assert set(labels.ravel()) == {painting.SKY_LABEL, painting.GROUND_LABEL, 2, 3}
    assert labels[0, 0, 0] == painting.SKY_LABEL
    for number, marker in enumerate(markers):
        assert labels[pixel_of(pose, Vector3(marker.x_m, marker.y_m, 0.0))][0] == 2 + number
    assert labels[pixel_of(pose, Vector3(4.0, 0.0, 0.0))][0] == painting.GROUND_LABEL


def test_depth_and_segmentation_are_of_the_same_moment_as_the_picture() -> None:
    drone = Drone(cameras=[small()])
    drone.fly(3.0)
    found = camera_of(drone)
    taken = found.take_photo().result(0)
    drone.run(2.0, VelocitySetpoint(Vector3(0.0, 0.0, 0.5)))
    depth = found.image(taken.number, ImageKind.DEPTH).result(LIMIT_S)
    assert (depth.kind, depth.format, depth.stamp_s) == (ImageKind.DEPTH, ImageFormat.FLOAT32, taken.stamp_s)
    assert np.frombuffer(depth.data, "<f4")[64 * 24 + 32] == pytest.approx(3.0, abs=0.15)
    segments = found.image(None, ImageKind.SEGMENTATION).result(LIMIT_S)
    assert pixels_of_png(segments.data) == (64, 48, bytes([painting.GROUND_LABEL]) * 3 * 64 * 48)


def pixels_of_png(data: bytes) -> tuple[int, int, bytes]:
    """Reads a picture as PNG says: https://www.w3.org/TR/png-3/."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = {}, 8
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        content = data[at + 8 : at + 8 + size]
        assert struct.unpack_from(">I", data, at + 8 + size)[0] == zlib.crc32(kind + content)
        chunks[kind], at = content, at + 12 + size
    width, height, *rest = struct.unpack(">IIBBBBB", chunks[b"IHDR"])
    assert rest == [8, 2, 0, 0, 0]
    rows = np.frombuffer(zlib.decompress(chunks[b"IDAT"]), np.uint8).reshape(height, 3 * width + 1)
    assert (rows[:, 0] == 1).all()  # each pixel is written as its difference to the one before
    pixels = np.cumsum(rows[:, 1:].reshape(height, width, 3), axis=1, dtype=np.uint8)
    return width, height, pixels.tobytes()


@pytest.mark.parametrize(("width", "height"), [(2, 3), (1, 1), (1, 4), (64, 48)])
def test_a_png_has_each_pixel(width: int, height: int) -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (height, width, 3), np.uint8)
    assert pixels_of_png(encode(rgb)) == (width, height, rgb.tobytes())


def test_a_picture_of_many_blocks_is_one_picture() -> None:
    """Rows are painted some at a time: what a block sees must not depend on which others there are."""
    large = CameraIntrinsics.of_view(401, 301, 1.2)
    for pitch_rad in (0.1, 1.4):
        pose = Pose(Vector3(0.3, 0.2, 2.0), Quaternion.from_euler(0.05, pitch_rad, 0.3))
        whole = picture(pose, view=large)
        middle = dataclasses.replace(large, height_px=101, centre_y_px=large.centre_y_px - 100.0)
        assert np.abs(whole[100:201] - picture(pose, view=middle)).max() <= 1


def cameras_of(drone: Drone) -> camera.LightCameras:
    found = drone.backend.offer(CameraDrivers)  # type: ignore[type-abstract]
    assert isinstance(found, camera.LightCameras)
    return found


def camera_of(drone: Drone) -> CameraDriver:
    return cameras_of(drone).all()[0]


def small(**more: object) -> dict[str, object]:
    return {"width_px": 64, "height_px": 48, **more}


def test_a_picture_is_of_where_it_was_taken_also_when_it_is_made_later() -> None:
    drone = Drone(cameras=[small()])
    drone.sim.place_on_ground(Vector3(0.5, 0.5, 0.0), 0.0)
    drone.fly(3.0)
    found = camera_of(drone)
    taken = found.take_photo().result(0)
    now = found.image(None).result(LIMIT_S)
    drone.run(4.0, VelocitySetpoint(Vector3(0.4, 0.2, 0.0)))
    assert found.image(taken.number).result(LIMIT_S).data == now.data
    assert found.image(None).result(LIMIT_S).data != now.data
    assert taken.viewpoint.body is not None
    assert taken.viewpoint.body.position.x == pytest.approx(0.5, abs=0.05)
    assert taken.viewpoint.position_geo is not None
    assert now.stamp_s == taken.stamp_s
    with pytest.raises(InvalidArgumentError, match="there is no picture 7: it has 0 to 0"):
        found.image(7).result(0)


def test_zoom_sees_less_and_larger() -> None:
    found = camera_of(Drone(cameras=[small()]))
    wide = found.image(None).result(LIMIT_S).intrinsics
    found.set_zoom(100.0).result(0)
    near = found.image(None).result(LIMIT_S).intrinsics
    assert wide is not None
    assert near is not None
    assert near.focal_length_x_px == pytest.approx(camera.LARGEST_ZOOM_FACTOR * wide.focal_length_x_px)


def test_it_takes_a_thousand_pictures_by_distance_each_where_it_should_be() -> None:
    drone = Drone(
        cameras=[small()], horizontal_speed_m_s=20.0, horizontal_acceleration_m_s2=8.0, vertical_speed_m_s=5.0
    )
    drone.fly(10.0)
    found = camera_of(drone)
    found.start_distance(0.5).result(0)
    while len(found.photos(0)) < 1000:
        drone.run(1.0, VelocitySetpoint(Vector3(5.0)))
    places = [each.viewpoint.body.position for each in found.photos(0)[:1000] if each.viewpoint.body is not None]
    begin = places[0]
    late_m = [(place - begin).norm() - 0.5 * number for number, place in enumerate(places)]
    assert len(places) == 1000
    assert min(late_m) > -0.01
    assert max(late_m) < 0.12  # it flies 0.1 m in a step
    assert found.status().result(0).missed_count == 0
    found.stop_photos().result(0)
    count = len(found.photos(0))
    drone.run(1.0, VelocitySetpoint(Vector3(5.0)))
    assert len(found.photos(0)) == count


def test_it_takes_pictures_by_time_until_there_are_enough() -> None:
    drone = Drone(cameras=[small()])
    found = camera_of(drone)
    found.start_interval(0.5, 3).result(0)
    drone.run(5.0)
    stamps_s = [each.stamp_s for each in found.photos(0)]
    assert [each - stamps_s[0] for each in stamps_s] == pytest.approx([0.0, 0.5, 1.0], abs=0.021)
    assert not found.status().result(0).is_taking_photos


def test_a_full_storage_refuses_and_counts_what_is_missed() -> None:
    drone = Drone(cameras=[small(storage_mib=2.5)])
    found = camera_of(drone)
    found.take_photo().result(0)
    found.start_interval(0.1, 5).result(0)
    drone.run(1.0)
    status = found.status().result(0)
    assert (status.photos_count, status.missed_count) == (2, 4)
    assert (status.storage.state, status.storage.available_mib) == (StorageState.FULL, 0.5)
    for order in (found.take_photo, found.start_video):
        with pytest.raises(RejectedByAutopilotError, match="its storage is full"):
            order().result(0)


def test_a_video_takes_room_and_says_how_long_it_is() -> None:
    drone = Drone(cameras=[small(storage_mib=100.0)])
    found = camera_of(drone)
    found.start_video().result(0)
    drone.run(10.0)
    status = found.status().result(0)
    assert status.is_recording
    assert status.recording_s == pytest.approx(10.0)
    found.stop_video().result(0)
    found.set_mode(CameraMode.SURVEY).result(0)
    drone.run(10.0)
    status = found.status().result(0)
    assert (status.is_recording, status.mode) == (False, CameraMode.SURVEY)
    assert status.storage.available_mib == pytest.approx(80.0)


def test_without_a_link_nothing_is_answered_and_it_is_not_connected() -> None:
    drone = Drone(cameras=[small()])
    found = camera_of(drone)
    drone.sim.begin_fault(LinkLost())
    drone.run(0.1)
    assert not found.info.is_connected
    for order in (found.take_photo, found.status):
        with pytest.raises(LinkLostError):
            order().result(0)


def test_only_so_many_pictures_wait_and_closing_ends_them(monkeypatch: pytest.MonkeyPatch) -> None:
    painted: list[Future[bytes]] = []

    def paint(_: Painter, order: PaintOrder) -> Future[bytes]:
        assert order.intrinsics.width_px == 64
        painted.append(Future())
        return painted[-1]

    monkeypatch.setattr(Painter, "paint", paint)
    drone = Drone(cameras=[small()])
    found = camera_of(drone)
    waiting = [found.image(None) for _ in range(camera.MOST_WAITING_PICTURES)]
    with pytest.raises(ResourceExhaustedError, match="which is the limit"):
        found.image(None).result(0)
    painted[0].set_result(b"painted")
    assert waiting[0].result(0).data == b"painted"
    found.image(None)
    drone.backend.close()
    assert all(each.cancelled() for each in painted[1:])
    with pytest.raises(Exception, match="this UAV is closed"):
        found.image(None).result(0)


def test_a_process_that_ends_is_reported_and_replaced() -> None:
    order = PaintOrder(Pose(Vector3(0.0, 0.0, 2.0), DOWN), CameraIntrinsics.of_view(8, 6, 1.2), PaintedScene(0.0))
    painter = Painter()
    try:
        first = painter.paint(order).result(LIMIT_S)
        assert pixels_of_png(first)[:2] == (8, 6)
        bad: Any = PaintOrder(order.camera, order.intrinsics, None)  # type: ignore[arg-type]  # what ends the process
        with pytest.raises(UalError, match="the process that paints pictures has ended: status 1"):
            painter.paint(bad).result(LIMIT_S)
        assert painter.paint(order).result(LIMIT_S) == first
    finally:
        painter.close()
    painter.close()


@pytest.mark.parametrize("how", ["late", "closed"])
def test_a_process_that_stops_is_not_waited_for_without_end(monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    monkeypatch.setattr(painter, "PICTURE_TIMEOUT_S" if how == "late" else "_PROCESS_END_S", 0.1)
    order = PaintOrder(Pose(Vector3(0.0, 0.0, 2.0), DOWN), CameraIntrinsics.of_view(8, 6, 1.2), PaintedScene(0.0))
    easel = painter._Easel()
    try:
        process = easel._thread.submit(lambda: easel._start() and easel._process).result(LIMIT_S)
        assert process
        os.kill(process.pid, signal.SIGSTOP)
        waiting = easel.paint(order)
        if how == "closed":
            until(waiting.running, "the picture to be waited for")
            easel.close()
        with pytest.raises(UalError, match="the process that paints pictures has ended: status -9"):
            waiting.result(LIMIT_S)
    finally:
        easel.close()


def test_the_process_yields_from_its_begin_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also while it imports, with which it begins."""
    monkeypatch.setattr(painter, "_PAINTER_NICENESS", 10)  # as it is outside of tests
    easel = painter._Easel()
    try:
        easel._start()
        process = easel._process
        assert process is not None
        own = os.getpriority(os.PRIO_PROCESS, 0)
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == min(own + 10, 19)
    finally:
        easel.close()


def test_the_process_finds_packages_where_this_one_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """It starts elsewhere: relative places, as of PYTHONPATH=clients/python, are told as absolute ones."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", "packages", "/usr/lib"])
    assert painter._environment()["PYTHONPATH"] == f"{tmp_path / 'packages'}{os.pathsep}/usr/lib"


def test_markers_must_be_squares() -> None:
    with pytest.raises(ConfigError, match="a marker is a square, and not 10 / 1"):
        convert({"rows": ["10", "1"]}, LightMarkerSettings)
    assert convert({}, LightCameraSettings).markers == ()


def test_the_estimate_is_reported_and_the_truth_is_painted() -> None:
    clear, noisy = Drone(cameras=[small()]), Drone(cameras=[small()], position_noise_m=0.5, seed=4)
    for drone in (clear, noisy):
        drone.sim.place_on_ground(Vector3(0.5, 0.5, 0.0), 0.0)
    images = [camera_of(each).image(None).result(LIMIT_S) for each in (clear, noisy)]
    assert images[0].data == images[1].data
    assert images[0].viewpoint.body != images[1].viewpoint.body


def test_a_setpoint_by_position_moves_what_is_observed() -> None:
    drone = Drone(cameras=[small()])
    drone.fly(2.0)
    found = camera_of(drone)
    before = found.image(None).result(LIMIT_S)
    drone.run(3.0, PositionSetpoint(Vector3(0.5, 0.4, 2.5), 0.3))
    after = found.image(None).result(LIMIT_S)
    assert before.data != after.data
    assert after.viewpoint.body is not None
    assert after.viewpoint.body.orientation.yaw_rad == pytest.approx(0.3, abs=0.05)
