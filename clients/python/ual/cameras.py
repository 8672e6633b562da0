"""The cameras of a UAV, as values. `ual.Uav.cameras` takes pictures with them; see ``docs/how-to/cameras.md``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from ual.geometry import PoseStamped, Quaternion
from ual.types import GeoPoint

OPTICAL = Quaternion(-0.5, 0.5, -0.5, 0.5)
"""The rotation from a camera's optical axes (z forward, x right, y down in its picture) to those of its pose.

Those are x forward, y left, z up. The pose that OpenCV means has the orientation ``camera.orientation * OPTICAL``.
"""


class CameraAbility(Enum):
    """What a camera can do."""

    PHOTO = 1
    VIDEO = 2
    MODES = 3
    ZOOM = 4
    FOCUS = 5
    STREAMS = 6
    IMAGE = 7


class CameraMode(Enum):
    """The mode of a camera that has modes."""

    PHOTO = 1
    VIDEO = 2
    SURVEY = 3


class StorageState(Enum):
    """Whether pictures can be stored."""

    NONE = 1
    READY = 2
    FULL = 3
    UNUSABLE = 4


class ImageFormat(Enum):
    """How a picture is encoded."""

    PNG = 1
    JPEG = 2
    FLOAT32 = 3
    """Little-endian, row by row from the top: metres. Infinity: nothing is there. NaN: not known."""


class ImageKind(Enum):
    """What the pixels of a picture mean."""

    COLOUR = 1
    DEPTH = 2
    """How far each point is along the camera's view, m: the z of `CameraIntrinsics`."""
    RANGE = 3
    """How far each point is from the camera's centre, m."""
    SEGMENTATION = 4
    """All points of one object, or of one class of objects, have one colour. The backend's manual says which."""


@dataclass(frozen=True, slots=True)
class CameraIntrinsics:
    """A pinhole camera without distortion, in pixels. The centre of the first pixel is 0, 0.

    A point x right, y down, z forward is at column ``focal_length_x_px * x / z + centre_x_px`` and row
    ``focal_length_y_px * y / z + centre_y_px``.
    """

    width_px: int
    height_px: int
    focal_length_x_px: float
    focal_length_y_px: float
    centre_x_px: float
    centre_y_px: float

    @classmethod
    def of_view(cls, width_px: int, height_px: int, horizontal_view_rad: float) -> CameraIntrinsics:
        """Returns those of square pixels, whose rows see this angle from the left edge to the right one."""
        focal_px = 0.5 * width_px / math.tan(0.5 * horizontal_view_rad)
        return cls(width_px, height_px, focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1))


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """A camera.

    Args:
        number: By which it is named while the daemon runs.
        name: For people: vendor and model.
        abilities: What it can do.
        is_connected: Whether it is heard now.
        firmware_version: As it says; empty if it says nothing.
        width_px: Of its pictures; 0 where it does not say. So is `height_px`.
        intrinsics: Without zoom; None where the backend does not know them.
        note: What is odd about it, for people. Empty if nothing is.
        image_kinds: What it gives as bytes: `ual.interface.Camera.image`.

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
class CameraStorage:
    """Where pictures are stored. None is what the camera does not say."""

    state: StorageState | None = None
    total_mib: float | None = None
    available_mib: float | None = None


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """What a camera does. None is what it does not say.

    Args:
        mode: Its mode.
        is_taking_photos: Whether it takes pictures by time, or by distance.
        interval_s: The time between two pictures, while it takes them by time.
        distance_m: The distance between two pictures, while it takes them by distance.
        is_recording: Whether it records a video.
        recording_s: How long the video is.
        photos_count: Pictures taken since the daemon was started.
        missed_count: Pictures that were ordered by the daemon, or reported by the camera, and failed or were lost.
        storage: Where it stores them.
        zoom_percent: 0 (wide) to 100.
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


@dataclass(frozen=True, slots=True)
class Photo:
    """A picture that was taken.

    Args:
        number: Counts from 0 for each camera.
        stamp_s: When, as UTC since 1970.
        is_stored: False if the camera says that it failed.
        body: Of the body when it was taken; None while that is not known.
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
    """An address that a player of video streams opens, such as rtsp://192.168.42.1:8554/live, or udp://:PORT."""

    name: str
    url: str
    encoding: str = ""
    width_px: int = 0
    height_px: int = 0
    rate_hz: float = 0.0
    is_running: bool = False
    is_thermal: bool = False


@dataclass(frozen=True, slots=True)
class Image:
    """A picture as bytes. `body`, `camera` and `position_geo` are as in `Photo`; `intrinsics` as it is zoomed in it."""

    data: bytes
    format: ImageFormat
    width_px: int
    height_px: int
    stamp_s: float
    intrinsics: CameraIntrinsics | None = None
    body: PoseStamped | None = None
    camera: PoseStamped | None = None
    position_geo: GeoPoint | None = None
    kind: ImageKind = ImageKind.COLOUR

    def __repr__(self) -> str:
        return f"<Image {self.width_px}x{self.height_px} {self.format.name} of {len(self.data)} bytes>"
