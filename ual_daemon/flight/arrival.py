"""When a UAV counts as arrived."""

from __future__ import annotations

import math
from collections import deque

from ual.geometry import Vector3, wrap_angle
from ual_daemon.backends.values import Snapshot
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.references import measured_motion


class Arrival:
    """Judges arrival: within tolerance, and slow, on the mean of a while: an estimate is noisy, and a moment's luck (or
    bad luck) shall not count.
    """

    def __init__(self, position: Vector3, yaw_rad: float, tolerance: ToleranceSettings) -> None:
        self._position, self._yaw_rad, self._tolerance = position, yaw_rad, tolerance
        self._seen: deque[tuple[float, Vector3, float, Vector3]] = deque()  # time, and how far off: place, turn, speed

    def look(self, snapshot: Snapshot) -> None:
        """Takes in where the UAV is; to be told at each update."""
        motion = measured_motion(snapshot)
        turn = wrap_angle(motion.yaw_rad - self._yaw_rad)
        self._seen.append((snapshot.time_s, motion.position - self._position, turn, motion.velocity))
        # One that is older than the while stays: so the others span it.
        while len(self._seen) > 1 and snapshot.time_s - self._seen[1][0] >= self._tolerance.dwell_s:
            self._seen.popleft()

    def has_arrived(self, snapshot: Snapshot) -> bool:
        """Whether it is there."""
        if not self._seen or snapshot.time_s - self._seen[0][0] < self._tolerance.dwell_s:
            return False
        place, turn, velocity = self._mean()
        tolerance = self._tolerance
        return (
            place.norm() <= tolerance.position_m
            and abs(turn) <= tolerance.heading_rad
            and velocity.norm() <= tolerance.speed_m_s
        )

    def _mean(self) -> tuple[Vector3, float, Vector3]:
        place, velocity, count = Vector3(), Vector3(), len(self._seen)
        sine = cosine = 0.0  # half a turn off, one way or the other, is no turn on the mean of the angles
        for _, offset, turned, speed in self._seen:
            place, velocity = place + offset, velocity + speed
            sine, cosine = sine + math.sin(turned), cosine + math.cos(turned)
        return place / count, math.atan2(sine, cosine), velocity / count

    def gap(self) -> str:
        """How far it is off, for people."""
        place, turn, velocity = self._mean()
        return f"{place.norm():.2f} m and {abs(turn):.2f} rad off, at {velocity.norm():.2f} m/s"
