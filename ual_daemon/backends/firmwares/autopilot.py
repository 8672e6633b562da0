"""Interface of one kind of autopilot, whatever protocol reaches it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

from ual.types import Capability, Limits
from ual_daemon.backends.engine.command import NotYetError
from ual_daemon.backends.firmwares.fence_zones import UNREAD, FoundZones
from ual_daemon.backends.firmwares.gimbal_codec import GimbalCodec
from ual_daemon.backends.firmwares.gripper_codec import GripperCodec
from ual_daemon.backends.firmwares.mission_codec import MissionCodec
from ual_daemon.backends.firmwares.mission_items import MissionType
from ual_daemon.backends.firmwares.motor_outputs import MotorChannels
from ual_daemon.backends.firmwares.numbers import EstimatorFlag, VehicleType
from ual_daemon.backends.offers.fence import FenceSwitch
from ual_daemon.backends.values import (
    NO_FENCE,
    AutopilotFence,
    Cause,
    Estimator,
    FenceLimit,
    Mode,
    OnArming,
    PositionSetpoint,
    Snapshot,
    VelocityResponses,
)
from ual_daemon.geodesy import Projection

_ESTIMATOR_NEEDS = {
    EstimatorFlag.ATTITUDE: "attitude",
    EstimatorFlag.VELOCITY_HORIZ: "horizontal velocity",
    EstimatorFlag.VELOCITY_VERT: "vertical velocity",
    EstimatorFlag.POS_HORIZ_REL: "horizontal position",
    EstimatorFlag.POS_VERT_ABS: "height",
}
MULTIROTORS = frozenset(int(kind) for kind in VehicleType)
"""The vehicles that UAL flies."""
NO_PARAMETERS: Mapping[str, float] = MappingProxyType({})


class HomeUnknownError(NotYetError):
    """A height cannot be computed yet, because the autopilot has not sent the position of its home."""


class AutopilotBoard(Protocol):
    """Hardware of an autopilot by its own report (AUTOPILOT_VERSION)."""

    @property
    def board_version(self) -> int:
        """The version of the board."""
        ...

    @property
    def vendor_id(self) -> int:
        """The vendor of the board, as of USB."""
        ...

    @property
    def product_id(self) -> int:
        """The product, as of USB."""
        ...

    @property
    def uid(self) -> int:
        """The unique id of the board."""
        ...


@dataclass(frozen=True, slots=True)
class SimulationVerdict:
    """Whether an autopilot is simulated, by its own data; None while that is not enough. `why` gives the reason."""

    is_simulated: bool | None
    why: str = ""


class Autopilot(ABC):
    """One kind of autopilot. Stateless: callers pass everything that it needs."""

    name: str
    limitation = ""
    """See `ual_daemon.backends.values.VehicleInfo`."""
    capabilities: frozenset[Capability] = frozenset()
    sends_landed_state = False
    """Whether EXTENDED_SYS_STATE is sure to come."""
    flies_takeoff_on_setpoints = True
    """See `ual_daemon.backends.values.VehicleInfo`."""
    gripper: GripperCodec | None = None
    """Codec of its payload devices; None where UAL moves none of them."""
    sends_image_captured = False
    """Whether it reports the pictures that it triggers by CAMERA_IMAGE_CAPTURED, too."""
    gimbal: GimbalCodec | None = None
    """Codec of its own gimbal where a bridge passes on its parameters and commands only."""
    setpoint_mode = ""
    """The name of the mode in which it follows setpoints."""
    hold_mode = ""
    """The name of the mode in which it holds its position by itself, whatever the sticks say."""
    land_mode = ""
    """The name of the mode in which it lands where it is."""
    termination_mode = ""
    """The name of the mode in which it keeps the motors stopped in the air; empty where it has none."""
    arming_mode = ""
    """The name of the mode in which it is armed where it cannot be, or would fly, in the present one."""
    setpoints_before_mode_s = 0.0
    """For how long setpoints must have come before it accepts the mode that follows them."""
    takes_feed_forward = False
    """Whether it adds the accelerations of setpoints to those of its controllers, so that `FeedForward` helps it."""
    takes_acceleration = False
    """Whether accelerations are sent to it at all."""
    pilots_modes: frozenset[str] = frozenset()
    """Names of the modes that are flown by sticks."""
    fallback_mode = ""
    """The name of the mode of a pilot that a failsafe enters only where setpoints are missing."""
    stays_without_setpoints = False
    """Whether it stays in the mode that takes setpoints when none come, and reports its target there."""
    on_arming: Mapping[str, OnArming] = MappingProxyType({})
    """Effect of arming in the mode of a name; see `ual_daemon.backends.values.Mode`."""
    on_arming_elsewhere = OnArming.STANDS
    """The same for the modes that `on_arming` does not name."""
    parameters: tuple[str, ...] = ()
    """Parameters to read: those that `limits` and `autopilot_fence` use."""
    optional_parameters: frozenset[str] = frozenset()
    """Names among `parameters` that it need not have."""
    parameter_names: tuple[tuple[str, ...], ...] = ()
    """Names among `parameters` that differ between versions: all names of each. It has one of them."""
    parameters_checksum = ""
    """The name of a checksum that it sends among its parameters; empty where there is none."""
    failsafe_parameters: frozenset[str] = frozenset()
    """Names of parameters by which it judges its links, its pilot and its battery, and acts by itself. A flight of UAL
    relies on them as on `parameters`, so that neither is written in flight."""
    has_zones = False
    """Whether its own fence may have polygons and circles, which it keeps like the items of a mission."""
    drops_positions_beyond_fence = False
    keeps_target_of_a_kind = False
    """See `ual_daemon.backends.values.VehicleInfo`."""
    missions: MissionCodec | None = None
    """Codec of its missions; None where UAL brings it none."""
    keeps_parts_of: frozenset[MissionType] = frozenset(MissionType)
    """The lists of which it keeps what has come of an upload that was cut off. Else it keeps what it had before."""
    fence_switches: tuple[FenceSwitch, ...] = ()
    """The parameters by which it applies its zones."""
    zones_parameter = ""
    """The name of a parameter that it sends whenever it has got others; empty where there is none."""
    tells_motors = False
    """Whether only its outputs tell for sure that its motors are stopped in the air."""

    @property
    def relied_on(self) -> frozenset[str]:
        """The names of the parameters on which a flight relies."""
        return self.failsafe_parameters.union(self.parameters)

    def unites_inclusions(self, parameters: Mapping[str, float]) -> bool:
        """Returns whether the UAV may be in any one of several inclusions of its fence."""
        return False

    @abstractmethod
    def mode(self, custom_mode: int) -> Mode:
        """Returns the mode of the autopilot's own number."""

    def names_mode(self, custom_mode: int) -> bool:
        """Returns whether the mode of this number is always the same, with a name that is known."""
        return False

    @abstractmethod
    def mode_named(self, name: str) -> Mode:
        """Returns the mode of a name."""

    def estimator(self, flags: int) -> Estimator:
        """Returns what the flags of the estimator's status mean."""
        missing = [name for flag, name in _ESTIMATOR_NEEDS.items() if not flags & flag]
        return Estimator(not missing, f"no {', '.join(missing)}" if missing else "")

    @abstractmethod
    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        """Returns the autopilot's own projection at the origin of its local frame."""

    @abstractmethod
    def judge_simulation(
        self, version: AutopilotBoard | None, parameters: Mapping[str, float], system_id: int
    ) -> SimulationVerdict:
        """Judges by what it says of its board and the parameters read so far whether it is simulated."""

    def cause_of_text(self, text: str) -> Cause | None:
        """Returns the failsafe that a status text announces; None for any other text."""
        return None

    def ends_of_text(self, text: str) -> tuple[str, ...]:
        """Returns how the texts begin that are over by this one; none for any other text."""
        return ()

    def motor_stop_of_text(self, text: str) -> bool | None:
        """Returns whether a text says that a switch stops the motors, or that it does not any more; None for others."""
        return None

    def motor_channels(self, parameters: Mapping[str, float]) -> MotorChannels | None:
        """Returns which of its outputs are motors, by the parameters read so far; None while none is known."""
        return None

    def failsafe_of_sensors(self, failing: int, healthy_once: int) -> Cause | None:
        """Returns the failsafe that its sensors show (bits of MAV_SYS_STATUS): those that fail now, and those that have
        been healthy since it is received.
        """
        return None

    def can_be_armed_in(self, mode: str) -> bool:
        """Returns whether it stands once it is armed in the mode of this name; `arm` leaves the others first.

        Where no mode is known yet there is none to leave.
        """
        return not mode or self.on_arming.get(mode, self.on_arming_elsewhere) is OnArming.STANDS

    def is_multirotor(self, vtol_state: int, parameters: Mapping[str, float]) -> bool:
        """Returns whether it can be the multirotor that its heartbeat says, by its MAV_VTOL_STATE and its parameters.

        A VTOL may be set up to call itself a quadrotor.
        """
        return True

    def absent_parameters(self, known: Container[str]) -> list[str]:
        """Returns the names of those that are not known, under another name neither."""
        unread = [name for name in self.parameters if name not in known]  # few: each tick asks
        return [name for name in unread if not any(each in known for each in self.names_of(name))]

    def missing_parameters(self, known: Container[str]) -> tuple[str, ...]:
        """Returns, human-readable, the names of those that it should have, and that are not known."""
        needed = [name for name in self.absent_parameters(known) if name not in self.optional_parameters]
        return tuple(sorted({" or ".join(self.names_of(name)) for name in needed}))

    def names_of(self, name: str) -> tuple[str, ...]:
        """Returns all names of a parameter, the given one among them."""
        return next((names for names in self.parameter_names if name in names), (name,))

    @abstractmethod
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        """Returns its limits, by the parameters read so far.

        One that is not known is the lowest that any version, or any frame that it supports, ships with: an assumption
        must not exceed what the vehicle can do.
        """

    def cruise_speed_m_s(self, parameters: Mapping[str, float]) -> float:
        """Returns the horizontal speed at which it flies to a goal by itself; infinite where that is its limit."""
        return math.inf

    def velocity_responses(self, parameters: Mapping[str, float]) -> VelocityResponses:
        """Returns how it follows velocities, by the parameters read so far."""
        return VelocityResponses()

    def acceleration_share(self, parameters: Mapping[str, float]) -> float:
        """Returns the part of its own acceleration limits that `limits` has; 1 where they were not read."""
        return 1.0

    def setpoints_lost_s(self, parameters: Mapping[str, float]) -> float:
        """Returns after how long without setpoints it leaves the mode in which it follows them, by itself.

        Setpoints that come again then bring it back unasked, so UAL must not go on after as long a gap.
        """
        return math.inf

    def autopilot_fence(
        self, parameters: Mapping[str, float], *, is_enabled: bool, found: FoundZones = UNREAD
    ) -> AutopilotFence:
        """Returns the fence that it applies itself, by the parameters and the zones read so far.

        `is_enabled` says that its SYS_STATUS shows a fence in use: a switch may have enabled it.
        """
        return NO_FENCE

    def position_setpoint(self, setpoint: PositionSetpoint, parameters: Mapping[str, float]) -> PositionSetpoint:
        """Returns the setpoint that makes it fly as this one says; `parameters` are those read so far."""
        return setpoint

    def takeoff_altitude_m(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> float | None:
        """Returns the height above its home to which it climbs by itself, for a height above where it stands.

        None where setpoints fly the take-off. `is_slower`: the climb speed in force is below its own, so it is not to
        climb all the way by itself.

        Raises:
            HomeUnknownError: The snapshot lacks what the autopilot's height is computed from.
            WrongStateError: The autopilot would climb to another height.

        """
        return None


_RELEASE = ("dev", "alpha", "beta", "rc", "")
_RELEASE_KIND_FACTOR = 64


def version_text(number: int) -> str:
    """Returns the text of a version number of MAVLink (FIRMWARE_VERSION_TYPE in the lowest byte): ``1.17.0 rc``."""
    major, minor, patch, release = number >> 24, number >> 16 & 0xFF, number >> 8 & 0xFF, number & 0xFF
    kind = _RELEASE[min(-(-release // _RELEASE_KIND_FACTOR), len(_RELEASE) - 1)]
    return f"{major}.{minor}.{patch} {kind}".rstrip()


def assumed_text(limits: Limits) -> str:
    """Returns, human-readable, what is assumed instead of parameters that the autopilot does not send."""
    return (
        f"at most {limits.horizontal_speed_m_s:.3g} m/s, {limits.climb_speed_m_s:.3g} m/s up and "
        f"{limits.descent_speed_m_s:.3g} m/s down, {limits.horizontal_acceleration_m_s2:.3g} m/s^2 and vertically "
        f"{limits.vertical_acceleration_m_s2:.3g} m/s^2, {limits.yaw_rate_rad_s:.3g} rad/s; no fence of its own but "
        "what was read"
    )


_MOST_NAMED_PARAMETERS = 3


def assumption_text(missing: Sequence[str], limits: Limits) -> str:
    """Returns, human-readable, that parameters did not come, and what is assumed; empty where none is missing."""
    if not missing:
        return ""
    more_count = len(missing) - _MOST_NAMED_PARAMETERS
    names = ", ".join([*missing[:_MOST_NAMED_PARAMETERS], *([f"{more_count} more"] if more_count > 0 else [])])
    return f"it has not sent {names}: assumed are {assumed_text(limits)}"


def fence_limit(parameters: Mapping[str, float], name: str, *, least: float = 0.0) -> FenceLimit | None:
    """Returns the limit that a parameter sets; None where it is not known, or not above `least`."""
    value = parameters.get(name)
    return None if value is None or value <= least else FenceLimit(value, name)


def positive_parameter(
    parameters: Mapping[str, float], name: str, default: float, *, share: float = 1.0, per_unit: float = 1.0
) -> float:
    """Returns a `share` of a parameter, whose unit is 1/`per_unit` of ours; `default` where it is not positive."""
    value = parameters.get(name, 0.0) / per_unit
    return value * share if value > 0.0 else default
