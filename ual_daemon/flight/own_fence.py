"""The fence that the autopilot itself applies around its home: UAL stays inside, and says when it was left."""

from __future__ import annotations

import math

from ual.geometry import Vector3
from ual_daemon.backends.values import FenceLimit, LandedState, OwnFence, Snapshot
from ual_daemon.frames.fence import Disc

RESERVE_M = 1.0
"""How far inside UAL stays: it overshoots a goal by up to 0.5 m, and a hover wanders by up to 0.9 m. At the edge the
autopilot takes the UAV away (RTL)."""


def home_of(snapshot: Snapshot) -> Vector3 | None:
    """Returns where home is; None if that is not known. Right after arming, on the ground, it is where it stands."""
    is_on_ground = snapshot.landed is not None and snapshot.landed.value is LandedState.ON_GROUND
    if snapshot.home is None and is_on_ground and snapshot.pose is not None:
        return snapshot.pose.value.position
    return snapshot.home


def disc(own: OwnFence, home: Vector3) -> Disc | None:
    """Returns the disc in which UAL stays; None if there is no such limit."""
    return None if own.radius is None else Disc(home.x, home.y, own.radius.value_m - RESERVE_M)


def band(own: OwnFence, home_z_m: float, reserve_m: float = RESERVE_M) -> tuple[float, float]:
    """Returns the heights between which UAL stays, above what `home_z_m` is above."""
    lowest_m = -math.inf if own.lowest is None else home_z_m + own.lowest.value_m + reserve_m
    highest_m = math.inf if own.highest is None else home_z_m + own.highest.value_m - reserve_m
    return lowest_m, highest_m


def where_beyond(point: Vector3, snapshot: Snapshot, reserve_m: float = RESERVE_M) -> tuple[str, FenceLimit] | None:
    """Returns how a point lies beyond the fence, for people, and beyond which limit; None if it does not."""
    own, home = snapshot.own_fence, home_of(snapshot)
    if own is None or home is None:
        return None
    away_m, height_m = math.hypot(point.x - home.x, point.y - home.y), point.z - home.z
    lowest_m, highest_m = band(own, 0.0, reserve_m)
    if own.radius is not None and away_m > own.radius.value_m - reserve_m:
        return f"{away_m:.1f} m from its home", own.radius
    if own.highest is not None and height_m > highest_m:
        return f"{height_m:.1f} m above its home", own.highest
    if own.lowest is not None and height_m < lowest_m:
        return f"{height_m:.1f} m above its home", own.lowest
    return None


def breach_text(snapshot: Snapshot) -> str:
    """Returns that the UAV is beyond the fence, for people; empty if it is not."""
    if snapshot.pose is None:
        return ""
    found = where_beyond(snapshot.pose.value.position, snapshot, 0.0)
    if found is None:
        return ""
    where, limit = found
    return f"it is {where}, beyond the autopilot's own fence ({limit.parameter}: {limit.value_m:g} m)"
