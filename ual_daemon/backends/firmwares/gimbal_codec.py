"""The gimbals that an autopilot turns itself, by its parameters and its commands: for bridges that pass no more on.

Read in the sources of PX4 1.17 (modules/gimbal) and ArduCopter 4.6 (AP_Mount).
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType

from typing_extensions import override

from ual.errors import NotSupportedError
from ual.gimbals import AngleRange, GimbalAbility, GimbalAngles, GimbalReference
from ual_daemon.backends.firmwares import gimbal_protocol
from ual_daemon.backends.firmwares.gimbal_protocol import GimbalIdentity
from ual_daemon.backends.firmwares.gripper_codec import PayloadOrder

MOUNT_CONTROL = 205
"""MAV_CMD_DO_MOUNT_CONTROL."""
_DEVICE = "gimbal 1"
_TARGETING, _NEUTRAL = 2.0, 1.0
"""Of MAV_MOUNT_MODE."""

Known = Mapping[str, float]
"""The parameters read so far."""


class GimbalCodec(ABC):
    """The first gimbal of one kind of autopilot. Stateless: callers pass everything that it needs."""

    references: Mapping[float, GimbalReference] = MappingProxyType({})
    """Axes of the attitude, by the value of the parameter with the gimbal's kind, whatever its flags say."""

    @abstractmethod
    def parameters(self, known: Known) -> tuple[str, ...]:
        """Returns the names of the parameters that say what it is, as far as the autopilot has them by those known."""

    @abstractmethod
    def identity(self, known: Known) -> GimbalIdentity | None:
        """Returns what it is; None where there is none, or not all that says so is known."""

    @abstractmethod
    def meant(self, known: Known) -> GimbalReference | None:
        """Returns in which axes its attitude is; None where its flags say so."""

    @abstractmethod
    def tells_attitude(self, known: Known) -> bool:
        """Returns whether what GIMBAL_DEVICE_ATTITUDE_STATUS says is surely of this one."""

    @abstractmethod
    def tells_mount(self, known: Known) -> bool:
        """Returns whether MOUNT_ORIENTATION, or the MOUNT_STATUS before it, says where it looks."""

    @abstractmethod
    def turning(self, angles: GimbalAngles, reference: GimbalReference) -> PayloadOrder:
        """Turns it to angles."""

    @abstractmethod
    def resting(self, *, is_retracted: bool) -> PayloadOrder:
        """Turns it to its neutral angles, or retracts it."""

    def turning_at(self, pitch_rad_s: float, yaw_rad_s: float) -> PayloadOrder:
        """Turns it at rates."""
        raise NotSupportedError("it takes no rates")


class ArduPilotGimbal(GimbalCodec):
    """ArduPilot's first mount. Never by DO_MOUNT_CONTROL: a copter turns itself by that where its mount cannot."""

    references = MappingProxyType({1.0: GimbalReference.BODY})  # of servos it says the angles
    _KIND, _SECOND = "MNT1_TYPE", "MNT2_TYPE"
    _LIMITS = ("MNT1_PITCH_MIN", "MNT1_PITCH_MAX", "MNT1_YAW_MIN", "MNT1_YAW_MAX")

    @override
    def parameters(self, known: Known) -> tuple[str, ...]:
        return (self._KIND, self._SECOND, *self._LIMITS) if known.get(self._KIND) else (self._KIND,)

    @override
    def identity(self, known: Known) -> GimbalIdentity | None:
        if not known.get(self._KIND) or not known.keys() >= set(self._LIMITS):
            return None
        pitch, yaw = (_turned(known[least], known[most]) for least, most in _pairs(self._LIMITS))
        axes = {GimbalAbility.PITCH: pitch, GimbalAbility.YAW: yaw, GimbalAbility.EARTH: yaw}
        able = {ability for ability, limits in axes.items() if limits is not None}
        always = {GimbalAbility.HORIZON, GimbalAbility.RATES, GimbalAbility.NEUTRAL, GimbalAbility.RETRACT}
        note = "there are two: only the first is turned, and which one looks where is not told"
        return GimbalIdentity(frozenset(always | able), None, pitch, yaw, note if self._are_two(known) else "")

    @override
    def meant(self, known: Known) -> GimbalReference | None:
        return self.references.get(known.get(self._KIND, 0.0))

    @override
    def tells_attitude(self, known: Known) -> bool:
        return not self._are_two(known)

    @override
    def tells_mount(self, known: Known) -> bool:
        return not self._are_two(known)

    def _are_two(self, known: Known) -> bool:
        return bool(known.get(self._SECOND))

    @override
    def turning(self, angles: GimbalAngles, reference: GimbalReference) -> PayloadOrder:
        return _pitch_yaw("turn the gimbal", gimbal_protocol.turning_params(angles, reference, 1))

    @override
    def turning_at(self, pitch_rad_s: float, yaw_rad_s: float) -> PayloadOrder:
        return _pitch_yaw("turn the gimbal", gimbal_protocol.rates_params(pitch_rad_s, yaw_rad_s, 1))

    @override
    def resting(self, *, is_retracted: bool) -> PayloadOrder:
        flag = gimbal_protocol.RETRACT if is_retracted else gimbal_protocol.NEUTRAL
        what = "retract the gimbal" if is_retracted else "move the gimbal to neutral"
        return _pitch_yaw(what, gimbal_protocol.resting_params(flag, 1))


