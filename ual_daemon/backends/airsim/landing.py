"""A landing of our own: straight down until it stands, then disarmed.

The simulator's ``land`` waits for a vertical speed near zero: it took 52 s for 5.4 m, and once ended at 2 m.
"""

from __future__ import annotations

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.backends.values import VelocitySetpoint

TOUCH_DOWN_M_S = 0.5
_SLOW_BELOW_M = 2.0
_POSITION_PER_S = 0.8
_ASIDE_M_S = 1.0


class Landing:
    """Leads one vehicle down. `ground_z_m` is where it last stood, in its local frame."""

    def __init__(self, place: Vector3, ground_z_m: float, limits: Limits) -> None:
        self._place = place
        self._ground_z_m = ground_z_m
        self._fastest_m_s = limits.descent_speed_m_s
        self.is_disarming = False

    def setpoint(self, position: Vector3) -> VelocitySetpoint:
        """Returns the velocity: down, slower near the ground, and back over the place."""
        height_m = position.z - self._ground_z_m
        speed_m_s = min(self._fastest_m_s, TOUCH_DOWN_M_S) if height_m < _SLOW_BELOW_M else self._fastest_m_s
        back = (self._place - position) * _POSITION_PER_S
        scale = min(1.0, _ASIDE_M_S / max(back.horizontal_norm(), 1e-9))
        return VelocitySetpoint(Vector3(back.x * scale, back.y * scale, -speed_m_s))
