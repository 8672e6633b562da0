"""Says when obstacle avoidance probably brakes the aircraft: it does not follow its setpoints towards an obstacle."""

from __future__ import annotations

import math

from ual.geometry import Vector3

_OBSTACLE_M = 8.0
_LEAST_WANTED_SPEED_M_S = 0.5
_BRAKED_SPEED_SHARE = 0.4
_BRAKING_TIME_S = 1.0
_DIRECTIONS = {"front": 0.0, "left": 0.5 * math.pi, "back": math.pi, "right": -0.5 * math.pi}


class ObstacleWatch:
    """Compares what is commanded with what is flown, and asks which obstacle lies in that direction."""

    def __init__(self) -> None:
        self.distances_m: dict[str, float] = {}
        """Horizontal distances that the aircraft measures, by direction of the body; only sensors that work."""
        self._since_s: float | None = None

    def observe(self, wanted: Vector3, velocity: Vector3, yaw_rad: float, now_s: float) -> str:
        """Returns what brakes it, human-readable; empty if nothing seems to."""
        speed = wanted.horizontal_norm()
        along = (wanted.x * velocity.x + wanted.y * velocity.y) / speed if speed > _LEAST_WANTED_SPEED_M_S else math.inf
        if along > _BRAKED_SPEED_SHARE * speed:
            self._since_s = None
            return ""
        if self._since_s is None:
            self._since_s = now_s
        if now_s - self._since_s < _BRAKING_TIME_S:
            return ""
        return self._obstacle(math.atan2(wanted.y, wanted.x) - yaw_rad)

    def _obstacle(self, bearing_rad: float) -> str:
        """Returns the obstacle in a direction of the body."""
        for name, direction in _DIRECTIONS.items():
            distance_m = self.distances_m.get(name, math.inf)
            if abs(math.remainder(bearing_rad - direction, math.tau)) <= 0.3 * math.pi and distance_m < _OBSTACLE_M:
                return f"obstacle avoidance brakes: an obstacle {distance_m:.1f} m to the {name}"
        return ""
