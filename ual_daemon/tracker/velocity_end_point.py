"""The place to which a velocity leads, in some of the axes: the horizontal ones, or the vertical one."""

from __future__ import annotations

import math
from typing import NamedTuple

from ual.geometry import Vector3, vector3
from ual_daemon.backends.values import VelocityResponse

MOST_LAG_M = 1.0
"""The place is never farther from the UAV than this."""
MOST_CORRECTION_M_S = 1.2
"""The most that is added: twice what the estimate was seen to be wrong by."""
MOST_CHANGE_M_S2 = 2.0
"""Fastest change of the correction, in m/s², so that it does not jump."""
_POSITION_GAIN = 0.9
"""From a distance to a velocity, 1/s; PX4's own is 0.95 (MPC_XY_P), ArduPilot's 1 (PSC_POSXY_P)."""
_MOST_VELOCITY_ERROR_M_S = 0.7
_LEAST_SPEED_M_S = 0.1
"""The commanded velocity counts as flown within this, or within half of it."""
_CARRIED_SPEED_M_S = 1.0
"""Difference in m/s from the expected velocity, other than by being slower, at which a UAV is carried away."""
_BEHIND_S, _LEAST_BEHIND_M = 1.0, 0.5
"""Lag at which a UAV that makes less than half of its speed is stopped by something. This is in seconds of its speed,
or the distance if that is more, `MOST_LAG_M` at most.
"""
_INTEGRATION_STEP_S = 0.03


class ExpectedMotion:
    """Expected motion of the vehicle: it answers to the commanded velocity according to `VelocityResponse`."""

    def __init__(self, position: Vector3, velocity: Vector3, acceleration: Vector3, response: VelocityResponse) -> None:
        self.position, self.velocity = position, velocity
        a, followed = acceleration, velocity + acceleration * response.time_s
        self._acceleration = a.x, a.y, a.z
        self._followed = followed.x, followed.y, followed.z
        """The commanded velocity through the low pass of the delay."""

    def advance(self, commanded: Vector3, passed_s: float, response: VelocityResponse) -> None:
        """Lets time pass. In plain numbers, as each update passes here."""
        count = math.ceil(passed_s / _INTEGRATION_STEP_S)
        if not count:
            return
        v, p, step_s = self.velocity, self.position, passed_s / count
        cx, cy, cz = commanded.x, commanded.y, commanded.z
        (hx, hy, hz), vx, vy, vz = self._followed, v.x, v.y, v.z
        (ax, ay, az), px, py, pz = self._acceleration, p.x, p.y, p.z
        share, risen = _share(step_s, response.delay_s), _share(step_s, response.rise_s)
        time_s, half_s = max(response.time_s, step_s), step_s * step_s / 2
        most_a, most_j = response.acceleration_m_s2, response.jerk_m_s3 * step_s
        for _ in range(count):
            hx, hy, hz = hx + (cx - hx) * share, hy + (cy - hy) * share, hz + (cz - hz) * share
            wx, wy, wz = (hx - vx) / time_s, (hy - vy) / time_s, (hz - vz) / time_s
            size = math.hypot(wx, wy, wz)
            part = most_a / size if size > most_a else 1.0
            jx, jy, jz = (wx * part - ax) * risen, (wy * part - ay) * risen, (wz * part - az) * risen
            size = math.hypot(jx, jy, jz)
            part = most_j / size if size > most_j else 1.0
            ax, ay, az = ax + jx * part, ay + jy * part, az + jz * part
            px, py, pz = px + vx * step_s + ax * half_s, py + vy * step_s + ay * half_s, pz + vz * step_s + az * half_s
            vx, vy, vz = vx + ax * step_s, vy + ay * step_s, vz + az * step_s
        self._followed, self._acceleration = (hx, hy, hz), (ax, ay, az)
        self.position, self.velocity = vector3(px, py, pz), vector3(vx, vy, vz)

    def follow(self, velocity: Vector3, direction: Vector3) -> None:
        """Takes the part of a velocity along a direction as its own."""
        followed, acceleration = Vector3(*self._followed), Vector3(*self._acceleration)
        self.velocity += direction * (velocity - self.velocity).dot(direction)
        followed += direction * (velocity - followed).dot(direction)
        acceleration -= direction * acceleration.dot(direction)
        self._followed = followed.x, followed.y, followed.z
        self._acceleration = acceleration.x, acceleration.y, acceleration.z


class MotionEstimate(NamedTuple):
    """Estimate of the UAV now: its position, its velocity, and the error of that velocity."""

    position: Vector3
    velocity: Vector3
    error: Vector3


