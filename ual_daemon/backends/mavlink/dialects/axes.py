"""Conversion between NED and ENU, FRD and FLU: MAVLink's axes to and from ours, and nothing else.

MAVLink uses north-east-down outside and forward-right-down in the body; we use east-north-up and forward-left-up
(REP 103). Both changes of axes are rotations by 180 degrees, so that the same formula serves both directions.
"""

from __future__ import annotations

import math

from ual.geometry import Quaternion, Vector3, vector3, wrap_angle

_SQRT_HALF = math.sqrt(0.5)


def ned_to_enu(north: float, east: float, down: float) -> Vector3:
    """Converts north, east, down to east, north, up."""
    return vector3(east, north, -down)


def enu_to_ned(vector: Vector3) -> tuple[float, float, float]:
    """Converts east, north, up to north, east, down."""
    return vector.y, vector.x, -vector.z


def frd_to_flu(forward: float, right: float, down: float) -> Vector3:
    """Converts forward, right, down to forward, left, up. It is its own inverse."""
    return vector3(forward, -right, -down)


def orientation_to_enu(w: float, x: float, y: float, z: float) -> Quaternion:
    """Converts the rotation from the body (FRD) to NED to the one from the body (FLU) to ENU. Unit length."""
    # 180 degrees about (1, 1, 0) on the left, 180 degrees about the body's x axis on the right, multiplied out.
    x, y, z, w = (x + y) * _SQRT_HALF, (x - y) * _SQRT_HALF, (w - z) * _SQRT_HALF, (w + z) * _SQRT_HALF
    n = math.hypot(x, y, z, w)
    return Quaternion(x / n, y / n, z / n, w / n)


def enu_to_ned_yaw(yaw_rad: float) -> float:
    """Converts a heading counter-clockwise from east to one clockwise from north. It is its own inverse."""
    return wrap_angle(math.pi / 2 - yaw_rad)


def enu_to_ned_yaw_rate(yaw_rate_rad_s: float) -> float:
    """Converts a yaw rate to the left to one to the right. It is its own inverse."""
    return -yaw_rate_rad_s
