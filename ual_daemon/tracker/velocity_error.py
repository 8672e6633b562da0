"""The error of the autopilot's velocity, learned from its own estimates."""

from __future__ import annotations

import math

from ual.geometry import Vector3, vector3

_ERROR_SMOOTHING_S = 0.3
_LONGEST_SAMPLE_GAP_S = 0.2
"""Nothing is learned over a longer gap."""


class VelocityError:
    """The estimated velocity minus the velocity of the estimated position, through a low pass.

    They differ where an estimator corrects its position: the autopilot then flies a velocity that is not the one of its
    own position. Learned from the estimates alone, so adding it to a command closes no loop.
    """

    def __init__(self) -> None:
        self.value = Vector3()
        """The error, m/s."""
        self._last: tuple[float, Vector3, Vector3] | None = None
        """Time of the last estimates, and these: position and velocity."""

    def step(self, time_s: float, position: Vector3, velocity: Vector3) -> Vector3:
        """Makes one update. Returns the error, m/s. In plain numbers, as each update passes here."""
        last, self._last = self._last, (time_s, position, velocity)
        if last is None or not 0.0 < time_s - last[0] <= _LONGEST_SAMPLE_GAP_S:
            return self.value
        passed_s, p, v, old = time_s - last[0], last[1], last[2], self.value
        share = 1.0 - math.exp(-passed_s / _ERROR_SMOOTHING_S)
        x = (velocity.x + v.x) / 2 - (position.x - p.x) / passed_s
        y = (velocity.y + v.y) / 2 - (position.y - p.y) / passed_s
        z = (velocity.z + v.z) / 2 - (position.z - p.z) / passed_s
        self.value = vector3(old.x + (x - old.x) * share, old.y + (y - old.y) * share, old.z + (z - old.z) * share)
        return self.value
