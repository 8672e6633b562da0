"""A trajectory at another place, where the estimate of the vehicle's pose has jumped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from typing_extensions import override

from ual.geometry import Vector3, wrap_angle
from ual_daemon.trajectory.motion import Motion, Trajectory


class Moved(Trajectory):
    """The same motion, with its positions moved by an offset and its headings turned by an angle."""

    def __init__(self, trajectory: Trajectory, offset: Vector3, yaw_rad: float) -> None:
        self._trajectory, self._offset, self._yaw_rad = trajectory, offset, yaw_rad
        self.duration_s, self.length_m, self.limits = trajectory.duration_s, trajectory.length_m, trajectory.limits
        self.stops_s, self.holds_s = trajectory.stops_s, trajectory.holds_s

    def moved(self, motion: Motion) -> Motion:
        """Returns a motion of the other trajectory as one of this."""
        yaw_rad = wrap_angle(motion.yaw_rad + self._yaw_rad)
        return replace(motion, position=motion.position + self._offset, yaw_rad=yaw_rad)

    @override
    def at(self, time_s: float) -> Motion:
        return self.moved(self._trajectory.at(time_s))

    @override
    def bends_s(self) -> Iterable[tuple[float, float]]:
        return self._trajectory.bends_s()

    @override
    def waypoint_at(self, time_s: float) -> int:
        return self._trajectory.waypoint_at(time_s)
