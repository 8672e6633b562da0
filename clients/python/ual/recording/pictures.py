"""Pictures in a recording: each with its poses, its intrinsics and its bytes, as viewers of recordings draw them."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable
from typing import NamedTuple

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms

from ual.cameras import OPTICAL, CameraAbility, CameraIntrinsics, Image, ImageFormat, Photo
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped
from ual.interface import Cameras
from ual.recording.recorder import Entry, Output, Recorder
from ual.recording.telemetry import stamp_of, transform_of
from ual.recording.topics import of_protobuf
from ual.shared.guard import WorkGuard
from ual.shared.new_photos import NewPhotos
from ual.v1 import camera_pb2 as pb
from ual.wire import camera as convert

_PICTURES_CHECK_S = 1.0
"""Seconds between two questions for new pictures."""
_FORMATS = {ImageFormat.PNG: "png", ImageFormat.JPEG: "jpeg"}


class PictureTopics:
    """Writes the pictures of one camera. Its frame has z along the view, x right and y down in the picture."""

    def __init__(self, ns: str, number: int) -> None:
        begin = f"/{ns}/camera_{number}"
        self._frame_id = f"{ns}/camera_{number}"
        self._photos = of_protobuf(f"{begin}/photos", pb.Photo)
        self._images = of_protobuf(f"{begin}/image", CompressedImage)
        self._calibrations = of_protobuf(f"{begin}/calibration", CameraCalibration)
        self._transforms = of_protobuf(f"{begin}/tf", FrameTransforms)

    def write_photo(self, output: Output, entry: Entry) -> None:
        """Writes what is known of a picture, and where the camera was."""
        photo: Photo = entry.value
        taken_ns = round(photo.stamp_s * 1e9)
        output.write(self._photos, convert.photo_to_proto(photo).SerializeToString(), entry.log_ns, taken_ns)
        if photo.camera is not None:
            self._write_frame(output, photo.camera, entry.log_ns, taken_ns)

    def write_image(self, output: Output, entry: Entry) -> None:
        """Writes the bytes of a picture, and how the camera sees."""
        image: Image = entry.value
        taken_ns = round(image.stamp_s * 1e9)
        stamp, frame_id = stamp_of(taken_ns), self._frame_id
        if image.intrinsics is not None:
            calibration = _calibration(image.intrinsics)
            calibration.timestamp.CopyFrom(stamp)
            calibration.frame_id = frame_id
            output.write(self._calibrations, calibration.SerializeToString(), entry.log_ns, taken_ns)
        message = CompressedImage(timestamp=stamp, frame_id=frame_id, data=image.data, format=_FORMATS[image.format])
        output.write(self._images, message.SerializeToString(), entry.log_ns, taken_ns)

    def _write_frame(self, output: Output, camera: PoseStamped, log_ns: int, taken_ns: int) -> None:
        pose = Pose(camera.pose.position, camera.pose.orientation * OPTICAL)
        frame = transform_of(stamp_of(taken_ns), camera.frame_id, self._frame_id, pose)
        output.write(self._transforms, FrameTransforms(transforms=[frame]).SerializeToString(), log_ns, taken_ns)


def _calibration(lens: CameraIntrinsics) -> CameraCalibration:
    """Returns it in the form of ROS: K and P by rows."""
    fx, fy, cx, cy = lens.focal_length_x_px, lens.focal_length_y_px, lens.centre_x_px, lens.centre_y_px
    return CameraCalibration(
        width=lens.width_px,
        height=lens.height_px,
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


class PictureFigures(NamedTuple):
    """Figures of the pictures that were taken: their number, and the number that is recorded without bytes."""

    photos_count: int = 0
    without_bytes_count: int = 0
    reason: str = ""
    """Why the last one of these is without."""


class PictureRecorder:
    """Records the pictures that a UAV takes from `start` to `close`. One thread asks its cameras, and waits for them.

    A camera that takes them faster than they come through is behind. What has not come at the end is counted.
    """

    def __init__(self, ns: str, cameras: Cameras, recorder: Recorder) -> None:
        self._ns = ns
        self._cameras = cameras
        self._recorder = recorder
        self._topics: dict[int, PictureTopics] = {}
        self._new: defaultdict[int, NewPhotos] = defaultdict(NewPhotos)
        self._closing = threading.Event()
        self._guard = WorkGuard("pictures")
        self._thread = threading.Thread(target=self._run, name=f"pictures of {ns}", daemon=True)
        self.figures = PictureFigures()
        """Figures so far."""

    def start(self) -> None:
        """Begins.

        Raises:
            UalError: The cameras do not answer, or there are none.

        """
        for each in self._cameras.get_all():
            self._new[each.number].of(self._cameras[each.number])  # these are not meant
        self._thread.start()

    def close(self, limit_s: float | None = None) -> None:
        """Ends, once the picture in progress has come, or after a limit."""
        self._closing.set()
        self._thread.join(limit_s)

    def _run(self) -> None:
        while not self._closing.wait(_PICTURES_CHECK_S):
            self._try(self._poll)
        self._try(self._poll)  # what was taken meanwhile is reported, without its bytes

    def _poll(self) -> None:
        for info in self._cameras.get_all():
            for photo in self._new[info.number].of(self._cameras[info.number]):
                self._record(info.number, photo, has_bytes=CameraAbility.IMAGE in info.abilities)

    def _record(self, number: int, photo: Photo, *, has_bytes: bool) -> None:
        topics = self._topics.setdefault(number, PictureTopics(self._ns, number))
        self._recorder.put(topics.write_photo, self._recorder.clock.now_ns(), photo)
        if not has_bytes or self._closing.is_set():
            self._miss("the camera gives none" if not has_bytes else "the recording has ended")
        elif not self._try(lambda: self._fetch(number, topics, photo)):
            self._miss(self.figures.reason)
        self.figures = self.figures._replace(photos_count=self.figures.photos_count + 1)

    def _fetch(self, number: int, topics: PictureTopics, photo: Photo) -> None:
        image = self._cameras[number].image(photo.number)
        self._recorder.put(topics.write_image, self._recorder.clock.now_ns(), image, len(image.data))

    def _miss(self, reason: str) -> None:
        self.figures = self.figures._replace(without_bytes_count=self.figures.without_bytes_count + 1, reason=reason)

    def _try(self, act: Callable[[], None]) -> bool:
        """Returns whether it was done. What cannot be had now is requested again, or counted."""
        try:
            act()
        except UalError as error:
            self.figures = self.figures._replace(reason=error.message)
            return False
        except Exception as error:  # noqa: BLE001  what a camera tells must not end its thread
            self._guard.note(error)
            self.figures = self.figures._replace(reason=self._guard.last_cause)
            return False
        return True
