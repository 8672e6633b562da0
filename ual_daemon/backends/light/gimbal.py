"""The gimbals of a light UAV: each axis turns at no more than a speed, within limits."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError
from ual.geometry import Pose, Vector3, wrap_angle
from ual.gimbals import (
    AngleRange,
    GimbalAbility,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalReference,
)
from ual_daemon.backends import futures
from ual_daemon.backends.light.settings import LightGimbalSettings
from ual_daemon.backends.offers.gimbals import GimbalAttitude, GimbalDriver, GimbalDrivers

_NEUTRAL = GimbalAngles()
_WHOLE_TURN_RAD = 2.0 * math.pi - 1e-6


class GimbalMoment(NamedTuple):
    """Input of a gimbal at a moment: the UAV's real heading, and whether its link is lost."""

    time_s: float
    heading_rad: float
    is_link_lost: bool


class _Goal(NamedTuple):
    """Target of a gimbal: angles, or rates (roll, pitch, yaw) where they are not None."""

    angles: GimbalAngles = _NEUTRAL
    reference: GimbalReference = GimbalReference.HORIZON
    rates: GimbalAngles | None = None


class LightGimbal(GimbalDriver):
    """One gimbal. `look` returns the present moment.

    It is computed when it is looked at: between two looks its goal does not move, but for the heading of the UAV.
    """

    def __init__(self, number: int, settings: LightGimbalSettings, look: Callable[[], GimbalMoment]) -> None:
        self._number = number
        self._settings = settings
        self._observe = look
        self._ranges = [
            AngleRange(*settings.roll_limits_rad),
            AngleRange(*settings.pitch_limits_rad),
            AngleRange(*settings.yaw_limits_rad),
        ]
        self._lock = threading.Lock()
        self._angles = _NEUTRAL
        self._time_s = -math.inf
        self._goal = _Goal()
        self._is_ours = False

    @property
    @override
    def info(self) -> GimbalInfo:
        roll, pitch, yaw = self._ranges
        is_connected = not self._observe().is_link_lost
        return GimbalInfo(
            self._number, self._settings.name, frozenset(GimbalAbility), is_connected, "", roll, pitch, yaw
        )

    @property
    @override
    def mount_position(self) -> Vector3:
        return Vector3(*self._settings.position)

    @override
    def attitude(self) -> GimbalAttitude | None:
        moment = self._observe()
        if moment.is_link_lost:
            return None
        return GimbalAttitude(self.angles(moment).orientation, GimbalReference.HORIZON, moment.time_s)

    def pose(self, moment: GimbalMoment) -> Pose:
        """Returns where it is in the body at a moment, and where it looks: also while the link is lost."""
        return Pose(self.mount_position, self.angles(moment).orientation)

    def angles(self, moment: GimbalMoment) -> GimbalAngles:
        """Returns how it is turned in the body. A light UAV does not tilt, so that is from the horizon, too."""
        with self._lock:
            return self._advance(moment)

    @override
    def control(self) -> tuple[GimbalControl | None, str]:
        return (GimbalControl.OURS, "this daemon") if self._is_ours else (GimbalControl.FREE, "")

    @override
    def problems(self) -> Sequence[str]:
        return ()

    @override
    def set_angles(self, angles: GimbalAngles, reference: GimbalReference) -> Future[None]:
        return self._turn(_Goal(angles, reference))

    @override
    def set_rates(self, pitch_rad_s: float, yaw_rad_s: float) -> Future[None]:
        return self._turn(_Goal(rates=GimbalAngles(0.0, pitch_rad_s, yaw_rad_s)))

    @override
    def aim(self, angles: GimbalAngles, reference: GimbalReference) -> None:
        self._turn(_Goal(angles, reference)).exception(0)

    @override
    def move_to_neutral(self) -> Future[None]:
        return self._turn(_Goal())

    @override
    def retract(self) -> Future[None]:
        return self._turn(_Goal(GimbalAngles(0.0, self._settings.pitch_limits_rad[0], 0.0)))

    @override
    def take_control(self) -> Future[None]:
        return self._set_control(is_ours=True)

    @override
    def release_control(self) -> Future[None]:
        return self._set_control(is_ours=False)

    def _set_control(self, *, is_ours: bool) -> Future[None]:
        if self._observe().is_link_lost:
            return self._lost()
        self._is_ours = is_ours
        return futures.done()

    def _turn(self, goal: _Goal) -> Future[None]:
        moment = self._observe()
        if moment.is_link_lost:
            return self._lost()
        with self._lock:
            self._advance(moment)
            self._goal = goal
        return futures.done()

    def _lost(self) -> Future[None]:
        return futures.failed(LinkLostError(f"gimbal {self._number} is not heard (simulated)"))

    def _advance(self, moment: GimbalMoment) -> GimbalAngles:
        """Turns it until a moment. The caller holds the lock."""
        passed_s = 0.0 if self._time_s == -math.inf else moment.time_s - self._time_s
        self._time_s = max(self._time_s, moment.time_s)
        if passed_s > 0.0:
            far_rad = self._settings.speed_rad_s * passed_s
            axes = zip(self._now(), self._turns(passed_s, moment.heading_rad), self._ranges, strict=True)
            self._angles = GimbalAngles(*(_turned(*axis, far_rad) for axis in axes))
        return self._angles

    def _now(self) -> tuple[float, float, float]:
        return self._angles.roll_rad, self._angles.pitch_rad, self._angles.yaw_rad

    def _turns(self, passed_s: float, heading_rad: float) -> Sequence[float]:
        """Returns how far each axis has to turn, if it were fast enough."""
        goal, rates = self._goal.angles, self._goal.rates
        if rates is not None:
            return 0.0, rates.pitch_rad * passed_s, rates.yaw_rad * passed_s
        turned_rad = heading_rad if self._goal.reference is GimbalReference.EARTH else 0.0
        wanted = (goal.roll_rad, goal.pitch_rad, wrap_angle(goal.yaw_rad - turned_rad))
        return [_shortest_turn(*axis) for axis in zip(self._now(), wanted, self._ranges, strict=True)]


class LightGimbals(GimbalDrivers):
    """The gimbals of one UAV."""

    def __init__(self, settings: Sequence[LightGimbalSettings], look: Callable[[], GimbalMoment]) -> None:
        self.gimbals = [LightGimbal(number, each, look) for number, each in enumerate(settings)]

    @override
    def all(self) -> Sequence[GimbalDriver]:
        return self.gimbals


def _shortest_turn(now_rad: float, wanted_rad: float, range_: AngleRange) -> float:
    """Returns the way to an angle. An axis without an end takes the shorter one."""
    return wrap_angle(wanted_rad - now_rad) if _is_endless(range_) else range_.nearest(wanted_rad) - now_rad


def _turned(now_rad: float, turn_rad: float, range_: AngleRange, far_rad: float) -> float:
    """Returns where an axis is on its way after it has turned so far."""
    turned_rad = now_rad + math.copysign(min(abs(turn_rad), far_rad), turn_rad)
    return wrap_angle(turned_rad) if _is_endless(range_) else range_.nearest(turned_rad)


def _is_endless(range_: AngleRange) -> bool:
    return range_.most_rad - range_.least_rad >= _WHOLE_TURN_RAD
