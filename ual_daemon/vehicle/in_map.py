"""Content of ``map`` for displays: where the UAV may fly, and the route that it flies."""

from __future__ import annotations

import math

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual.types import Circle, Geofence, Route
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.policy import geofence as policy
from ual_daemon.frames.odom_metres import FrameInLocal
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.frames.tree import MAP

_LEVEL_TOLERANCE = 1e-6


def geofence_in_map(geofence: policy.GeofencePolicy, resolver: FrameResolver, snapshot: Snapshot) -> Geofence:
    """Returns the geofence, the floor and the ceiling, and the limits of the autopilot's own fence, as one.

    The zones of that fence are refused, but not reported: the contract has one polygon and one circle.

    Raises:
        WrongStateError: It is not known where they lie.
        FrameLostError: It is not known any more.

    """
    edges = geofence.edges(snapshot)
    in_local = _level_map(resolver)
    disc, base_m = edges.disc, in_local.from_local(Vector3()).z
    return Geofence(
        MAP,
        tuple(in_local.from_local(Vector3(x, y, 0.0)) for x, y in edges.corners),
        None if disc is None else Circle(in_local.from_local(Vector3(disc.x, disc.y, 0.0)), max(0.0, disc.radius_m)),
        _finite(base_m + edges.lowest_m),
        _finite(base_m + edges.highest_m),
    )


def route_in_map(flight: Flight, resolver: FrameResolver, snapshot: Snapshot) -> Route | None:
    """Returns the way that is flown; None where none is known.

    Raises:
        WrongStateError: It is not known where the local frame lies in ``map``.
        FrameLostError: It is not known any more.

    """
    way = flight.running_route(snapshot)
    if way is None:
        return None
    in_local = resolver.in_local(MAP)
    return Route(MAP, tuple(map(in_local.from_local, way.points)), way.task_id, way.is_goal_moving)


def _level_map(resolver: FrameResolver) -> FrameInLocal:
    in_local = resolver.in_local(MAP)
    up = in_local.rotation.rotate(Vector3(0.0, 0.0, 1.0))
    if math.hypot(up.x, up.y) > _LEVEL_TOLERANCE:
        raise WrongStateError(f"the geofence cannot be told in {MAP}: the UAV's local frame is not level there")
    return in_local


def _finite(height_m: float) -> float | None:
    return height_m if math.isfinite(height_m) else None
