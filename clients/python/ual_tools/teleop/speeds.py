"""The speed levels: what a full deflection means, and the step of the pose mode."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ual.geometry import Twist, Vector3
from ual.types import Limits
from ual_tools.teleop.sticks import Sticks


@dataclass(frozen=True, slots=True)
class SpeedLevel:
    """Speeds at full deflection, and lengths of one step of the pose mode."""

    horizontal_m_s: float
    vertical_m_s: float
    turn_deg_s: float
    step_m: float
    turn_step_deg: float

    def within(self, limits: Limits) -> SpeedLevel:
        """Returns the level within the UAV's limits, each axis by itself.

        Otherwise the daemon would scale a velocity as a whole, and climbing would slow down the forward flight.
        """
        return SpeedLevel(
            min(self.horizontal_m_s, limits.horizontal_speed_m_s),
            min(self.vertical_m_s, limits.climb_speed_m_s, limits.descent_speed_m_s),
            min(self.turn_deg_s, math.degrees(limits.yaw_rate_rad_s)),
            self.step_m,
            self.turn_step_deg,
        )

    def twist(self, sticks: Sticks) -> Twist:
        """Returns the velocity of a deflection: x forward, y left. A diagonal is not faster than straight on."""
        horizontal = self.horizontal_m_s / max(1.0, math.hypot(sticks.forward, sticks.left))
        linear = Vector3(sticks.forward * horizontal, sticks.left * horizontal, sticks.up * self.vertical_m_s)
        return Twist(linear, Vector3(0.0, 0.0, sticks.turn * math.radians(self.turn_deg_s)))

    def step(self, sticks: Sticks) -> tuple[Vector3, float]:
        """Returns the step of the reference for the deflected axes: x forward, y left; and of the heading (rad)."""
        step = Vector3(sticks.forward, sticks.left, sticks.up) * self.step_m
        return step, sticks.turn * math.radians(self.turn_step_deg)


LEVELS = (
    SpeedLevel(0.25, 0.25, 10.0, 0.1, 5.0),
    SpeedLevel(0.5, 0.5, 20.0, 0.25, 10.0),
    SpeedLevel(1.0, 0.75, 30.0, 0.5, 15.0),
    SpeedLevel(2.0, 1.0, 45.0, 0.75, 30.0),
    SpeedLevel(4.0, 2.0, 60.0, 1.0, 45.0),
)
FIRST_SPEED_LEVEL = 1
"""Half a metre a second: slow enough to surprise no pilot."""
