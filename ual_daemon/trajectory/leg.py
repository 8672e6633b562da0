"""A straight leg from one speed to another, with the corner at its end."""

from __future__ import annotations

from ual.geometry import Vector3, vector3
from ual.shared.immutable import immutable
from ual_daemon.trajectory.pulse import Pulse, change_m

_ZERO = Vector3()


@immutable
class Leg:
    """Changes the speed along a direction to a peak, keeps it, and changes it to the speed at the end. Then the
    velocity changes by a pulse to that of the next leg. The acceleration is 0 in between.
    """

    begin: Vector3
    direction: Vector3
    before_m_s: float
    peak_m_s: float
    after_m_s: float
    up: Pulse
    cruise_s: float
    down: Pulse
    corner: Pulse
    next_direction: Vector3
    up_s: float
    """The duration of `up`. A value, as each update asks; so are those that follow."""
    up_m: float
    """The length of `up`."""
    straight_s: float
    """The duration of the straight part."""
    cruise: Vector3
    """The velocity between `up` and `down`."""

    @classmethod
    def along(
        cls,
        begin: Vector3,
        direction: Vector3,
        path_m: float,
        speeds_m_s: tuple[float, float, float],
        acceleration_m_s2: float,
        corner: Pulse | None = None,
        next_direction: Vector3 | None = None,
    ) -> Leg:
        """Plans a leg whose straight part is `path_m` long, with the speeds before, on, and after it."""
        before, peak, after = speeds_m_s
        ramps_m = change_m(before, peak, acceleration_m_s2) + change_m(peak, after, acceleration_m_s2)
        up = Pulse.shortest(abs(peak - before), acceleration_m_s2)
        down = Pulse.shortest(abs(peak - after), acceleration_m_s2)
        cruise_s = max(0.0, path_m - ramps_m) / peak if peak > 0.0 else 0.0
        return cls(
            begin,
            direction,
            before,
            peak,
            after,
            up,
            cruise_s,
            down,
            corner or Pulse(),
            next_direction or direction,
            up.duration_s,
            (before + peak) / 2 * up.duration_s,
            up.duration_s + cruise_s + down.duration_s,
            direction * peak,
        )

    @property
    def duration_s(self) -> float:
        """The duration, including the corner."""
        return self.straight_s + self.corner.duration_s

    def along_m(self, time_s: float) -> float:
        """The length of the straight part."""
        return self._along(min(time_s, self.straight_s))[0]

    def at(self, time_s: float) -> tuple[Vector3, Vector3, Vector3]:
        """Returns position, velocity and acceleration at a time from 0 to the duration."""
        straight_s = self.straight_s
        d, p, cruising_s = self.direction, self.begin, time_s - self.up_s
        if 0.0 <= cruising_s < self.cruise_s:  # most of the time
            s = self.up_m + self.peak_m_s * cruising_s
            return vector3(p.x + d.x * s, p.y + d.y * s, p.z + d.z * s), self.cruise, _ZERO
        s, v, a = self._along(min(time_s, straight_s))
        position = vector3(p.x + d.x * s, p.y + d.y * s, p.z + d.z * s)
        if time_s <= straight_s:
            return position, vector3(d.x * v, d.y * v, d.z * v), vector3(d.x * a, d.y * a, d.z * a)
        t = time_s - straight_s
        path, speed, acceleration = self.corner.at(t)
        v = self.after_m_s
        change, onward = (self.next_direction - d) * v, d * v
        return position + onward * t + change * path, onward + change * speed, change * acceleration

    def _along(self, t: float) -> tuple[float, float, float]:
        """Returns distance, speed and acceleration on the straight part."""
        before, peak = self.before_m_s, self.peak_m_s
        up_s = self.up_s
        if t < up_s:
            path, speed, acceleration = self.up.at(t)
            change = peak - before
            return before * t + change * path, before + change * speed, change * acceleration
        begun_m = self.up_m
        t -= up_s
        if t < self.cruise_s:
            return begun_m + peak * t, peak, 0.0
        begun_m += peak * self.cruise_s
        t -= self.cruise_s
        path, speed, acceleration = self.down.at(t)
        change = self.after_m_s - peak
        return begun_m + peak * t + change * path, peak + change * speed, change * acceleration
