"""The UAV abstraction layer: fly any UAV without knowing its autopilot.

>>> import ual
>>> with ual.Uav("uav_1") as uav:
...     uav.take_off(3.0)
...     uav.go_to_waypoint(ual.Pose.at(4.0, 2.0, 3.0, yaw_rad=1.57))
...     uav.land()
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from ual.credentials import Credentials
from ual.errors import (
    ClientUnusableError,
    DaemonUnreachableError,
    FrameLostError,
    GeofenceError,
    InvalidArgumentError,
    LeaseHeldError,
    LeaseLostError,
    LinkLostError,
    NotSupportedError,
    PermissionDeniedError,
    RejectedByAutopilotError,
    ResourceExhaustedError,
    TaskAbortedError,
    TeamError,
    UalError,
    UalTimeoutError,
    UnauthenticatedError,
    UnknownFrameError,
    WrongStateError,
)
from ual.geometry import (
    KEEP_HEADING,
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    Twist,
    TwistStamped,
    Vector3,
)
from ual.types import (
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
    Info,
    LeaseInfo,
    Limits,
    Odometry,
    PathHeading,
    Plan,
    Route,
    State,
    TaskInfo,
    TaskKind,
    TaskStatus,
    Telemetry,
)

if TYPE_CHECKING:
    from ual import aio
    from ual import cameras as cameras
    from ual import conformance as conformance
    from ual import fences as fences
    from ual import geotag as geotag
    from ual import gimbals as gimbals
    from ual import missions as missions
    from ual import network as network
    from ual import routes as routes
    from ual import simulation as simulation
    from ual._client import Uav
    from ual._team import Team

__all__ = [
    "KEEP_HEADING",
    "AltitudeReference",
    "Battery",
    "Capability",
    "Circle",
    "ClientUnusableError",
    "Credentials",
    "DaemonUnreachableError",
    "Frame",
    "FrameLostError",
    "GeoPoint",
    "GeoWaypoint",
    "Geofence",
    "GeofenceError",
    "GpsFix",
    "GpsInfo",
    "Info",
    "InvalidArgumentError",
    "LeaseHeldError",
    "LeaseInfo",
    "LeaseLostError",
    "Limits",
    "LinkLostError",
    "NotSupportedError",
    "Odometry",
    "PathHeading",
    "PermissionDeniedError",
    "Plan",
    "PointStamped",
    "Pose",
    "PoseStamped",
    "Quaternion",
    "RejectedByAutopilotError",
    "ResourceExhaustedError",
    "Route",
    "State",
    "TaskAbortedError",
    "TaskInfo",
    "TaskKind",
    "TaskStatus",
    "Team",
    "TeamError",
    "Telemetry",
    "Transform",
    "Twist",
    "TwistStamped",
    "UalError",
    "UalTimeoutError",
    "Uav",
    "UnauthenticatedError",
    "UnknownFrameError",
    "Vector3",
    "WrongStateError",
    "__version__",
    "aio",
]

__version__ = "0.3.0.dev0"


_MODULES = (
    "aio",
    "cameras",
    "conformance",
    "fences",
    "geotag",
    "gimbals",
    "missions",
    "network",
    "routes",
    "simulation",
)
"""Modules that work after ``import ual``, without an import of their own: `ual.routes.read`."""


if not TYPE_CHECKING:  # a type checker would take any name for one of ours

    def __getattr__(name: str) -> object:
        # Imported when used: gRPC takes longer to import than all the rest, and ``ual --help`` needs none of it.
        if name == "Uav":
            return importlib.import_module("ual._client").Uav
        if name == "Team":
            return importlib.import_module("ual._team").Team
        if name in _MODULES:
            return importlib.import_module(f"ual.{name}")
        raise AttributeError(f"module 'ual' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
