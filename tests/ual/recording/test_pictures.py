"""Pictures in a recording: what is in the file, and what is said of those that did not come."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from tests.waiting import until
from ual.cameras import CameraAbility, CameraInfo, CameraIntrinsics, Image, ImageFormat, Photo
from ual.errors import UalTimeoutError
from ual.geometry import Pose, PoseStamped, Quaternion, Vector3
from ual.recording import pictures
from ual.recording.pictures import PictureRecorder
from ual.recording.reader import Recording
from ual.recording.recorder import Recorder
from ual.v1 import camera_pb2 as pb
from ual.wire import camera as convert

LENS = CameraIntrinsics.of_view(64, 48, 1.2)
DOWN = Quaternion.from_euler(0.0, math.pi / 2.0, 0.0)
AT = Pose(Vector3(1.0, 2.0, 3.0), DOWN)


class Camera:
    """One that has taken what the test says."""

    def __init__(self, *abilities: CameraAbility) -> None:
        self.info = CameraInfo(0, "made up", frozenset(abilities))
        self.taken: list[Photo] = []
        self.asked: list[int] = []
        self.image_of: Callable[[int], Image] = image

    def take(self) -> None:
        number = len(self.taken)
        body = PoseStamped(Pose.at(1.0, 2.0, 3.0), "uav_1/odom")
        self.taken.append(Photo(number, 100.0 + number, body=body, camera=PoseStamped(AT, "uav_1/odom")))

    def photos(self, first: int = 0) -> list[Photo]:
        return self.taken[first:]

    def image(self, photo: int) -> Image:
        self.asked.append(photo)
        return self.image_of(photo)


class Cameras:
    """All of them: one."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera

    def get_all(self) -> list[CameraInfo]:
        return [self._camera.info]

    def __getitem__(self, number: int) -> Camera:
        assert number == 0
        return self._camera


def image(number: int) -> Image:
    return Image(b"bytes %d" % number, ImageFormat.JPEG, 64, 48, 100.0 + number, LENS)


@pytest.fixture(autouse=True)
def _often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "_PICTURES_CHECK_S", 0.001)


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[Recorder]:
    made = Recorder(tmp_path, "uav_1")
    made.start()
    yield made
    made.close()


def record(camera: Camera, recorder: Recorder, count: int) -> PictureRecorder:
    """Records until so many pictures are told that are taken meanwhile."""
    cameras: Any = Cameras(camera)
    recorded = PictureRecorder("uav_1", cameras, recorder)
    recorded.start()
    for _ in range(count):
        camera.take()
    until(lambda: recorded.figures.photos_count == count, "all are told")
    recorded.close()
    recorder.close()
    return recorded


def messages(recorder: Recorder, name: str, kind: Any) -> list[Any]:
    found = Recording(recorder.path).messages(lambda topic: topic == f"/uav_1/camera_0/{name}")
    return [kind.FromString(each.data) for each in found]


def test_each_picture_is_recorded_with_its_poses_its_lens_and_its_bytes(recorder: Recorder) -> None:
    camera = Camera(CameraAbility.IMAGE)
    camera.take()  # before the recording: it is not meant
    recorded = record(camera, recorder, 2)
    assert recorded.figures == (2, 0, "")
    assert camera.asked == [1, 2]
    photos = [convert.photo_from_proto(each) for each in messages(recorder, "photos", pb.Photo)]
    assert photos == camera.taken[1:]
    images = messages(recorder, "image", CompressedImage)
    assert [(each.data, each.format, each.frame_id) for each in images] == [
        (b"bytes 1", "jpeg", "uav_1/camera_0"),
        (b"bytes 2", "jpeg", "uav_1/camera_0"),
    ]
    assert [each.timestamp.seconds for each in images] == [101, 102]
    seen = messages(recorder, "calibration", CameraCalibration)[0]
    assert (seen.width, seen.height, seen.K[0], seen.K[2]) == (64, 48, LENS.focal_length_x_px, LENS.centre_x_px)
    frame = messages(recorder, "tf", FrameTransforms)[0].transforms[0]
    assert (frame.parent_frame_id, frame.child_frame_id) == ("uav_1/odom", "uav_1/camera_0")
    turned = Quaternion(frame.rotation.x, frame.rotation.y, frame.rotation.z, frame.rotation.w)
    assert (turned.rotate(Vector3(0.0, 0.0, 1.0)) - Vector3(0.0, 0.0, -1.0)).norm() < 1e-9  # it looks down its z


def test_a_camera_that_gives_no_bytes_is_reported(recorder: Recorder) -> None:
    camera = Camera(CameraAbility.PHOTO)
    recorded = record(camera, recorder, 3)
    assert recorded.figures == (3, 3, "the camera gives none")
    assert (len(messages(recorder, "photos", pb.Photo)), camera.asked) == (3, [])


def test_a_picture_that_does_not_come_is_counted_and_the_next_one_is_recorded(recorder: Recorder) -> None:
    camera = Camera(CameraAbility.IMAGE)

    def late(number: int) -> Image:
        if number == 0:
            raise UalTimeoutError("it is late")
        return image(number)

    camera.image_of = late
    recorded = record(camera, recorder, 2)
    assert recorded.figures == (2, 1, "it is late")
    assert [each.data for each in messages(recorder, "image", CompressedImage)] == [b"bytes 1"]


def test_the_pictures_of_a_daemon_that_was_started_anew_are_recorded(recorder: Recorder) -> None:
    """Their numbers begin again: the second daemon takes fewer, as many and more than the first."""
    camera = Camera(CameraAbility.PHOTO)
    cameras: Any = Cameras(camera)
    recorded = PictureRecorder("uav_1", cameras, recorder)
    recorded.start()
    told = 0

    def are_reported() -> bool:
        return recorded.figures.photos_count >= told

    for boot, count in enumerate((3, 2, 2, 4)):
        camera.taken = [Photo(number, 1000.0 * boot + number) for number in range(count)]
        told += count
        until(are_reported, "all are told")
    recorded.close()
    recorder.close()
    assert recorded.figures.photos_count == told
    stamps = [convert.photo_from_proto(each).stamp_s for each in messages(recorder, "photos", pb.Photo)]
    assert stamps == [0.0, 1.0, 2.0, 1000.0, 1001.0, 2000.0, 2001.0, 3000.0, 3001.0, 3002.0, 3003.0]


def test_what_was_not_fetched_before_the_end_is_reported_without_its_bytes(recorder: Recorder) -> None:
    camera = Camera(CameraAbility.IMAGE)
    cameras: Any = Cameras(camera)
    recorded = PictureRecorder("uav_1", cameras, recorder)

    def while_it_ends(number: int) -> Image:
        camera.take()
        recorded._closing.set()
        return image(number)

    camera.image_of = while_it_ends
    recorded.start()
    camera.take()
    until(recorded._closing.is_set, "it ends")
    recorded.close()
    recorder.close()
    assert recorded.figures == (2, 1, "the recording has ended")
    assert camera.asked == [0]
    assert len(messages(recorder, "photos", pb.Photo)) == 2


def test_a_picture_that_ends_in_a_defect_does_not_end_the_thread(recorder: Recorder) -> None:
    camera = Camera(CameraAbility.IMAGE)

    def broken(number: int) -> Image:
        if number == 0:
            raise OverflowError("a stamp beyond all years")
        return image(number)

    camera.image_of = broken
    recorded = record(camera, recorder, 2)
    assert recorded.figures == (2, 1, "OverflowError: a stamp beyond all years")
    assert len(messages(recorder, "image", CompressedImage)) == 1
