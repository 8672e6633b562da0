"""MAVLink's axes (north-east-down outside, forward-right-down in the body) to and from ours, and nothing else.

Both changes of axes are half turns, so that one function serves both directions.
"""

from __future__ import annotations

import math

from ual.geometry import Quaternion, Vector3, wrap_angle

_SQRT_HALF = math.sqrt(0.5)


def swap_local(x: float, y: float, z: float) -> Vector3:
    """North, east, down as east, north, up; and back."""
    return Vector3(y, x, -z)


def swap_body(x: float, y: float, z: float) -> Vector3:
    """Forward, right, down as forward, left, up; and back."""
    return Vector3(x, -y, -z)


def orientation_to_enu(w: float, x: float, y: float, z: float) -> Quaternion:
    """The rotation from the body (FRD) to NED as that from the body (FLU) to ENU; unit length."""
    # The half turn about (1, 1, 0) on the left, the half turn about the body's x axis on the right, multiplied out.
    q = Quaternion((x + y) * _SQRT_HALF, (x - y) * _SQRT_HALF, (w - z) * _SQRT_HALF, (w + z) * _SQRT_HALF)
    return q.normalized()


def swap_yaw(yaw_rad: float) -> float:
    """A heading clockwise from north as one counter-clockwise from east; and back."""
    return wrap_angle(math.pi / 2 - yaw_rad)
