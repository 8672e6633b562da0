"""Poses from outside as the messages that autopilots take, in north-east-down and with time stamps in UTC.

Both autopilots convert the stamps to their own time: PX4 by TIMESYNC, to which UAL answers with UTC, and ArduPilot by
the fastest message of late.
"""

from __future__ import annotations

import math

from ual.geometry import Quaternion
from ual_daemon.backends.mavlink.dialects.axes import enu_to_ned, orientation_to_enu
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import ExternalPose

_COVARIANCE_FIELDS = 21
_POSITION_DIAGONAL, _ORIENTATION_DIAGONAL = (0, 6, 11), (15, 18, 20)
"""Of a 6 x 6 matrix, of which the upper right triangle is sent row by row."""


def encode_odometry(measured: ExternalPose) -> Message:
    """Returns ODOMETRY without velocities: PX4 takes those that are not finite as not measured."""
    position, q = enu_to_ned(measured.pose.position), _to_ned(measured.pose.orientation)
    nan = math.nan
    return mavlink.MAVLink_odometry_message(
        _micros(measured),
        mavlink.MAV_FRAME_LOCAL_NED,
        mavlink.MAV_FRAME_BODY_FRD,
        *position,
        [q.w, q.x, q.y, q.z],
        *(nan, nan, nan, nan, nan, nan),
        _covariance(measured, unknown=nan),
        [nan] * _COVARIANCE_FIELDS,
        measured.resets_count & 0xFF,
        mavlink.MAV_ESTIMATOR_TYPE_VISION,
    )


def encode_vision_position_estimate(measured: ExternalPose) -> Message:
    """Returns VISION_POSITION_ESTIMATE: ArduPilot would take velocities of ODOMETRY, whatever they are.

    A variance that is not a number is an internal error to it, after which it cannot be armed before its next boot. It
    takes none smaller than its parameters say.
    """
    position = enu_to_ned(measured.pose.position)
    roll_rad, pitch_rad, yaw_rad = _to_ned(measured.pose.orientation).to_euler()
    return mavlink.MAVLink_vision_position_estimate_message(
        _micros(measured),
        *position,
        roll_rad,
        pitch_rad,
        yaw_rad,
        _covariance(measured, unknown=0.0),
        measured.resets_count & 0xFF,
    )


def _to_ned(orientation: Quaternion) -> Quaternion:
    """Returns the rotation from the body (FRD) to NED: the formula serves both directions."""
    return orientation_to_enu(orientation.w, orientation.x, orientation.y, orientation.z)


def _micros(measured: ExternalPose) -> int:
    return max(1, round(measured.stamp_s * 1e6))


def _covariance(measured: ExternalPose, *, unknown: float) -> list[float]:
    """Returns the variances; `unknown` for those that are not known, so that the autopilot's parameters hold."""
    covariance = [0.0] * _COVARIANCE_FIELDS
    for diagonal, std_dev in (
        (_POSITION_DIAGONAL, measured.position_std_dev_m),
        (_ORIENTATION_DIAGONAL, measured.orientation_std_dev_rad),
    ):
        for i in diagonal:
            covariance[i] = unknown if std_dev is None else std_dev * std_dev
    return covariance