class Px4Gimbal(GimbalCodec):
    """PX4's. By DO_MOUNT_CONTROL: it takes that from any program, and the manager's commands from one by its ids."""

    # Of what it takes the lean off, it says the angles of the servos: of all axes, or of yaw.
    references = MappingProxyType({1.0: GimbalReference.BODY, 2.0: GimbalReference.HORIZON})
    _IN, _OUT, _STABILIZES = "MNT_MODE_IN", "MNT_MODE_OUT", "MNT_DO_STAB"
    _RANGES = ("MNT_RANGE_ROLL", "MNT_RANGE_PITCH", "MNT_RANGE_YAW")
    _MAVLINK_INPUTS = frozenset({0.0, 3.0, 4.0})
    _DEVICE_OUTPUT = 2.0

    @override
    def parameters(self, known: Known) -> tuple[str, ...]:
        is_there = known.get(self._IN) in self._MAVLINK_INPUTS
        return (self._IN, self._OUT, self._STABILIZES, *self._RANGES) if is_there else (self._IN,)

    @override
    def identity(self, known: Known) -> GimbalIdentity | None:
        if known.get(self._IN) not in self._MAVLINK_INPUTS or not known.keys() >= set(self.parameters(known)):
            return None
        able = {GimbalAbility.ROLL, GimbalAbility.PITCH, GimbalAbility.YAW}
        able |= {GimbalAbility.HORIZON, GimbalAbility.NEUTRAL}
        roll, pitch, yaw = (None if self._is_device(known) else _half(known[name]) for name in self._RANGES)
        return GimbalIdentity(frozenset(able), roll, pitch, yaw)

    @override
    def meant(self, known: Known) -> GimbalReference | None:
        return self.references.get(known.get(self._STABILIZES, 0.0))

    @override
    def tells_attitude(self, known: Known) -> bool:
        return self._STABILIZES in known

    @override
    def tells_mount(self, known: Known) -> bool:
        """For a gimbal that is a device of MAVLink itself PX4 goes on to say zeros there."""
        return self._STABILIZES in known and not self._is_device(known)

    def _is_device(self, known: Known) -> bool:
        return known.get(self._OUT) == self._DEVICE_OUTPUT

    @override
    def turning(self, angles: GimbalAngles, reference: GimbalReference) -> PayloadOrder:
        degrees = (-angles.pitch_rad, angles.roll_rad, -angles.yaw_rad)
        return _mount("turn the gimbal", (*map(math.degrees, degrees), 0.0, 0.0, 0.0, _TARGETING))

    @override
    def resting(self, *, is_retracted: bool) -> PayloadOrder:
        if is_retracted:
            raise NotSupportedError("PX4 retracts no gimbal")
        return _mount("move the gimbal to neutral", (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, _NEUTRAL))


def _pitch_yaw(what: str, params: tuple[float, ...]) -> PayloadOrder:
    return PayloadOrder(what, gimbal_protocol.PITCH_YAW, params, _DEVICE)


def _mount(what: str, params: tuple[float, ...]) -> PayloadOrder:
    return PayloadOrder(what, MOUNT_CONTROL, params, _DEVICE)


def _pairs(names: tuple[str, ...]) -> zip[tuple[str, str]]:
    return zip(names[::2], names[1::2], strict=True)


def _turned(least_deg: float, most_deg: float) -> AngleRange | None:
    """Returns a range of MAVLink's angles in ours; None where it leaves nothing to turn, or cannot be."""
    if not -360.0 <= least_deg < most_deg <= 360.0:
        return None
    return AngleRange(-math.radians(most_deg), -math.radians(least_deg))


def _half(range_deg: float) -> AngleRange | None:
    if not 0.0 < range_deg <= 720.0:
        return None
    return AngleRange(-math.radians(range_deg / 2.0), math.radians(range_deg / 2.0))
