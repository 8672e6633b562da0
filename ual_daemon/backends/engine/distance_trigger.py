"""Says when a picture by distance is due. Pure logic."""

from __future__ import annotations

from ual.geometry import Vector3


class DistanceTrigger:
    """Counts pictures by the distance from the place of the last one, m. The first is due at once.

    The next one counts from where the last one should have been, and not from where that was seen. So what a step is
    longer than the distance does not add up. A hover never triggers while its estimate wanders within the distance.
    """

    def __init__(self, distance_m: float) -> None:
        self._distance_m = distance_m
        self._last: Vector3 | None = None

    def due_count(self, position: Vector3) -> int:
        """Takes a position. Returns how many pictures were due since the last call: over 1 where steps are too long."""
        if self._last is None:
            self._last = position
            return 1
        moved = position - self._last
        count = int(moved.norm() / self._distance_m)
        if count:
            self._last += moved * (count * self._distance_m / moved.norm())
        return count
