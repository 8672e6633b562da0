"""Setpoints for a backend."""

from __future__ import annotations

from dataclasses import dataclass

from ual.geometry import Pose, Vector3
from ual.shared.immutable import immutable

_ZERO = Vector3()


@immutable
class PositionSetpoint:
    """A position and heading in the local frame, with velocity, acceleration and yaw rate as feed-forward."""

    position: Vector3
    yaw_rad: float
    velocity: Vector3 = _ZERO
    acceleration: Vector3 = _ZERO
    yaw_rate_rad_s: float = 0.0


@immutable
class VelocitySetpoint:
    """A velocity along the local axes and a yaw rate (positive: to the left).

    An acceleration is added as feed-forward by backends whose autopilot takes one.
    """

    velocity: Vector3
    yaw_rate_rad_s: float = 0.0
    acceleration: Vector3 | None = None


Setpoint = PositionSetpoint | VelocitySetpoint


@dataclass(frozen=True, slots=True)
class ExternalPose:
    """A pose of the body in the local frame, measured from outside: for the autopilot's estimator.

    It is checked already: newer than the one before, not old, and not a jump. `time_s` is when it was measured on the
    backend's clock, and `stamp_s` the same as UTC (`Backend.utc_s`). The standard deviations are those of each axis, in
    metres and radians; None where they are not known. `resets_count` changes when the source of the poses has moved its
    origin, or has come back elsewhere: the pose is then a jump that is to be taken.
    """

    pose: Pose
    time_s: float
    stamp_s: float
    position_std_dev_m: float | None = None
    orientation_std_dev_rad: float | None = None
    resets_count: int = 0
