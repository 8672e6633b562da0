"""Judges whether a Crazyflie that descends stands on something, before its motors have stopped."""

from __future__ import annotations

from ual.geometry import Vector3

LIGHT_THRUST_SHARE = 0.75
"""A thrust below this part of the usual one does not carry it. On the ground it was 0.52 (the firmware's least)."""
THRUST_AVERAGE_S = 2.0
"""The time over which the usual thrust is averaged."""
TOUCH_S = 0.3
"""Seconds for which it must not fall, though its thrust does not carry it: it would be 0.7 m/s fast by then."""
REST_SPEED_M_S = 0.1
CLIMB_SPEED_M_S = 0.3
"""Faster than it bounces."""
LONGEST_VALUE_GAP_S = 0.25
"""Values that come later than this do not show what was between them."""


class GroundContact:
    """Thrust and velocity over time. Belongs to the thread that receives."""

    def __init__(self) -> None:
        self.touches = False
        """Whether it stands on something, with motors that do not carry it."""
        self._usual: float | None = None
        self._last_s = 0.0
        self._light_since_s: float | None = None
        self._has_descended = False

    def update(self, thrust: float, velocity: Vector3, now_s: float) -> None:
        """Takes new values."""
        step_s, self._last_s = now_s - self._last_s, now_s
        usual = thrust if self._usual is None else self._usual
        self._usual = usual + (thrust - usual) * min(1.0, step_s / THRUST_AVERAGE_S)
        if velocity.z < -REST_SPEED_M_S:
            self._has_descended = True
        elif velocity.z > CLIMB_SPEED_M_S:
            self._has_descended = False
        if thrust >= LIGHT_THRUST_SHARE * usual or velocity.norm() > REST_SPEED_M_S or step_s > LONGEST_VALUE_GAP_S:
            self._light_since_s = None
        elif self._light_since_s is None:
            self._light_since_s = now_s
        is_light = self._light_since_s is not None and now_s - self._light_since_s >= TOUCH_S
        self.touches = self._has_descended and is_light
