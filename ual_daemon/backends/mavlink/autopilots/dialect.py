"""What one autopilot does in its own way, behind one interface; chosen once, by its heartbeat."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from ual.errors import NotSupportedError
from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.autopilots.px4_events import Event
from ual_daemon.backends.mavlink.session.commands import Command, set_interval
from ual_daemon.backends.mavlink.wire.frames import Frame
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import Control, Estimator, Freshness, Mode, Setpoint, Snapshot
from ual_daemon.geodesy import EllipsoidProjection, Projection

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
"""The vehicles (MAV_TYPE) that are flown. Others need other setpoints, and ArduPilot's have the same numbers for other
modes."""
NO_PARAMETERS: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Reality:
    """Whether an autopilot is simulated, by what it says of itself: None while it has not said enough. `why` not."""

    is_simulated: bool | None
    why: str = ""


class Dialect(ABC):
    """One kind of autopilot. Stateless: everything it needs is handed to it."""

    name: str
    capabilities: frozenset[Capability] = frozenset()
    tells_landed_state = False
    """Whether EXTENDED_SYS_STATE is sure to come."""
    flies_takeoff_on_setpoints = True
    """See `ual_daemon.backends.values.VehicleInfo`."""
    takes_feed_forward = False
    """Whether it is told what was learnt of it, see `feed_forward`: where it adds accelerations to its controllers'."""
    freshness = Freshness(link_s=1.0, pose_s=1.2, mode_s=5.0, landed_s=1.5, estimator_s=3.0)
    """By PX4's slowest unasked rates: heartbeat and estimator status 1 Hz, landed state 5 Hz, position 30 Hz; and so
    long that on a link that loses and damages 40 % none of what is asked for fails to come in time, in years of flying.
    (A late heartbeat is asked for ten times a second.) The link's is the shortest: when nothing comes at all, that is
    what is to be said."""
    unarmable_modes: frozenset[str] = frozenset()
    """Names of the modes in which it always refuses to be armed."""
    estimator_message: int = mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
    """The message whose `flags` tell of the estimator."""
    sparse_messages: frozenset[int] = frozenset()
    """Of the messages asked to be streamed those that come far less often than asked for where nothing changes."""
    wanted_messages: tuple[int, ...] = ()
    """Messages that are sent only when asked for, or when they change, needed once."""
    changing_messages: frozenset[int] = frozenset()
    """Of these, those whose change matters so much that they are asked for now and then: one that was pushed may have
    been lost."""
    parameters: tuple[str, ...] = ()
    """Parameters to read: those that `limits` understands."""

    @abstractmethod
    def mode(self, custom_mode: int) -> Mode:
        """The mode that a heartbeat names by number."""

    def estimator(self, flags: int) -> Estimator:
        """What the flags of `estimator_message` say."""
        missing = [name for flag, name in _ESTIMATOR_NEEDS.items() if not flags & flag]
        return Estimator(not missing, f"no {', '.join(missing)}" if missing else "")

    @abstractmethod
    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        """The autopilot's own projection at the origin of its local frame."""

    @abstractmethod
    def streams(self, pose_rate_hz: float) -> list[Command]:
        """What to ask so that it streams what we need."""

    @abstractmethod
    def version(self, message: Message) -> str:
        """Its version, from AUTOPILOT_VERSION."""

    @abstractmethod
    def reality(self, version: Message | None, parameters: Mapping[str, float], system_id: int) -> Reality:
        """Whether its AUTOPILOT_VERSION and the parameters read so far say that it is simulated."""

    def event(self, frame: Frame, mode: str) -> Event | None:
        """What a message of PX4's event interface tells, in a mode of this name; None where it is no such autopilot."""
        return None

    def can_be_armed_in(self, mode: str) -> bool:
        """Whether it can be armed in a mode of this name; `arm` leaves those in which it cannot."""
        return mode not in self.unarmable_modes

    @abstractmethod
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        """Its limits, by the parameters read so far."""

    @abstractmethod
    def setpoint(
        self, setpoint: Setpoint, system_id: int, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        """The message that carries a setpoint; `parameters` are those read so far. Raises `NotSupportedError`."""

    @abstractmethod
    def arm(self, snapshot: Snapshot) -> Command:
        """Arms, never by force; from a mode in which nobody can arm it, by way of one in which one can. Raises
        `NotSupportedError`, as do the following.
        """

    @abstractmethod
    def disarm(self) -> Command:
        """Disarms, never by force."""

    @abstractmethod
    def take_off(self, height_m: float, snapshot: Snapshot) -> Command:
        """To a height above where it stands by this snapshot."""

    @abstractmethod
    def land(self) -> Command: ...

    @abstractmethod
    def take_control(self) -> Command: ...

    @abstractmethod
    def hold(self) -> Command: ...


class Unknown(Dialect):
    """An autopilot that we do not know, or on another vehicle: heard by the common messages, never flown."""

    wanted_messages = (mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,)

    def __init__(self, autopilot: int, kind: int = mavlink.MAV_TYPE_GENERIC) -> None:
        entry = mavlink.enums["MAV_AUTOPILOT"].get(autopilot)
        name = f"autopilot {autopilot}" if entry is None else entry.name.removeprefix("MAV_AUTOPILOT_").lower()
        vehicle = mavlink.enums["MAV_TYPE"].get(kind)
        of = "" if vehicle is None or kind == mavlink.MAV_TYPE_GENERIC else f", {_plain(vehicle.name)}"
        self.name = f"unknown ({name}{of})"

    def mode(self, custom_mode: int) -> Mode:
        return Mode(f"mode {custom_mode}", Control.OTHER)

    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        return EllipsoidProjection(latitude_deg, longitude_deg, altitude_amsl_m)

    def streams(self, pose_rate_hz: float) -> list[Command]:
        return [
            set_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 5.0),
            set_interval(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, 2.0),
            set_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION, pose_rate_hz),
            set_interval(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, pose_rate_hz),
            set_interval(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 5.0),
            set_interval(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 2.0),
            set_interval(mavlink.MAVLINK_MSG_ID_SYS_STATUS, 2.0),
        ]

    def version(self, message: Message) -> str:
        return version_text(message.flight_sw_version)

    def reality(self, version: Message | None, parameters: Mapping[str, float], system_id: int) -> Reality:
        return Reality(False, "UAL does not know how its simulators tell that they are")

    def limits(self, parameters: Mapping[str, float]) -> Limits:
        return Limits()

    def setpoint(
        self, setpoint: Setpoint, system_id: int, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        raise self._refusal()

    def arm(self, snapshot: Snapshot) -> Command:
        raise self._refusal()

    def disarm(self) -> Command:
        raise self._refusal()

    def take_off(self, height_m: float, snapshot: Snapshot) -> Command:
        raise self._refusal()

    def land(self) -> Command:
        raise self._refusal()

    def take_control(self) -> Command:
        raise self._refusal()

    def hold(self) -> Command:
        raise self._refusal()

    def _refusal(self) -> NotSupportedError:
        return NotSupportedError(
            f"UAL only watches an autopilot that is {self.name}; it flies PX4 and ArduPilot multirotors",
            {"autopilot": self.name},
        )


def _plain(name: str) -> str:
    return name.removeprefix("MAV_TYPE_").replace("_", " ").lower()


_RELEASE = ("dev", "alpha", "beta", "rc", "")
_RELEASE_STEP = 64


def version_text(number: int) -> str:
    """A version number of MAVLink (FIRMWARE_VERSION_TYPE in the lowest byte) for people: ``1.17.0``, ``1.17.0 rc``."""
    major, minor, patch, release = number >> 24, number >> 16 & 0xFF, number >> 8 & 0xFF, number & 0xFF
    kind = _RELEASE[min(-(-release // _RELEASE_STEP), len(_RELEASE) - 1)]
    return f"{major}.{minor}.{patch} {kind}".rstrip()
