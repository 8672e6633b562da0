"""Changes of speed and of velocity as fast as acceleration and jerk allow. The acceleration is 0 before and after.

The acceleration rises in a ramp, may hold, and falls in an equal ramp, always along the difference of the velocities.
So all velocities meanwhile are between the two. The change is symmetrical in time, so the displacement is that of the
mean velocity. A corner is also such a change: it leaves one leg and joins the next one at equal distances from the
point where they meet. (See the parabolic blends of textbooks, smoothed by ramps of the acceleration as in Biagiotti
and Melchiorri.)
"""

from __future__ import annotations

import math
from collections.abc import Callable

from ual.shared.immutable import immutable
from ual_daemon.trajectory.envelope import RAMP_S


@immutable
class Pulse:
    """The acceleration of a change: it rises for `ramp_s`, holds for `hold_s`, falls for `ramp_s`."""

    ramp_s: float = 0.0
    hold_s: float = 0.0

    @classmethod
    def shortest(cls, change_m_s: float, acceleration_m_s2: float) -> Pulse:
        """Returns the shortest pulse for a change of speed."""
        hold_s = change_m_s / acceleration_m_s2 - RAMP_S
        if hold_s >= 0.0:
            return cls(RAMP_S, hold_s)
        return cls(math.sqrt(max(0.0, change_m_s) * RAMP_S / acceleration_m_s2), 0.0)

    @property
    def duration_s(self) -> float:
        """The duration."""
        return 2 * self.ramp_s + self.hold_s

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Returns distance, speed and acceleration at a time (0 to the duration), for a change of 1 m/s from rest."""
        ramp, hold = self.ramp_s, self.hold_s
        if ramp == 0.0:
            return 0.0, 0.0, 0.0
        full = 1.0 / (ramp + hold)
        if time_s < ramp:
            acceleration = full * time_s / ramp
            return acceleration * time_s * time_s / 6, acceleration * time_s / 2, acceleration
        if time_s < ramp + hold:
            t = time_s - ramp
            begun = full * ramp / 2
            return full * ramp * ramp / 6 + begun * t + full * t * t / 2, begun + full * t, full
        left = max(0.0, 2 * ramp + hold - time_s)
        acceleration = full * left / ramp
        missing = acceleration * left / 2
        return ramp + hold / 2 - left + missing * left / 3, 1.0 - missing, acceleration


def change_s(change_m_s: float, acceleration_m_s2: float) -> float:
    """Returns the duration of the shortest change of speed."""
    change_m_s = abs(change_m_s)
    if change_m_s >= acceleration_m_s2 * RAMP_S:
        return change_m_s / acceleration_m_s2 + RAMP_S
    return 2 * math.sqrt(change_m_s * RAMP_S / acceleration_m_s2)


def change_m(before_m_s: float, after_m_s: float, acceleration_m_s2: float) -> float:
    """Returns the distance of the shortest change of speed along a straight line."""
    return (before_m_s + after_m_s) / 2 * change_s(after_m_s - before_m_s, acceleration_m_s2)


def fastest_change_m_s(path_m: float, acceleration_m_s2: float) -> float:
    """Returns the largest speed from which it is possible to stop within a distance. A change of velocity of the same
    size and mean speed needs the same distance.
    """
    if path_m >= acceleration_m_s2 * RAMP_S**2:
        return (math.sqrt(RAMP_S**2 + 8 * path_m / acceleration_m_s2) - RAMP_S) * acceleration_m_s2 / 2
    return (path_m**2 * acceleration_m_s2 / RAMP_S) ** (1 / 3) if path_m > 0.0 else 0.0


def peak_m_s(before_m_s: float, after_m_s: float, path_m: float, fastest_m_s: float, acceleration_m_s2: float) -> float:
    """Returns the largest speed that a motion can reach, and keep, on a distance between two given speeds.

    The distance must be long enough for the change from one speed to the other.
    """

    def spare_m(peak: float) -> float:
        return path_m - change_m(before_m_s, peak, acceleration_m_s2) - change_m(peak, after_m_s, acceleration_m_s2)

    if spare_m(fastest_m_s) >= 0.0:
        return fastest_m_s
    lowest = max(before_m_s, after_m_s)
    # The solution if both changes reach the limit of the acceleration.
    a, r = acceleration_m_s2, RAMP_S
    rest = (before_m_s + after_m_s) * r / 2 - (before_m_s**2 + after_m_s**2) / (2 * a) - path_m
    peak = (math.sqrt(max(0.0, r * r - 4 * rest / a)) - r) * a / 2
    return peak if peak - lowest >= a * r else largest(spare_m, lowest, fastest_m_s)


def largest(spare: Callable[[float], float], low: float, high: float, within: float = 1e-13) -> float:
    """Returns the largest value for which a falling function is not negative, to a relative precision, by false
    position (Illinois). The function must not be negative at `low`; it may be at `high`.
    """
    at_low, at_high = spare(low), spare(high)
    if at_high >= 0.0:
        return high
    side = 0
    while at_low > 0.0 and high - low > within * high:
        middle = (low * at_high - high * at_low) / (at_high - at_low)
        if not low < middle < high:
            break
        value = spare(middle)
        if value >= 0.0:
            low, at_low = middle, value
            at_high = at_high / 2 if side > 0 else at_high
            side = 1
        else:
            high, at_high = middle, value
            at_low = at_low / 2 if side < 0 else at_low
            side = -1
    return low