class VelocityEndPoint:
    """The place to which a velocity leads. All vectors are zero along the axes that are not its own."""

    def __init__(self, expected: ExpectedMotion) -> None:
        self.correction: Vector3 | None = None
        """Correction to add to the commanded velocity; None before the first update."""
        self._expected = expected
        self._free: tuple[Vector3, ...] = ()
        """The directions in which the place goes with the UAV; of length 1, at right angles to each other."""

    def step(
        self, commanded: Vector3, measured: MotionEstimate, passed_s: float, response: VelocityResponse
    ) -> Vector3:
        """Makes one update. Returns what is to be added to the commanded velocity.

        In plain numbers, as each update passes here.
        """
        (here, velocity, error), expected = measured, self._expected
        expected.advance(commanded, passed_s, response)
        if self._free or self._may_not_follow(commanded, velocity, error):
            self._find_free(commanded, here, velocity - error)
        p = expected.position
        x, y, z = p.x - here.x, p.y - here.y, p.z - here.z
        if self._free:
            x, y, z = self._held(vector3(x, y, z))
        x, y, z = _cut(x, y, z, MOST_LAG_M)
        expected.position = vector3(here.x + x, here.y + y, here.z + z)
        x, y, z = x * _POSITION_GAIN, y * _POSITION_GAIN, z * _POSITION_GAIN
        if not response.holds_place:
            ex, ey, ez = _cut(error.x, error.y, error.z, _MOST_VELOCITY_ERROR_M_S)
            x, y, z = x + ex, y + ey, z + ez
        x, y, z = _cut(x, y, z, MOST_CORRECTION_M_S)
        if (before := self.correction) is not None:
            bx, by, bz = before.x, before.y, before.z
            x, y, z = _cut(x - bx, y - by, z - bz, MOST_CHANGE_M_S2 * passed_s)
            x, y, z = bx + x, by + y, bz + z
        new = self.correction = vector3(x, y, z)
        return new

    def _may_not_follow(self, c: Vector3, v: Vector3, error: Vector3) -> bool:
        """Returns whether something may carry or stop the UAV: seldom, and then the directions are looked for."""
        x, y, z, u = v.x - error.x, v.y - error.y, v.z - error.z, self._expected.velocity
        is_carried = math.hypot(x - u.x, y - u.y, z - u.z) > _CARRIED_SPEED_M_S
        return is_carried or self._missed_m_s(c, x, y, z) is not None

    def _find_free(self, commanded: Vector3, here: Vector3, actual: Vector3) -> None:
        """Finds the directions in which the UAV cannot follow. `actual` is how its position moves."""
        if self._free:
            self._free = tuple(each for each in self._free if not _is_followed(commanded.dot(each), actual.dot(each)))
        if self._is_stopped(commanded, here, actual):
            self._make_free(commanded)
        carried = actual - self._expected.velocity
        if carried.norm() > _CARRIED_SPEED_M_S:
            carried = self._held(_without_slower(carried, self._expected.velocity))
            if carried.norm() > _CARRIED_SPEED_M_S:
                self._make_free(carried)
        for direction in self._free:
            self._expected.follow(actual, direction)

    def _is_stopped(self, commanded: Vector3, here: Vector3, actual: Vector3) -> bool:
        """Returns whether something stops it: it is behind, and makes less than half of the commanded speed."""
        missed_m_s = self._missed_m_s(commanded, actual.x, actual.y, actual.z)
        if missed_m_s is None:
            return False
        behind_m = min(MOST_LAG_M, max(_LEAST_BEHIND_M, missed_m_s * _BEHIND_S))
        return self._held(self._expected.position - here).dot(commanded) / commanded.norm() >= behind_m

    def _missed_m_s(self, c: Vector3, x: float, y: float, z: float) -> float | None:
        """Returns the expected speed along the command `c` where (x, y, z) makes less than half of it; else None."""
        wanted_m_s = math.hypot(c.x, c.y, c.z)
        if wanted_m_s <= _LEAST_SPEED_M_S:
            return None
        u = self._expected.velocity
        speed_m_s = min(wanted_m_s, (u.x * c.x + u.y * c.y + u.z * c.z) / wanted_m_s)
        return speed_m_s if (x * c.x + y * c.y + z * c.z) / wanted_m_s < speed_m_s / 2 else None

    def _make_free(self, along: Vector3) -> None:
        rest = self._held(along)
        rest_norm = rest.norm()
        if rest_norm > _LEAST_SPEED_M_S / 2:
            self._free = (*self._free, rest / rest_norm)

    def _held(self, vector: Vector3) -> Vector3:
        """Returns the part of a vector in the directions in which the place is held."""
        for direction in self._free:
            vector -= direction * vector.dot(direction)
        return vector


def _is_followed(commanded_m_s: float, measured_m_s: float) -> bool:
    return abs(commanded_m_s - measured_m_s) <= max(_LEAST_SPEED_M_S, abs(commanded_m_s) / 2)


def _without_slower(change: Vector3, velocity: Vector3) -> Vector3:
    """Returns a change of a velocity without what only makes it slower."""
    square = velocity.dot(velocity)
    return change - velocity * min(0.0, change.dot(velocity) / square) if square > 0.0 else change


def _share(passed_s: float, time_constant_s: float) -> float:
    """Returns the part of a step that a low pass has followed."""
    return 1.0 - math.exp(-passed_s / time_constant_s) if time_constant_s > 0.0 else 1.0


def _cut(x: float, y: float, z: float, length: float) -> tuple[float, float, float]:
    """Returns the components of a vector, or those of one of this length in its direction."""
    own = math.hypot(x, y, z)
    if own <= length:
        return x, y, z
    factor = length / own
    return x * factor, y * factor, z * factor
