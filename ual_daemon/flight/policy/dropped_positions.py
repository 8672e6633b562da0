"""Positions that the autopilot would drop because they lie beyond its own fence."""

from __future__ import annotations

import math

from ual.errors import WrongStateError
from ual.geometry import Vector3
from ual_daemon.backends.values import AutopilotFence, Snapshot
from ual_daemon.flight.policy import autopilot_fence
from ual_daemon.frames.fence import Fence

_FENCE_MARGIN_M = 0.5
"""A position this near to the edge may lie beyond it for the autopilot: home and its own rounding differ a little. What
is inside of UAL's own reserve never comes that near."""


class DroppedPositions:
    """Judges positions by the autopilot's own fence. Any thread may call.

    A setpoint costs a comparison and a distance while it stays within the clearance of an earlier one.
    """

    def __init__(self) -> None:
        self._made: tuple[object, Fence] | None = None
        self._clear: tuple[Fence | None, Vector3, float] = (None, Vector3(), 0.0)
        """A fence, a position inside, and how far from there everything is inside."""

    def has(self, position: Vector3, snapshot: Snapshot) -> bool:
        """Returns whether the autopilot would drop a position. No where it is not known where the fence lies."""
        own = snapshot.autopilot_fence
        if own is None:
            return False
        try:
            fence = self._fence(own, snapshot)
        except WrongStateError:
            return False
        clear_in, centre, clear_m = self._clear
        if fence is clear_in and math.dist(centre, position) < clear_m:
            return False
        clear_m = fence.clearance_m(position)
        self._clear = (fence, position, clear_m)
        return clear_m == 0.0 and not fence.is_inside(position)

    def _fence(self, own: AutopilotFence, snapshot: Snapshot) -> Fence:
        key = (own, snapshot.earth.projection, snapshot.earth.home_geo, snapshot.earth.home_altitude_amsl_m)
        made = self._made
        if made is None or made[0] != key:
            fence = autopilot_fence.within_zones(Fence(()), own, snapshot, _FENCE_MARGIN_M)
            made = self._made = (key, autopilot_fence.within_limits(fence, own, snapshot, _FENCE_MARGIN_M))
        return made[1]
