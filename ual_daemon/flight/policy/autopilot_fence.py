"""The fence that the autopilot itself applies: UAL stays inside, and says when it was left."""

from __future__ import annotations

import math
from typing import NamedTuple

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual_daemon.backends.values import AutopilotFence, FenceLimit, Snapshot
from ual_daemon.flight.policy.autopilot_zones import local_zones
from ual_daemon.frames.fence import Disc, Fence

RESERVE_M = 1.0
"""Metres inside the fence within which UAL stays: it overshoots a goal by up to 0.5 m, and a hover wanders by up to 0.9
m. At the edge the autopilot takes the UAV away (RTL).
"""


class Beyond(NamedTuple):
    """Violation of the fence by a point: `where` and beyond which `limit`, and as metadata of an error."""

    where: str
    limit: str
    metadata: dict[str, str]


def home_of(snapshot: Snapshot) -> Vector3 | None:
    """Returns where home is; None if that is not known. Right after arming, on the ground, it is where it stands."""
    home, pose = snapshot.earth.home, snapshot.motion.pose
    if home is None and pose is not None and snapshot.control.is_on_ground:
        return pose.value.position
    return home


def disc(own: AutopilotFence, home: Vector3, reserve_m: float = RESERVE_M) -> Disc | None:
    """Returns the disc in which UAL stays; None if there is no such limit."""
    return None if own.radius is None else Disc(home.x, home.y, own.radius.value_m - reserve_m)


def band(own: AutopilotFence, home_z_m: float, reserve_m: float = RESERVE_M) -> tuple[float, float]:
    """Returns the heights between which UAL stays, above what `home_z_m` is above."""
    lowest_m = -math.inf if own.lowest is None else home_z_m + own.lowest.value_m + reserve_m
    highest_m = math.inf if own.highest is None else home_z_m + own.highest.value_m - reserve_m
    return lowest_m, highest_m


def within_limits(fence: Fence, own: AutopilotFence, snapshot: Snapshot, reserve_m: float = RESERVE_M) -> Fence:
    """Returns the part of a fence that is inside the limits around home, with a reserve.

    Raises `WrongStateError` if it is not known where home is.
    """
    if not own.limits:
        return fence
    home = home_of(snapshot)
    if home is None:
        names = ", ".join(limit.parameter for limit in own.limits)
        raise WrongStateError(
            f"the autopilot's own fence ({names}) cannot be checked: the autopilot has not said where its home is"
        )
    return fence.narrowed(*band(own, home.z, reserve_m), disc(own, home, reserve_m))


def within_zones(fence: Fence, own: AutopilotFence, snapshot: Snapshot, reserve_m: float = RESERVE_M) -> Fence:
    """Returns the part of a fence that the zones leave, with a reserve. Takes some milliseconds.

    Raises `WrongStateError` if it is not known where on Earth the local frame is.
    """
    if not own.zones:
        return fence
    if snapshot.earth.projection is None:
        names = ", ".join(zone.name for zone in own.zones)
        raise WrongStateError(
            f"the autopilot's own fence ({names}) cannot be checked: the autopilot has not said where on Earth it is"
        )
    zones = local_zones(own.zones, snapshot.earth.projection)
    return fence.cut(zones, reserve_m, unites_inclusions=own.unites_inclusions)


def beyond_limit(point: Vector3, snapshot: Snapshot, reserve_m: float = RESERVE_M) -> Beyond | None:
    """Returns how a point lies beyond a limit around home; None if it does not."""
    own, home = snapshot.autopilot_fence, home_of(snapshot)
    if own is None or home is None:
        return None
    away_m, height_m = math.hypot(point.x - home.x, point.y - home.y), point.z - home.z
    lowest_m, highest_m = band(own, 0.0, reserve_m)
    if own.radius is not None and away_m > own.radius.value_m - reserve_m:
        return _beyond(f"{away_m:.1f} m from its home", own.radius)
    if own.highest is not None and height_m > highest_m:
        return _beyond(f"{height_m:.1f} m above its home", own.highest)
    if own.lowest is not None and height_m < lowest_m:
        return _beyond(f"{height_m:.1f} m above its home", own.lowest)
    return None


def beyond_zone(name: str) -> Beyond | None:
    """Returns that a point lies on the wrong side of the zone of this name; None for an empty name."""
    return Beyond("", name, {"zone": name}) if name else None


def text(beyond: Beyond, reserve_m: float = 0.0) -> str:
    """Returns it, human-readable: "45.0 m from its home, beyond the autopilot's own fence (...)"."""
    where = f"{beyond.where}, " if beyond.where else ""
    reserve = f"; UAL stays {reserve_m:g} m inside" if reserve_m else ""
    return f"{where}beyond the autopilot's own fence ({beyond.limit}{reserve})"


def breach_text(snapshot: Snapshot) -> str:
    """Returns that the UAV is beyond the fence, human-readable; empty if it is not, or if that is not known."""
    if snapshot.motion.pose is None:
        return ""
    point = snapshot.motion.pose.value.position
    found = beyond_limit(point, snapshot, 0.0) or _beyond_any_zone(point, snapshot)
    return "" if found is None else f"it is {text(found)}"


def _beyond_any_zone(point: Vector3, snapshot: Snapshot) -> Beyond | None:
    own = snapshot.autopilot_fence
    if own is None or snapshot.earth.projection is None:
        return None
    return beyond_zone(within_zones(Fence(()), own, snapshot, 0.0).zone_left(None, point))


def _beyond(where: str, limit: FenceLimit) -> Beyond:
    return Beyond(where, f"{limit.parameter}: {limit.value_m:g} m", {"parameter": limit.parameter})
