"""The limits of a motion as sets of velocities, accelerations and jerks.

A velocity is allowed if its horizontal part is within the horizontal limit and its vertical part is within the limit of
climb or descent. The same holds for an acceleration. Each set is convex and contains 0. So all velocities
(accelerations, jerks) between two allowed ones are allowed. The plans of this package need no other property.

The jerk limit is such that the acceleration can rise from 0 to its limit within `RAMP_S`: horizontally
``horizontal_acceleration_m_s2 / RAMP_S``, vertically ``vertical_acceleration_m_s2 / RAMP_S``. The heading has the rate
limit ``yaw_rate_rad_s``; its acceleration limit is ``yaw_rate_rad_s / TURN_RAMP_S``, and its jerk limit is the
acceleration limit divided by `TURN_JERK_RAMP_S`.
"""

from __future__ import annotations

import math

from ual.geometry import Vector3
from ual.types import Limits

RAMP_S = 0.4
"""The time in which the acceleration rises to its limit; this sets the jerk limit. PX4's default (MPC_JERK_AUTO 4 m/s^3
for MPC_ACC_HOR 3 m/s^2) is 0.75; a multirotor tilts to its limit within 0.3 s.
"""
TURN_RAMP_S = 0.5
"""The time in which a turn reaches its full rate, with full acceleration."""
TURN_JERK_RAMP_S = 0.25
"""The time in which the acceleration of a turn rises to its limit."""


_ROUNDING, _AT_LIMIT = 1e-9, 1e-6


def speed_limit(direction: Vector3, limits: Limits) -> float:
    """Returns the largest speed along a unit vector, m/s, within both the horizontal and the vertical limit."""
    vertical = limits.climb_speed_m_s if direction.z > 0 else limits.descent_speed_m_s
    return _along(direction, limits.horizontal_speed_m_s, vertical)


def acceleration_limit(direction: Vector3, limits: Limits) -> float:
    """Returns the largest acceleration along a unit vector, m/s^2; see `speed_limit`. Divided by `RAMP_S` this is the
    largest jerk.
    """
    return _along(direction, limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2)


def speed_share(velocity: Vector3, limits: Limits) -> float:
    """Returns a velocity as a share of the limits: it is allowed up to 1."""
    vertical = limits.climb_speed_m_s if velocity.z > 0 else limits.descent_speed_m_s
    return max(math.hypot(velocity.x, velocity.y) / limits.horizontal_speed_m_s, abs(velocity.z) / vertical)


def acceleration_share(acceleration: Vector3, limits: Limits) -> float:
    """Returns an acceleration as a share of the limits. Of a jerk, times `RAMP_S` this is its share."""
    return max(
        math.hypot(acceleration.x, acceleration.y) / limits.horizontal_acceleration_m_s2,
        abs(acceleration.z) / limits.vertical_acceleration_m_s2,
    )


def stopping_s(x: float, y: float, z: float, limits: Limits) -> float:
    """Returns for how long a velocity, flown on, leads to where the fastest stop from it ends: its way is velocity *
    time. The UAV must have no acceleration.

    Such a stop is straight and symmetrical in time (`ual_daemon.trajectory.pulse`), so it is flown at half the velocity
    on average, and this time is half its duration. At full acceleration the stop would take ``q``, the velocity's share
    of the acceleration limits. With the ramps it takes ``q + RAMP_S``, or if the limit is not reached, twice
    ``sqrt(q * RAMP_S)`` (`ual_daemon.trajectory.pulse.change_s`).
    """
    # Written out, because each velocity setpoint calls it three times. It equals `Brake(...).end()`.
    q = max(math.hypot(x, y) / limits.horizontal_acceleration_m_s2, abs(z) / limits.vertical_acceleration_m_s2)
    return (q + RAMP_S) / 2 if q >= RAMP_S else math.sqrt(q * RAMP_S)


def turn_acceleration_limit(limits: Limits) -> float:
    """Returns the largest acceleration of the heading, rad/s^2."""
    return limits.yaw_rate_rad_s / TURN_RAMP_S


def turn_jerk_limit(limits: Limits) -> float:
    """Returns the largest jerk of the heading, rad/s^3."""
    return turn_acceleration_limit(limits) / TURN_JERK_RAMP_S


def _along(direction: Vector3, horizontal: float, vertical: float) -> float:
    h, v = direction.horizontal_norm(), abs(direction.z)
    return min(horizontal / h if h > 1e-9 else math.inf, vertical / v if v > 1e-9 else math.inf)


def planned_limit(limit: float, velocity: float, acceleration: float, jerk_limit: float) -> float:
    """Returns the limit of a velocity to plan with, from a motion that is about to reach the limit exactly.

    Ruckig takes it for one that passes the limit, by the last bit, and plans a slower motion: once in a hundred plans,
    by seconds.
    """
    reached = abs(velocity + acceleration * abs(acceleration) / (2 * jerk_limit))  # once the acceleration has died out
    return max(limit, reached if reached <= limit * (1.0 + _AT_LIMIT) else limit) * (1.0 + _ROUNDING)
