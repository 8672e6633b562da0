"""The shortest time from rest to rest along a line, with limits of speed, acceleration and jerk. Analytic, and on
purpose independent of UAL's planner.

The motion is symmetric. Speeding up to v takes the time t(v) and the distance v t(v) / 2. With j the jerk and a the
acceleration limit, the acceleration is a trapezoid with ramps of a / j where v >= a^2 / j, and t = v / a + a / j. It
is a triangle below that, and t = 2 sqrt(v / j). See Biagiotti and Melchiorri, "Trajectory Planning for Automatic
Machines and Robots" (2008), 3.4.
"""

from __future__ import annotations

import math

from ual.geometry import Vector3
from ual.types import Limits

RAMP_S = 0.4
"""The jerk limit is the acceleration limit over this time (docs/concepts/architecture.md: it tilts within 0.3 s)."""


def straight_s(way: Vector3, limits: Limits) -> float:
    """Returns the shortest time, in seconds, from rest to rest along a straight line. Each limit applies to its own
    axis.
    """
    rise_m_s = limits.climb_speed_m_s if way.z > 0.0 else limits.descent_speed_m_s
    speed = _along(way, limits.horizontal_speed_m_s, rise_m_s)
    acceleration = _along(way, limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2)
    return rest_to_rest_s(way.norm(), speed, acceleration, acceleration / RAMP_S)


def rest_to_rest_s(length_m: float, speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """Returns the shortest time, in seconds, for a length from rest to rest."""

    def speeding_up_s(speed: float) -> float:
        if speed * jerk_m_s3 >= acceleration_m_s2**2:
            return speed / acceleration_m_s2 + acceleration_m_s2 / jerk_m_s3
        return 2.0 * math.sqrt(speed / jerk_m_s3)

    ramps_m = speed_m_s * speeding_up_s(speed_m_s)
    if length_m >= ramps_m:
        return 2.0 * speeding_up_s(speed_m_s) + (length_m - ramps_m) / speed_m_s
    # The speed limit is not reached: the peak v has v t(v) = length.
    ramp_m_s = acceleration_m_s2**2 / jerk_m_s3
    if length_m >= ramp_m_s * speeding_up_s(ramp_m_s):
        peak_m_s = (math.sqrt(ramp_m_s**2 + 4.0 * acceleration_m_s2 * length_m) - ramp_m_s) / 2.0
    else:
        peak_m_s = (length_m / 2.0 * math.sqrt(jerk_m_s3)) ** (2.0 / 3.0)
    return 2.0 * speeding_up_s(peak_m_s)


def _along(way: Vector3, horizontal: float, vertical: float) -> float:
    """Returns the largest number along a direction whose horizontal and vertical parts keep their limits."""
    shares = ((way.horizontal_norm() / way.norm(), horizontal), (abs(way.z) / way.norm(), vertical))
    return min(limit / share for share, limit in shares if share > 0.0)
