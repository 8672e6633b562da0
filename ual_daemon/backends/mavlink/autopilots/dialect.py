"""What one kind of autopilot does in its own way, behind one interface; chosen once, by the autopilot's heartbeat."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from ual.errors import NotSupportedError, WrongStateError
from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.autopilots.command_long import CommandLong, arm_or_disarm
from ual_daemon.backends.mavlink.wire.frames import Frame
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import (
    NO_FENCE,
    Cause,
    Estimator,
    ExternalPose,
    FenceLimit,
    Freshness,
    Mode,
    OwnFence,
    Setpoint,
    Snapshot,
)
from ual_daemon.geodesy import Projection

_ESTIMATOR_NEEDS = {
    mavlink.ESTIMATOR_ATTITUDE: "attitude",
    mavlink.ESTIMATOR_VELOCITY_HORIZ: "horizontal velocity",
    mavlink.ESTIMATOR_VELOCITY_VERT: "vertical velocity",
    mavlink.ESTIMATOR_POS_HORIZ_REL: "horizontal position",
    mavlink.ESTIMATOR_POS_VERT_ABS: "height",
}


MULTIROTORS = frozenset(
    {
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
        mavlink.MAV_TYPE_DODECAROTOR,
    }
)
"""The vehicles (MAV_TYPE) that UAL flies. Others need other setpoints, and ArduPilot's have the same numbers for other
modes."""
NO_PARAMETERS: Mapping[str, float] = MappingProxyType({})


class HomeUnknownError(WrongStateError):
    """A height cannot be computed yet, because the autopilot has not sent the position of its home."""


@dataclass(frozen=True, slots=True)
class SimulationVerdict:
    """Whether an autopilot is simulated, by its own data; None while that is not enough. `why` gives the reason."""

    is_simulated: bool | None
    why: str = ""


@dataclass(frozen=True, slots=True)
class Event:
    """What an autopilot's event says: that it was armed or disarmed, the reason of a refusal, what triggers a failsafe;
    perhaps nothing of these.

    `boot_s` is when it happened, as time since the autopilot's boot. `begins_report` is whether a report of all its
    checks begins, in which each further event names a check that fails (`is_check`).
    """

    boot_s: float
    armed: bool | None = None
    text: str = ""
    cause: Cause | None = None
    begins_report: bool = False
    is_check: bool = False


class Dialect(ABC):
    """One kind of autopilot. Stateless: callers pass everything that it needs."""

    name: str
    limitation = ""
    """See `ual_daemon.backends.values.VehicleInfo`."""
    capabilities: frozenset[Capability] = frozenset()
    sends_landed_state = False
    """Whether EXTENDED_SYS_STATE is sure to come."""
    flies_takeoff_on_setpoints = True
    """See `ual_daemon.backends.values.VehicleInfo`."""
    takes_feed_forward = False
    """Whether it adds the accelerations of setpoints to those of its controllers, so that `FeedForward` helps it."""
    pilots_modes: frozenset[str] = frozenset()
    """Names of the modes that are flown by sticks."""
    names_intended_mode = False
    """Whether it reports which mode it was asked for beside the one that flies: another one is then a failsafe's."""
    stays_without_setpoints = False
    """Whether it stays in the mode that takes setpoints when none come, and reports its target there."""
    freshness = Freshness(link_s=1.0, pose_s=1.2, mode_s=5.0, landed_s=1.5, estimator_s=3.0)
    """Chosen for PX4's slowest rates without a request: heartbeat and estimator status 1 Hz, landed state 5 Hz,
    position 30 Hz. They are long enough that on a link that loses and damages 40 % every requested value comes in time,
    over years of flying (a late heartbeat is requested ten times a second). The link's limit is the shortest: when
    nothing comes at all, the lost link is what to report."""
    unarmable_modes: frozenset[str] = frozenset()
    """Names of the modes in which it always refuses to be armed."""
    estimator_message: int = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    """The message whose `flags` describe the estimator."""
    sparse_messages: frozenset[int] = frozenset()
    """Streamed messages that come far less often than requested while nothing changes."""
    optional_messages: frozenset[int] = frozenset()
    """Streamed messages that may never come: what they are about need not be there."""
    wanted_messages: tuple[int, ...] = ()
    """Messages that are needed once and sent only on request or on a change."""
    changing_messages: frozenset[int] = frozenset()
    """Those of `wanted_messages` that are requested again now and then, as a lost change of them would matter."""
    parameters: tuple[str, ...] = ()
    """Parameters to read: those that `limits` and `own_fence` use."""
    optional_parameters: frozenset[str] = frozenset()
    """Those of `parameters` that it need not have."""

    @abstractmethod
    def mode(self, custom_mode: int) -> Mode:
        """Returns the mode that a heartbeat gives as a number."""

    def estimator(self, flags: int) -> Estimator:
        """Returns what the flags of `estimator_message` mean."""
        missing = [name for flag, name in _ESTIMATOR_NEEDS.items() if not flags & flag]
        return Estimator(not missing, f"no {', '.join(missing)}" if missing else "")

    @abstractmethod
    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        """Returns the autopilot's own projection at the origin of its local frame."""

    @abstractmethod
    def streams(self, pose_rate_hz: float) -> list[CommandLong]:
        """Returns the requests for the messages that we need as streams."""

    def parameter_value(self, message: Message) -> float | None:
        """Returns the value in a PARAM_VALUE; None for a type that the autopilot is not known to send."""
        return float(message.param_value) if message.param_type == mavlink.MAV_PARAM_TYPE_REAL32 else None

    @abstractmethod
    def judge_simulation(
        self, version: Message | None, parameters: Mapping[str, float], system_id: int
    ) -> SimulationVerdict:
        """Judges by its AUTOPILOT_VERSION and the parameters read so far whether it is simulated."""

    def event(self, frame: Frame, mode: str) -> Event | None:
        """Returns the content of a frame of PX4's event interface, in the mode of this name; None where this autopilot
        has no such interface.
        """
        return None

    def cause_of_text(self, text: str) -> Cause | None:
        """Returns the failsafe that a status text announces; None for any other text."""
        return None

    def failsafe_of_sensors(self, failing: int, healthy_once: int) -> Cause | None:
        """Returns the failsafe that its sensors show (bits of MAV_SYS_STATUS): those that fail now, and those that have
        been healthy since it is heard.
        """
        return None

    def can_be_armed_in(self, mode: str) -> bool:
        """Returns whether it can be armed in the mode of this name; `arm` leaves those in which it cannot."""
        return mode not in self.unarmable_modes

    def is_multirotor(self, vtol_state: int, parameters: Mapping[str, float]) -> bool:
        """Returns whether it can be the multirotor that its heartbeat says, by its MAV_VTOL_STATE and its parameters.

        A VTOL may be set up to call itself a quadrotor.
        """
        return True

    @abstractmethod
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        """Returns its limits, by the parameters read so far."""

    def cruise_speed_m_s(self, parameters: Mapping[str, float]) -> float:
        """Returns the horizontal speed at which it flies to a goal by itself; infinite where that is its limit."""
        return math.inf

    def acceleration_share(self, parameters: Mapping[str, float]) -> float:
        """Returns the part of its own acceleration limits that `limits` has; 1 where they were not read."""
        return 1.0

    def setpoints_lost_s(self, parameters: Mapping[str, float]) -> float:
        """Returns after how long without setpoints it leaves the mode in which it follows them, by itself.

        Setpoints that come again then bring it back unasked, so UAL must not go on after as long a gap.
        """
        return math.inf

    def own_fence(self, parameters: Mapping[str, float], *, is_enabled: bool) -> OwnFence:
        """Returns the fence that it applies itself, by the parameters read so far.

        `is_enabled` says that its SYS_STATUS shows a fence in use: a switch may have enabled it.
        """
        return NO_FENCE

    @abstractmethod
    def encode_setpoint(
        self, setpoint: Setpoint, system_id: int, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        """Returns the message of a setpoint; `parameters` are those read so far.

        Raises:
            NotSupportedError: UAL does not fly this autopilot. The same holds for the commands below.

        """

    def encode_external_pose(self, measured: ExternalPose) -> Message:
        """Returns the message of a pose from outside, for an autopilot whose `capabilities` have EXTERNAL_POSE."""
        raise NotSupportedError(f"{self.name} takes no poses from outside")

    @abstractmethod
    def arm(self, snapshot: Snapshot) -> CommandLong:
        """Arms, never by force; from a mode in which it cannot be armed, by way of one in which it can."""

    def disarm(self) -> CommandLong:
        """Disarms, never by force."""
        return arm_or_disarm(is_arming=False)

    @abstractmethod
    def take_off(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> CommandLong:
        """Climbs to a height above where it stands by this snapshot.

        `is_slower`: the climb speed in force is below its own, so it is not to climb all the way by itself.

        Raises:
            HomeUnknownError: The snapshot lacks what the autopilot's height is computed from.
            WrongStateError: The autopilot would climb to another height.

        """

    @abstractmethod
    def land(self) -> CommandLong:
        """Lands where it is."""

    @abstractmethod
    def take_control(self) -> CommandLong:
        """Changes to the mode in which it follows our setpoints."""

    @abstractmethod
    def hold(self) -> CommandLong:
        """Changes to a mode in which it holds its position by itself."""

    def version(self, message: Message) -> str:
        """Returns its version, from AUTOPILOT_VERSION."""
        return version_text(message.flight_sw_version)

    def _arm_leaving(self, snapshot: Snapshot, arm: CommandLong, armable_mode: CommandLong) -> CommandLong:
        """Returns `arm`, after `armable_mode` where the present mode forbids it."""
        mode = "" if snapshot.mode is None else snapshot.mode.value.name
        if self.can_be_armed_in(mode):
            return arm
        return replace(armable_mode, what=f"leave {mode}, to be armed", then=arm)


_RELEASE = ("dev", "alpha", "beta", "rc", "")
_RELEASE_STEP = 64


def version_text(number: int) -> str:
    """Returns a version number of MAVLink (FIRMWARE_VERSION_TYPE in the lowest byte) for people: ``1.17.0 rc``."""
    major, minor, patch, release = number >> 24, number >> 16 & 0xFF, number >> 8 & 0xFF, number & 0xFF
    kind = _RELEASE[min(-(-release // _RELEASE_STEP), len(_RELEASE) - 1)]
    return f"{major}.{minor}.{patch} {kind}".rstrip()


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
