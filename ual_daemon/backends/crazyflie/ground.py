"""The ground under one Crazyflie, as far as it was seen: the height to which a landing leads."""

from __future__ import annotations

from typing import NamedTuple

from ual.geometry import Vector3

KNOWN_GROUND_RADIUS_M = 0.5
"""Farther from where it stood than this, the ground is not known: it may have flown off a table."""
LANDING_DEPTH_M = 1.5
"""Metres below the known ground to which a landing leads. It ends at the ground, by the thrust and the velocity."""


class KnownGround(NamedTuple):
    """Known ground, in the local frame. Any thread may read it."""

    position: Vector3 | None = None
    """Position at which it last stood, in this boot; None: not known."""
    z_m: float = 0.0
    """Height of the ground where it stood; 0 if that was not measured: it was switched on there."""

    @classmethod
    def standing_at(cls, position: Vector3) -> KnownGround:
        """Returns the ground of a Crazyflie that stands at a place."""
        return cls(position, position.z)

    def jumped(self, offset: Vector3) -> KnownGround:
        """Returns the ground after a jump of the estimate by an offset.

        If what tells it where it is has moved its origin, the ground has moved with it. If the estimate was wrong and
        is right now, it has not. The lower one of both counts: the motors must not stop above the ground.
        """
        return KnownGround(None, self.z_m + min(0.0, offset.z))

    def landing_z_m(self, here: Vector3) -> float:
        """Returns the height to land at: where it stood, or deeper where it is not known how low the ground is."""
        is_known = self.position is not None and (here - self.position).horizontal_norm() <= KNOWN_GROUND_RADIUS_M
        return self.z_m - (0.0 if is_known else LANDING_DEPTH_M)
