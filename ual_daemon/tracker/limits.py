"""The limits that a UAV flies within: those in force, and how they are made narrower."""

from __future__ import annotations

from dataclasses import fields, replace

from ual.geometry import Twist, Vector3
from ual.types import Limits
from ual_daemon.backends.base import Backend
from ual_daemon.settings import LimitSettings


class CurrentLimits:
    """The limits in force: the smaller of the autopilot's, which may change while it is connected, and the user's."""

    def __init__(self, backend: Backend, users: LimitSettings) -> None:
        self._backend = backend
        self._users = users
        self._cached: tuple[Limits | None, Limits] = (None, Limits())

    def get(self) -> Limits:
        """Returns them. Any thread may call. Computed only where the autopilot's have changed: each setpoint asks."""
        own = self._backend.info().limits
        of, limits = self._cached
        if of is not own:
            limits = smaller(own, self._users)
            self._cached = (own, limits)
        return limits


def smaller(own: Limits, users: LimitSettings) -> Limits:
    """The smaller of each limit of the UAV's own and the user's."""
    return Limits(*(min(getattr(own, field.name), getattr(users, field.name)) for field in fields(Limits)))


def at_most(limits: Limits, speed_m_s: float | None) -> Limits:
    """The limits, with no speed above one; None leaves them."""
    if speed_m_s is None:
        return limits
    return replace(
        limits,
        horizontal_speed_m_s=min(limits.horizontal_speed_m_s, speed_m_s),
        climb_speed_m_s=min(limits.climb_speed_m_s, speed_m_s),
        descent_speed_m_s=min(limits.descent_speed_m_s, speed_m_s),
    )


def slower(one_m_s: float | None, other_m_s: float | None) -> float | None:
    """The smaller of two speeds, of which None is no limit."""
    speeds = [speed for speed in (one_m_s, other_m_s) if speed is not None]
    return min(speeds, default=None)


def scaled_down(twist: Twist, limits: Limits) -> Twist:
    """The velocity, scaled down where it is beyond the limits, its direction kept; the turn is limited by itself."""
    v = twist.linear
    vertical = limits.climb_speed_m_s if v.z > 0 else limits.descent_speed_m_s
    excess = max(1.0, v.horizontal_norm() / limits.horizontal_speed_m_s, abs(v.z) / vertical)
    w = twist.angular
    turn = max(-limits.yaw_rate_rad_s, min(limits.yaw_rate_rad_s, w.z))
    if excess == 1.0 and turn == w.z and w.x == w.y == 0.0:
        return twist
    return Twist(v if excess == 1.0 else v / excess, Vector3(0.0, 0.0, turn))
