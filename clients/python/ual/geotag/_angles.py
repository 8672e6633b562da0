"""Orientation of a picture, in the angles that programs for maps read. Pure mathematics."""

from __future__ import annotations

import math
from typing import NamedTuple

from ual.geometry import Quaternion, Vector3

_UPRIGHT_SINE = 1.0 - 1e-9
"""Sine of the pitch from which on yaw and roll turn about the same axis."""


class Angles(NamedTuple):
    """The attitude of a camera. All are zero for one that looks straight down, the top of its picture to the north.

    Attributes:
        yaw_rad: How far the top of the picture is turned to the east.
        pitch_rad: How far the view is raised then: pi/2 looks at the horizon.
        roll_rad: How far the right side is lowered then.
        heading_rad: Where it looks, from north to east; for one that looks down, where the top of its picture is.

    """

    yaw_rad: float
    pitch_rad: float
    roll_rad: float
    heading_rad: float


def angles(camera: Quaternion) -> Angles:
    """Returns the angles of a camera's pose, whose frame has x to the east and y to the north.

    These are the angles of an aircraft whose nose is the top of the picture, and under which the camera looks down.
    """
    view, left, top = (_north_east_down(camera.rotate(axis)) for axis in (Vector3(1.0), Vector3(0.0, 1.0), _UP))
    heading_rad = math.atan2(view.y + top.y, view.x + top.x) % math.tau
    pitch_rad = math.asin(max(-1.0, min(1.0, -top.z)))
    if abs(top.z) > _UPRIGHT_SINE:
        return Angles(math.atan2(left.x, -left.y) % math.tau, pitch_rad, 0.0, heading_rad)
    return Angles(math.atan2(top.y, top.x) % math.tau, pitch_rad, math.atan2(-left.z, view.z), heading_rad)


_UP = Vector3(0.0, 0.0, 1.0)


def _north_east_down(vector: Vector3) -> Vector3:
    return Vector3(vector.y, vector.x, -vector.z)
