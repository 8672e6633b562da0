"""A point mass that turns and tilts, and the cascade of controllers that flies it. Axes are north, east, down."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field, replace

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)
GRAVITY_M_S2 = 9.80665
_ATTITUDE_S = 0.06
"""The time constant with which the attitude, and so the acceleration, follows the controller."""
_YAW_ACCELERATION_RAD_S2 = 6.0
_WANDER_VELOCITY_S, _WANDER_POSITION_S = 4.0, 40.0


def wrap(angle_rad: float) -> float:
    """Returns the same angle between -pi and pi."""
    return math.remainder(angle_rad, math.tau)


def plus(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def minus(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def clamp(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


@dataclass(frozen=True, slots=True)
class Target:
    """A target. An axis without a position (None) is controlled by velocity only; without `yaw_rad`, by the yaw rate.

    `velocity` and `acceleration` are fed forward.
    """

    position: tuple[float | None, float | None, float | None] = (None, None, None)
    velocity: Vector = ZERO
    acceleration: Vector = ZERO
    yaw_rad: float | None = None
    yaw_rate_rad_s: float = 0.0

    def moved(self, offset: Vector) -> Target:
        """Returns the target in a frame in which everything is by an offset elsewhere."""
        north, east, down = (None if p is None else p + o for p, o in zip(self.position, offset, strict=True))
        return replace(self, position=(north, east, down))


@dataclass(frozen=True, slots=True)
class Agility:
    """Gains (1/s) and limits of the position controller, in SI units."""

    position_gain: float
    height_gain: float
    velocity_gain: float
    vertical_gain: float
    speed_m_s: float
    climb_m_s: float
    descent_m_s: float
    acceleration_m_s2: float
    vertical_acceleration_m_s2: float
    jerk_m_s3: float
    yaw_gain: float
    yaw_rate_rad_s: float


@dataclass(slots=True)
class Body:
    """Position and motion of the vehicle, on a flat ground at height `ground_z_m`."""

    position: Vector = ZERO
    velocity: Vector = ZERO
    acceleration: Vector = ZERO
    yaw_rad: float = 0.0
    yaw_rate_rad_s: float = 0.0
    ground_z_m: float = 0.0
    is_on_ground: bool = True

    def stand(self) -> None:
        """Puts it on the ground, at rest."""
        self.position = (self.position[0], self.position[1], self.ground_z_m)
        self.velocity = self.acceleration = ZERO
        self.yaw_rate_rad_s = 0.0
        self.is_on_ground = True

    def fall(self, step_s: float) -> None:
        """Moves it by one step with stopped motors."""
        if not self.is_on_ground:
            self.acceleration = (0.0, 0.0, GRAVITY_M_S2)
            self._move(step_s)

    def fly(self, acceleration: Vector, yaw_rate_rad_s: float, jerk_m_s3: float, step_s: float) -> None:
        """Moves it by one step with motors, which follow the wanted acceleration with a lag."""
        limit = jerk_m_s3 * step_s
        north, east, down = self.acceleration
        self.acceleration = (
            north + clamp((acceleration[0] - north) * step_s / _ATTITUDE_S, -limit, limit),
            east + clamp((acceleration[1] - east) * step_s / _ATTITUDE_S, -limit, limit),
            down + clamp((acceleration[2] - down) * step_s / _ATTITUDE_S, -limit, limit),
        )
        limit = _YAW_ACCELERATION_RAD_S2 * step_s
        self.yaw_rate_rad_s += clamp(yaw_rate_rad_s - self.yaw_rate_rad_s, -limit, limit)
        self.yaw_rad = wrap(self.yaw_rad + self.yaw_rate_rad_s * step_s)
        self._move(step_s)

    def _move(self, step_s: float) -> None:
        vx, vy, vz = self.velocity
        ax, ay, az = self.acceleration
        vx, vy, vz = vx + ax * step_s, vy + ay * step_s, vz + az * step_s
        x, y, z = self.position
        self.velocity = (vx, vy, vz)
        self.position = (x + vx * step_s, y + vy * step_s, z + vz * step_s)
        self.is_on_ground = False
        if self.position[2] >= self.ground_z_m and vz >= 0.0:
            self.stand()

    @property
    def tilt(self) -> tuple[float, float]:
        """Returns the roll and pitch that this acceleration needs."""
        north, east, down = self.acceleration
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        lift = max(GRAVITY_M_S2 - down, 1.0)
        return math.atan2(east * cos - north * sin, lift), -math.atan2(north * cos + east * sin, lift)


@dataclass(slots=True)
class Wander:
    """The error of the estimate: it drifts smoothly, by about `sigma_m` on each axis."""

    sigma_m: float
    noise: random.Random
    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    velocity: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])

    def step(self, step_s: float) -> None:
        """Advances by one step."""
        if not self.sigma_m:
            return
        speed = self.sigma_m / math.sqrt(_WANDER_VELOCITY_S * _WANDER_POSITION_S)
        kick = speed * math.sqrt(2.0 * step_s / _WANDER_VELOCITY_S)
        for axis in range(3):
            drift = self.velocity[axis]
            self.velocity[axis] += -drift * step_s / _WANDER_VELOCITY_S + kick * self.noise.gauss(0.0, 1.0)
            self.position[axis] += (drift - self.position[axis] / _WANDER_POSITION_S) * step_s


def control(
    agility: Agility, target: Target, position: Vector, velocity: Vector, yaw_rad: float
) -> tuple[Vector, float]:
    """Returns the acceleration and yaw rate that fly to a target, from the estimated position and velocity."""
    wanted = list(target.velocity)
    for axis, gain in enumerate((agility.position_gain, agility.position_gain, agility.height_gain)):
        goal = target.position[axis]
        if goal is not None:
            wanted[axis] += gain * (goal - position[axis])
    scale = min(1.0, agility.speed_m_s / max(math.hypot(wanted[0], wanted[1]), 1e-9))
    wanted[0] *= scale
    wanted[1] *= scale
    wanted[2] = clamp(wanted[2], -agility.climb_m_s, agility.descent_m_s)
    north = target.acceleration[0] + agility.velocity_gain * (wanted[0] - velocity[0])
    east = target.acceleration[1] + agility.velocity_gain * (wanted[1] - velocity[1])
    scale = min(1.0, agility.acceleration_m_s2 / max(math.hypot(north, east), 1e-9))
    limit = agility.vertical_acceleration_m_s2
    down = clamp(target.acceleration[2] + agility.vertical_gain * (wanted[2] - velocity[2]), -limit, limit)
    yaw_rate = target.yaw_rate_rad_s
    if target.yaw_rad is not None:
        yaw_rate += agility.yaw_gain * wrap(target.yaw_rad - yaw_rad)
    return (north * scale, east * scale, down), clamp(yaw_rate, -agility.yaw_rate_rad_s, agility.yaw_rate_rad_s)
