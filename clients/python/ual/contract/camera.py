"""The cameras that a UAV carries. As values, from ``camera.proto``. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ual.contract._bases import CameraIntrinsicsBase
from ual.geometry import PoseStamped
from ual.types import GeoPoint


class CameraAbility(Enum):
    """Ability of a camera."""

    PHOTO = 1
    """TakePhoto, and StartPhotos."""
    VIDEO = 2
    """StartVideo and StopVideo."""
    MODES = 3
    """SetCameraMode."""
    ZOOM = 4
    """SetCameraZoom."""
    FOCUS = 5
    """SetCameraFocus."""
    STREAMS = 6
    """ListVideoStreams."""
    IMAGE = 7
    """GetImage."""


class CameraMode(Enum):
    """The mode of a camera that has modes."""

    PHOTO = 1
    VIDEO = 2
    SURVEY = 3


class StorageState(Enum):
    """Whether pictures can be stored."""

    NONE = 1
    """There is no storage, such as no card in the camera."""
    READY = 2
    FULL = 3
    """No room is left."""
    UNUSABLE = 4
    """It has to be formatted, or does not say what it is."""


class ImageFormat(Enum):
    """Encoding of a picture."""

    PNG = 1
    JPEG = 2
    FLOAT32 = 3
    """Numbers of 32 bits, little-endian, row by row from the top: metres. Infinity: nothing is there. NaN: not known.
    """


class ImageKind(Enum):
    """Meaning of a picture's pixels."""

    COLOUR = 1
    """Colours. A request that sets no kind means this one."""
    DEPTH = 2
    """Distance of each point along the camera's view, m: the z of CameraIntrinsics."""
    RANGE = 3
    """Distance of each point from the camera's centre, m."""
    SEGMENTATION = 4
    """All points of one object, or of one class of objects, have one colour. The backend's manual says which."""


@dataclass(frozen=True, slots=True)
class CameraIntrinsics(CameraIntrinsicsBase):
    """A pinhole camera without distortion, in pixels. The centre of the first pixel is 0, 0.

    A point x right, y down, z forward of the camera is at column ``focal_length_x_px * x / z + centre_x_px`` and row
    ``focal_length_y_px * y / z + centre_y_px``.
    """

    width_px: int
    height_px: int
    focal_length_x_px: float
    focal_length_y_px: float
    centre_x_px: float
    centre_y_px: float


@dataclass(frozen=True, slots=True)
class CameraStorage:
    """Storage of pictures. Values that the camera does not report are None."""

    state: StorageState | None = None
    total_mib: float | None = None
    available_mib: float | None = None


@dataclass(frozen=True, slots=True)
class Photo:
    """A picture that was taken.

    Args:
        number: Counts from 0 for each camera.
        stamp_s: When, as UTC since 1970.
        is_stored: False if the camera says that it failed.
        body: Of the body when it was taken, in ``<ns>/odom``. None while that is not known.
        camera: Of the camera: x along its view, y left, z up in its picture. None where it is not known.
        position_geo: Of the UAV, or as the camera says.
        file_url: Where the camera offers the file; empty if it says nothing.

    """

    number: int
    stamp_s: float
    is_stored: bool = True
    body: PoseStamped | None = None
    camera: PoseStamped | None = None
    position_geo: GeoPoint | None = None
    file_url: str = ""


@dataclass(frozen=True, slots=True)
class VideoStream:
    """An address that a player of video streams opens.

    Args:
        name: What the camera calls it.
        url: Such as rtsp://192.168.42.1:8554/live. For a stream that is sent to a UDP port: udp://:PORT.
        encoding: Such as H264; empty if the camera does not say.

    """

    name: str
    url: str
    encoding: str = ""
    width_px: int = 0
    height_px: int = 0
    rate_hz: float = 0.0
    is_running: bool = False
    is_thermal: bool = False


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """A camera.

    Args:
        number: The number by which requests name it, while the daemon runs.
        name: Human-readable: vendor and model.
        abilities: What it can do.
        is_connected: Whether messages of the camera arrive now.
        firmware_version: As it says; empty if it says nothing.
        width_px: Of its pictures; 0 where it does not say.
        height_px: Of its pictures; 0 where it does not say.
        intrinsics: Where the backend knows them, without zoom.
        note: Human-readable oddities: two reports that contradict each other, and what follows. Empty if there are
            none.
        image_kinds: What GetImage gives. Without any, it gives colours.

    """

    number: int
    name: str
    abilities: frozenset[CameraAbility]
    is_connected: bool = True
    firmware_version: str = ""
    width_px: int = 0
    height_px: int = 0
    intrinsics: CameraIntrinsics | None = None
    note: str = ""
    image_kinds: frozenset[ImageKind] = frozenset()


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """State of a camera.

    Args:
        mode: Its mode; None where it does not say.
        is_taking_photos: Whether it takes pictures by time, or by distance.
        interval_s: The time between two pictures, while it takes them by time.
        distance_m: The distance between two pictures, while it takes them by distance.
        is_recording: Whether it records a video.
        recording_s: How long the video is, s.
        photos_count: Pictures taken since the daemon was started.
        missed_count: Pictures that were ordered by the daemon, or reported by the camera, and failed or were lost.
        storage: Where it stores them.
        zoom_percent: 0 (wide) to 100; None where the camera does not say.
        focus_percent: 0 (near) to 100 (far).
        battery_percent: Of its own battery.

    """

    mode: CameraMode | None = None
    is_taking_photos: bool = False
    interval_s: float | None = None
    distance_m: float | None = None
    is_recording: bool = False
    recording_s: float = 0.0
    photos_count: int = 0
    missed_count: int = 0
    storage: CameraStorage = CameraStorage()
    zoom_percent: float | None = None
    focus_percent: float | None = None
    battery_percent: float | None = None
