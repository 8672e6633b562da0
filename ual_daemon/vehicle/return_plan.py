"""The way home: up to a safe height, and straight over home. The landing there is not part of it."""

from __future__ import annotations

from typing import NamedTuple

from ual.errors import GeofenceError, WrongStateError
from ual.geometry import Vector3
from ual.types import Limits, PathHeading, Plan
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.policy.home import HomePoint, home_point
from ual_daemon.settings import VehicleSettings
from ual_daemon.trajectory import Brake, Chain, Motion, PathWaypoint, Trajectory, path
from ual_daemon.vehicle.admission import admit
from ual_daemon.vehicle.distance_limit import require_home

_NAME = "return_to_launch"
_SAME_HEIGHT_M = 0.1
"""A smaller climb is not flown for itself, but on the way."""


class ReturnPlan(NamedTuple):
    """A way home that is inside the geofence, and where it leads."""

    trajectory: Trajectory
    home: HomePoint
    plan: Plan


def plan_return(
    flight: Flight, settings: VehicleSettings, height_m: float | None, bounds: Limits, snapshot: Snapshot
) -> ReturnPlan:
    """Plans the way home from the motion that is commanded now.

    Args:
        flight: What the UAV flies now.
        settings: The tolerance within which it is over home already, the reach, and the height if none is given.
        height_m: The least height above the ground of the take-off; None: that of the settings, as far as it fits.
        bounds: The limits of the motion.
        snapshot: The newest data.

    Raises:
        WrongStateError: No home is known, or it is not known where the geofence lies.
        GeofenceError: Home or the way there lies outside, or home is beyond the reach.

    """
    home = home_point(snapshot, flight.geofence.ground)
    if home is None:
        raise WrongStateError(
            f"{_NAME}: no home is known: the autopilot has not said where it is, and UAL has not seen the take-off; "
            "fly there (go_to_waypoint) and land, or land here",
            {"command": _NAME},
        )
    require_home(_NAME, home, settings, snapshot)
    start = flight.start(snapshot)
    stop = Brake(start, bounds).end()
    over_home = Vector3(home.position.x, home.position.y, stop.position.z)
    if (over_home - stop.position).norm() > settings.tolerance.position_m:
        over_home = Vector3(over_home.x, over_home.y, _return_z_m(flight, settings, height_m, home, stop, snapshot))
    trajectory = _trajectory(start, stop, over_home, bounds)
    try:
        plan = admit(flight, _NAME, trajectory, snapshot)
    except GeofenceError as error:
        raise GeofenceError(
            f"{error.message}; fly (go_to_waypoint) to a place from which the straight way home is free and command "
            "this again, give another height_m, or land where it is (land)",
            error.metadata,
        ) from None
    return ReturnPlan(trajectory, home, plan)


def _return_z_m(
    flight: Flight, settings: VehicleSettings, height_m: float | None, home: HomePoint, stop: Motion, snapshot: Snapshot
) -> float:
    """Returns the z at which it flies home: no lower than it is, unless that is above what the geofence allows."""
    top_z_m = flight.geofence.top_z_m(snapshot)
    if height_m is None:
        wanted_z_m = min(home.position.z + settings.rtl_height_m, top_z_m)
    else:
        wanted_z_m = home.position.z + height_m
    return max(wanted_z_m, min(stop.position.z, top_z_m))


def _trajectory(start: Motion, stop: Motion, over_home: Vector3, bounds: Limits) -> Trajectory:
    """Plans the motion: to rest, straight up (or down, below the ceiling), and straight over home."""
    here = stop.position
    ways = [PathWaypoint(over_home)]
    if abs(over_home.z - here.z) > _SAME_HEIGHT_M:
        ways.insert(0, PathWaypoint(Vector3(here.x, here.y, over_home.z)))
    onward = path(Motion(here, stop.yaw_rad), ways, 0.0, bounds, PathHeading.FIXED)
    if start.velocity == start.acceleration == Vector3() and start.yaw_rate_rad_s == 0.0:
        return onward
    return Chain([(Brake(start, bounds), 0, 0), (onward, 0, 0)])
