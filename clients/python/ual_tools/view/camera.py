"""From where a camera sees all of some places, and where it sees them. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ual.geometry import Quaternion, Vector3

_FROM = Vector3(-0.45, -0.75, 0.5)
"""The direction from what is looked at to the camera: from the south-west, from above."""
_LEAST_RADIUS_M = 3.0
_RADIUS_MARGIN_FACTOR = 1.1
_UNKNOWN_FOV_RAD = 1.0
_NEAREST_DEPTH_M = 0.1


@dataclass(frozen=True, slots=True)
class PageCamera:
    """A camera of a page: `fov_rad` is that of its height. Its axes are x right, y down, z ahead."""

    position: Vector3
    rotation: Quaternion
    fov_rad: float
    width_px: float
    height_px: float

    def pixel(self, point: Vector3) -> tuple[float, float, float] | None:
        """Returns where a place is seen, in pixels from the upper left corner, and how far ahead it is, in metres.

        None: it is behind the camera.
        """
        in_camera = self.rotation.inverse().rotate(point - self.position)
        if in_camera.z < _NEAREST_DEPTH_M:
            return None
        scale = self.pixels_per_m(in_camera.z)
        return self.width_px / 2 + in_camera.x * scale, self.height_px / 2 + in_camera.y * scale, in_camera.z

    def pixels_per_m(self, ahead_m: float) -> float:
        """Returns how many pixels a metre takes at a distance."""
        return self.height_px / (2.0 * math.tan(self.fov_rad / 2.0) * ahead_m)

    @property
    def up(self) -> Vector3:
        """Upward direction in the picture."""
        return self.rotation.rotate(Vector3(0.0, -1.0, 0.0))


def framing(positions: Sequence[Vector3], fov_rad: float, aspect: float) -> tuple[Vector3, Vector3]:
    """Returns where to put a camera so that it sees all places, and at what it looks.

    Args:
        positions: At least one, in metres.
        fov_rad: Its field of view from below to above.
        aspect: Its width by its height.

    """
    low = Vector3(*(min(axis) for axis in zip(*positions, strict=True)))
    high = Vector3(*(max(axis) for axis in zip(*positions, strict=True)))
    middle = (low + high) * 0.5
    radius_m = max(_LEAST_RADIUS_M, (high - low).norm() / 2.0)
    half_rad = (fov_rad if 0.0 < fov_rad < math.pi else _UNKNOWN_FOV_RAD) / 2.0
    if 0.0 < aspect < 1.0:
        half_rad = math.atan(math.tan(half_rad) * aspect)
    distance_m = _RADIUS_MARGIN_FACTOR * radius_m / math.sin(half_rad)
    return middle + _FROM * (distance_m / _FROM.norm()), middle
