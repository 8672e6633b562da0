"""The limits that a UAV flies within: those in force, and how they are made narrower."""

from __future__ import annotations

from dataclasses import fields, replace

from ual.geometry import Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Takes
from ual_daemon.settings import LimitSettings
from ual_daemon.trajectory.envelope import speed_share

_PLANNED_ACCELERATION_SHARE = 0.95
"""For an autopilot that is flown by velocities alone: what is left corrects errors. Without it, a light UAV that cannot
brake any harder overshoots by 6 cm from 7 m/s; with it, by nothing, in 1.03 times the time."""


class CurrentLimits:
    """The limits in force: the smaller of the autopilot's, which may change while it is connected, and the user's."""

    def __init__(self, backend: Backend, users: LimitSettings) -> None:
        self._backend = backend
        self._users = users
        self._cached: tuple[Limits | None, Limits] = (None, Limits())
        """The autopilot's limits, and the limits in force that were computed from them."""

    def get(self) -> Limits:
        """Returns the limits. Any thread may call. Cached, because each setpoint calls it."""
        autopilots = self._backend.info().limits
        cached_for, limits = self._cached
        if cached_for is not autopilots:
            limits = smaller(autopilots, self._users)
            self._cached = (autopilots, limits)
        return limits

    def stop(self) -> Limits:
        """Returns the limits of a stop: with all of the autopilot's acceleration, within the user's limits."""
        info = self._backend.info()
        return smaller(_accelerating(info.limits, 1.0 / info.acceleration_share), self._users)

    def planned(self) -> Limits:
        """Returns the limits of a trajectory that is to be flown: those in force, or less acceleration."""
        limits, takes = self.get(), self._backend.info().takes
        if Takes.FEED_FORWARD in takes or Takes.VELOCITY not in takes:
            return limits
        return _accelerating(limits, _PLANNED_ACCELERATION_SHARE)

    def cruise(self) -> Limits:
        """Returns the limits of a flight to a goal where nobody gave a speed: horizontally, the autopilot's cruise."""
        limits, cruise_m_s = self.planned(), self._backend.info().cruise_speed_m_s
        if cruise_m_s >= limits.horizontal_speed_m_s:
            return limits
        return replace(limits, horizontal_speed_m_s=cruise_m_s)


def _accelerating(limits: Limits, factor: float) -> Limits:
    """Returns the limits with so many times the acceleration."""
    return replace(
        limits,
        horizontal_acceleration_m_s2=factor * limits.horizontal_acceleration_m_s2,
        vertical_acceleration_m_s2=factor * limits.vertical_acceleration_m_s2,
    )


def smaller(autopilots: Limits, users: LimitSettings) -> Limits:
    """Returns the smaller of the autopilot's and the user's value of each limit."""
    return Limits(*(min(getattr(autopilots, field.name), getattr(users, field.name)) for field in fields(Limits)))


def at_most(limits: Limits, speed_m_s: float | None) -> Limits:
    """Returns the limits with no speed above the given one; None leaves them as they are."""
    if speed_m_s is None:
        return limits
    return replace(
        limits,
        horizontal_speed_m_s=min(limits.horizontal_speed_m_s, speed_m_s),
        climb_speed_m_s=min(limits.climb_speed_m_s, speed_m_s),
        descent_speed_m_s=min(limits.descent_speed_m_s, speed_m_s),
    )


def slower(one_m_s: float | None, other_m_s: float | None) -> float | None:
    """Returns the smaller of two speed limits; None is no limit."""
    speeds = [speed for speed in (one_m_s, other_m_s) if speed is not None]
    return min(speeds, default=None)


def scaled_down(twist: Twist, limits: Limits) -> Twist:
    """Returns the velocity within the limits: scaled down, its direction kept. The yaw rate is limited by itself."""
    v, w = twist.linear, twist.angular
    excess = max(1.0, speed_share(v, limits))
    fastest_rad_s = limits.yaw_rate_rad_s
    if excess == 1.0 and -fastest_rad_s <= w.z <= fastest_rad_s and w.x == w.y == 0.0:
        return twist
    return Twist(v if excess == 1.0 else v / excess, Vector3(0.0, 0.0, clamped(w.z, fastest_rad_s)))


def clamped(value: float, limit: float) -> float:
    """Returns the value, limited to between -`limit` and `limit`."""
    return max(-limit, min(limit, value))
