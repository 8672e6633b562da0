"""The value types of the interface: what `ual.v1` says in protobuf, as plain immutable Python values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ual.contract.odometry import Odometry
from ual.contract.uav import (
    AltitudeReference,
    Battery,
    Capability,
    Circle,
    Frame,
    Geofence,
    GeoPoint,
    GeoWaypoint,
    GpsFix,
    GpsInfo,
    Health,
    Info,
    LeaseInfo,
    Limits,
    PathHeading,
    Plan,
    Route,
    State,
    TaskInfo,
    TaskKind,
    TaskStatus,
    Telemetry,
)
from ual.geometry import PointStamped, Pose, PoseStamped, TwistStamped
from ual.shared.quick import quicken

__all__ = [
    "AltitudeReference",
    "Battery",
    "Capability",
    "Circle",
    "ExternalPose",
    "FollowPathRequest",
    "Frame",
    "GeoPoint",
    "GeoWaypoint",
    "Geofence",
    "GoToWaypointGeoRequest",
    "GoToWaypointRequest",
    "GpsFix",
    "GpsInfo",
    "Health",
    "Info",
    "LandRequest",
    "LeaseInfo",
    "Limits",
    "Odometry",
    "PathHeading",
    "Plan",
    "RecoverFromManualRequest",
    "ReturnToLaunchRequest",
    "Route",
    "State",
    "TakeOffRequest",
    "TaskInfo",
    "TaskKind",
    "TaskStatus",
    "Telemetry",
]

quicken(Battery, GeoPoint, Odometry, TaskInfo, Telemetry)  # each sample is made of them

Waypoints = Sequence[PoseStamped | Pose] | Sequence[GeoWaypoint]
"""Of a path: poses, in any frames, or geographic positions."""


@dataclass(frozen=True, slots=True)
class TakeOffRequest:
    """Climb straight up to `height_m` (metres, more than 0) above the ground that the UAV stands on.

    `force`: although a failsafe is active.
    """

    height_m: float
    force: bool = False


@dataclass(frozen=True, slots=True)
class LandRequest:
    """Land where the UAV is."""


@dataclass(frozen=True, slots=True)
class GoToWaypointRequest:
    """Fly straight to a pose, at most at `max_speed_m_s` in any direction (None: only the UAV's limits)."""

    waypoint: PoseStamped
    max_speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class GoToWaypointGeoRequest:
    """Fly straight to a position on Earth, at most at `max_speed_m_s` (None: only the UAV's limits)."""

    waypoint: GeoWaypoint
    max_speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class FollowPathRequest:
    """Fly through waypoints, all poses or all geographic. See `ual.interface.TaskCommands.follow_path`."""

    waypoints: Sequence[PoseStamped | GeoWaypoint]
    corner_radius_m: float = 0.0
    max_speed_m_s: float | None = None
    leg_speeds_m_s: Sequence[float] = ()
    heading: PathHeading = PathHeading.WAYPOINTS
    point_of_interest: PointStamped | None = None
    holds_s: Sequence[float] = ()


@dataclass(frozen=True, slots=True)
class ReturnToLaunchRequest:
    """Fly home and land there, at least `height_m` above the ground (None: as the daemon is configured)."""

    height_m: float | None = None


@dataclass(frozen=True, slots=True)
class RecoverFromManualRequest:
    """Take control back from the safety pilot, and hold the pose found; with `force` out of a failsafe, too."""

    force: bool = False


@dataclass(frozen=True, slots=True)
class ExternalPose:
    """Pose of the UAV, measured from outside at `pose.stamp_s` (UTC since 1970; 0: just now).

    The standard deviations are those of each axis, in metres and radians; None where they are not known.
    """

    pose: PoseStamped
    position_std_dev_m: float | None = None
    orientation_std_dev_rad: float | None = None


TaskRequest = (
    TakeOffRequest
    | LandRequest
    | GoToWaypointRequest
    | GoToWaypointGeoRequest
    | FollowPathRequest
    | ReturnToLaunchRequest
)
"""Request that begins a task. Nothing in it is checked yet: the vehicle in the daemon does that, once for all
callers.
"""
Setpoint = PoseStamped | TwistStamped
"""A reference that is sent as it is: `set_pose` and `set_velocity`."""
MotionRequest = TaskRequest | RecoverFromManualRequest | Setpoint
"""Whatever moves the UAV, and so can be requested as a dry run."""
