"""Cameras by the services of the node."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from ual_msgs import srv

import ual
from ual.cameras import (
    OPTICAL,
    CameraAbility,
    CameraInfo,
    CameraIntrinsics,
    CameraMode,
    CameraStatus,
    CameraStorage,
    Image,
    ImageFormat,
    ImageKind,
    Photo,
    StorageState,
    VideoStream,
)
from ual.interface import Camera, Cameras
from ual_ros2 import values
from ual_ros2.beside.cameras import MIB

Call = Callable[..., Any]


class RosCameras(Cameras):
    """All of them."""

    def __init__(self, call: Call) -> None:
        self._call = call

    def get_all(self) -> list[CameraInfo]:
        return [_info(each) for each in self._call(srv.ListCameras, "list_cameras").cameras]

    def __getitem__(self, number: int) -> RosCamera:
        return RosCamera(self._call, number)

    def __iter__(self) -> Iterator[RosCamera]:
        return (self[each.number] for each in self.get_all())


class RosCamera(Camera):
    """One of them."""

    def __init__(self, call: Call, number: int) -> None:
        self._call = call
        self._number = number

    def status(self) -> CameraStatus:
        return _status(self._ask(srv.GetCameraStatus, "get_camera_status").status)

    def take_photo(self) -> Photo:
        return photo_of(self._ask(srv.TakePhoto, "take_photo").photo)

    def start_photos(self, *, interval_s: float | None = None, distance_m: float | None = None, count: int = 0) -> None:
        given = {"interval": interval_s or 0.0, "distance": distance_m or 0.0, "count": count}
        self._ask(srv.StartPhotos, "start_photos", **given)

    def stop_photos(self) -> None:
        self._ask(srv.OrderCamera, "stop_photos")

    def start_video(self) -> None:
        self._ask(srv.OrderCamera, "start_video")

    def stop_video(self) -> None:
        self._ask(srv.OrderCamera, "stop_video")

    def set_mode(self, mode: CameraMode) -> None:
        self._ask(srv.SetCameraMode, "set_camera_mode", mode=mode.name)

    def set_zoom(self, percent: float) -> None:
        self._ask(srv.SetCameraZoom, "set_camera_zoom", zoom=percent / 100.0)

    def set_focus(self, percent: float | None = None) -> None:
        given = {"is_automatic": True} if percent is None else {"focus": percent / 100.0}
        self._ask(srv.SetCameraFocus, "set_camera_focus", **given)

    def photos(self, first: int = 0) -> list[Photo]:
        """An answer has the first ones only: so the others are asked for."""
        found: list[Photo] = []
        while more := self._ask(srv.ListPhotos, "list_photos", first=first).photos:
            found += map(photo_of, more)
            first = found[-1].number + 1
        return found

    def streams(self) -> list[VideoStream]:
        return [_stream(each) for each in self._ask(srv.ListVideoStreams, "list_video_streams").streams]

    def image(self, photo: int | None = None, kind: ImageKind = ImageKind.COLOUR, *, max_age_s: float = 0.0) -> Image:
        which: dict[str, Any] = {} if photo is None else {"is_photo": True, "photo": photo}
        return _image(self._ask(srv.GetImage, "get_image", kind=kind.name, max_age=max_age_s, **which), kind)

    def _ask(self, service: Any, name: str, **fields: Any) -> Any:
        return self._call(service, name, camera=self._number, **fields)


def _known(number: float) -> float | None:
    return None if math.isnan(number) else float(number)


def _info(message: Any) -> CameraInfo:
    return CameraInfo(
        message.number,
        message.name,
        frozenset(CameraAbility[each] for each in message.abilities),
        message.is_connected,
        message.firmware_version,
        message.width,
        message.height,
        _intrinsics(message.camera_info),
        message.note,
        frozenset(ImageKind[each] for each in message.image_kinds),
    )


def _intrinsics(message: Any) -> CameraIntrinsics | None:
    fx, _, cx, _, fy, cy, *_ = map(float, message.k)
    return CameraIntrinsics(message.width, message.height, fx, fy, cx, cy) if fx else None


def _status(message: Any) -> CameraStatus:
    total, available = _known(message.storage_total), _known(message.storage_available)
    percents = [_known(each) for each in (message.zoom, message.focus, message.battery)]
    return CameraStatus(
        CameraMode[message.mode] if message.mode else None,
        message.is_taking_photos,
        _known(message.interval),
        _known(message.distance),
        message.is_recording,
        message.recording_time,
        message.photos_count,
        message.missed_count,
        CameraStorage(
            StorageState[message.storage] if message.storage else None,
            None if total is None else total / MIB,
            None if available is None else available / MIB,
        ),
        *(None if each is None else 100.0 * each for each in percents),
    )


def photo_of(message: Any) -> Photo:
    """The picture that a message tells of."""
    return Photo(
        message.number, is_stored=message.is_stored, file_url=message.file_url, **_viewpoint(message.viewpoint)
    )


def _viewpoint(message: Any) -> dict[str, Any]:
    optical = _pose(message.optical)
    camera = None if optical is None else ual.Pose(optical.pose.position, optical.pose.orientation * OPTICAL.inverse())
    at = message.position
    place = ual.GeoPoint(
        at.latitude, at.longitude, _known(message.altitude_amsl), _known(message.altitude_home), _known(at.altitude)
    )
    return {
        "stamp_s": message.stamp.sec + message.stamp.nanosec / values.NANO,
        "body": _pose(message.body),
        "camera": None if camera is None or optical is None else ual.PoseStamped(camera, optical.frame_id),
        "position_geo": None if math.isnan(at.latitude) else place,
    }


def _pose(message: Any) -> ual.PoseStamped | None:
    return values.pose_stamped(message) if message.header.frame_id else None


def _stream(message: Any) -> VideoStream:
    return VideoStream(
        message.name,
        message.url,
        message.encoding,
        message.width,
        message.height,
        message.rate,
        message.is_running,
        message.is_thermal,
    )


def _image(answer: Any, kind: ImageKind) -> Image:
    is_distances = bool(answer.distances.data)
    return Image(
        bytes(answer.distances.data if is_distances else answer.compressed.data),
        ImageFormat.FLOAT32 if is_distances else ImageFormat[answer.compressed.format.upper()],
        answer.camera_info.width,
        answer.camera_info.height,
        intrinsics=_intrinsics(answer.camera_info),
        kind=kind,
        **_viewpoint(answer.viewpoint),
    )
