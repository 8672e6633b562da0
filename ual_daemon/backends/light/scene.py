"""Scene for a simulated camera. Without numpy: the daemon has no need for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ual.cameras import CameraIntrinsics, ImageKind
from ual.geometry import Pose


class Marker(NamedTuple):
    """A square on the ground, with cells from its upper left corner on: True is white. Black and white borders follow.

    `size_m` is the side of its black border. With a yaw of 0 its top is towards y, and its right side towards x.
    """

    x_m: float
    y_m: float
    size_m: float
    yaw_rad: float
    cells: tuple[tuple[bool, ...], ...]


class PaintedScene(NamedTuple):
    """Visible objects. Places are in the local frame, in metres."""

    ground_z_m: float
    markers: Sequence[Marker] = ()


class PaintOrder(NamedTuple):
    """A picture that is to be painted. `noise` and `seed` are of colours."""

    camera: Pose
    intrinsics: CameraIntrinsics
    scene: PaintedScene
    kind: ImageKind = ImageKind.COLOUR
    noise: float = 0.0
    seed: int = 0
