"""The cameras of a UAV, as values. `ual.Uav.cameras` takes pictures with them; see ``docs/how-to/cameras.md``."""

from __future__ import annotations

from dataclasses import dataclass

from ual.contract.camera import (
    CameraAbility,
    CameraInfo,
    CameraIntrinsics,
    CameraMode,
    CameraStatus,
    CameraStorage,
    ImageFormat,
    ImageKind,
    Photo,
    StorageState,
    VideoStream,
)
from ual.geometry import PoseStamped, Quaternion
from ual.types import GeoPoint

__all__ = [
    "OPTICAL",
    "CameraAbility",
    "CameraInfo",
    "CameraIntrinsics",
    "CameraMode",
    "CameraStatus",
    "CameraStorage",
    "Image",
    "ImageFormat",
    "ImageKind",
    "Photo",
    "StorageState",
    "VideoStream",
]

OPTICAL = Quaternion(-0.5, 0.5, -0.5, 0.5)
"""The rotation from a camera's optical axes (z forward, x right, y down in its picture) to those of its pose.

Those are x forward, y left, z up. The pose that OpenCV means has the orientation ``camera.orientation * OPTICAL``.
"""


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
