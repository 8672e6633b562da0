"""The fence and the rally points that the autopilot keeps and applies by itself, also while UAL is not there.

As values, from ``fence.proto``. ``make proto`` writes this file: do not edit it.
"""

from __future__ import annotations

from dataclasses import dataclass

from ual.contract._bases import FenceZoneBase
from ual.contract.rally_point import RallyPoint


@dataclass(frozen=True, slots=True)
class FenceZone(FenceZoneBase):
    """A polygon or a circle: to be kept inside (an inclusion) or outside of.

    Args:
        is_inclusion: The UAV is to be inside of it; else outside.
        points: Latitude and longitude in degrees: the corners of a polygon in order, whose last side leads back to the
            first, or the one centre of a circle.
        radius_m: Of a circle.

    """

    is_inclusion: bool
    points: tuple[tuple[float, float], ...]
    radius_m: float | None = None


@dataclass(frozen=True, slots=True)
class KeptFence:
    """Fence and rally points that an autopilot keeps.

    Args:
        zones: Its polygons and circles.
        rally_points: Where it may return to instead of its home.
        is_enabled: Whether it applies its zones. None: it does not say.
        return_point: Where ArduPilot returns to instead of home after a breach, for vehicles that do. None: it has
            none. An upload keeps it.

    """

    zones: tuple[FenceZone, ...]
    rally_points: tuple[RallyPoint, ...] = ()
    is_enabled: bool | None = None
    return_point: tuple[float, float] | None = None
