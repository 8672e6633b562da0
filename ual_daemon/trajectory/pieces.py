"""Motion made of consecutive pieces with constant jerk."""

from __future__ import annotations

import bisect

from ual.geometry import Vector3, vector3


class Pieces:
    """A motion whose position, velocity and acceleration are continuous, and whose jerk is constant in each piece.

    `add` appends a piece at the end. After the last piece, it keeps the state of that piece's end.
    """

    def __init__(self, position: Vector3, velocity: Vector3, acceleration: Vector3) -> None:
        self.position, self.velocity, self.acceleration = position, velocity, acceleration  # at the end so far
        self.duration_s = 0.0
        self._times: list[float] = []
        self._rows: list[tuple[Vector3, Vector3, Vector3, Vector3]] = []

    def add(self, duration_s: float, jerk: Vector3) -> None:
        """Appends a piece."""
        if duration_s <= 0.0:
            return
        row = (self.position, self.velocity, self.acceleration, jerk)
        self._times.append(self.duration_s)
        self._rows.append(row)
        self.position, self.velocity, self.acceleration = _moved(row, duration_s)
        self.duration_s += duration_s

    def settle(self, position: Vector3, velocity: Vector3) -> None:
        """Sets the exact position and velocity of the last piece's end, without acceleration. This removes the rounding
        errors that have added up.
        """
        self.position, self.velocity, self.acceleration = position, velocity, Vector3()

    def at(self, time_s: float) -> tuple[Vector3, Vector3, Vector3]:
        """Returns position, velocity and acceleration at a time; before the start those of the start, after the end
        those of the end.
        """
        if not self._rows or time_s >= self.duration_s:
            return self.position, self.velocity, self.acceleration
        time_s = max(0.0, time_s)
        index = bisect.bisect_right(self._times, time_s) - 1
        return _moved(self._rows[index], time_s - self._times[index])


def _moved(row: tuple[Vector3, Vector3, Vector3, Vector3], t: float) -> tuple[Vector3, Vector3, Vector3]:
    p, v, a, j = row
    t2, t3 = t * t / 2, t * t * t / 6
    return (
        vector3(
            p.x + v.x * t + a.x * t2 + j.x * t3,
            p.y + v.y * t + a.y * t2 + j.y * t3,
            p.z + v.z * t + a.z * t2 + j.z * t3,
        ),
        vector3(v.x + a.x * t + j.x * t2, v.y + a.y * t + j.y * t2, v.z + a.z * t + j.z * t2),
        vector3(a.x + j.x * t, a.y + j.y * t, a.z + j.z * t),
    )
