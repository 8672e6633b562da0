"""What one autopilot does in its own way, behind one interface; chosen once, by its heartbeat."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping

from ual.errors import NotSupportedError
from ual.types import Capability, Limits
from ual_daemon.backends.mavlink.commands import Command, set_interval
from ual_daemon.backends.mavlink.messages import Message, mavlink
from ual_daemon.backends.values import Control, Mode, Setpoint
from ual_daemon.geodesy import EllipsoidProjection, Projection


class Dialect(ABC):
    """One kind of autopilot. Stateless: everything it needs is handed to it."""

    name: str
    capabilities: frozenset[Capability] = frozenset()
    tells_landed_state = False
    """Whether EXTENDED_SYS_STATE is sure to come."""
    wanted_messages: tuple[int, ...] = ()
    """Messages that are sent only when asked for, needed once."""
    parameters: tuple[str, ...] = ()
    """Parameters to read: those that `limits` understands."""

    @abstractmethod
    def mode(self, custom_mode: int) -> Mode:
        """The mode that a heartbeat names by number."""

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
    def is_simulation(self, version: Message, system_id: int) -> bool:
        """Whether AUTOPILOT_VERSION says that it is simulated."""

    @abstractmethod
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        """Its limits, by the parameters read so far."""

    @abstractmethod
    def setpoint(self, setpoint: Setpoint, system_id: int, time_ms: int) -> Message:
        """The message that carries a setpoint. Raises `NotSupportedError`."""

    @abstractmethod
    def arm(self, *, is_arming: bool) -> Command:
        """Arms or disarms, never by force. Raises `NotSupportedError`, as do the following."""

    @abstractmethod
    def take_off(self, height_m: float) -> Command: ...

    @abstractmethod
    def land(self) -> Command: ...

    @abstractmethod
    def take_control(self) -> Command: ...

    @abstractmethod
    def hold(self) -> Command: ...

    def after_flight(self) -> Command | None:
        """What to send when it was disarmed after we flew it, still in the mode in which it takes our references."""
        return None


class Unknown(Dialect):
    """An autopilot that we do not know: heard by the common messages, never flown."""

    wanted_messages = (mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,)

    def __init__(self, autopilot: int) -> None:
        entry = mavlink.enums["MAV_AUTOPILOT"].get(autopilot)
        name = f"autopilot {autopilot}" if entry is None else entry.name.removeprefix("MAV_AUTOPILOT_").lower()
        self.name = f"unknown ({name})"

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

    def is_simulation(self, version: Message, system_id: int) -> bool:
        return False

    def limits(self, parameters: Mapping[str, float]) -> Limits:
        return Limits()

    def setpoint(self, setpoint: Setpoint, system_id: int, time_ms: int) -> Message:
        raise self._refusal()

    def arm(self, *, is_arming: bool) -> Command:
        raise self._refusal()

    def take_off(self, height_m: float) -> Command:
        raise self._refusal()

    def land(self) -> Command:
        raise self._refusal()

    def take_control(self) -> Command:
        raise self._refusal()

    def hold(self) -> Command:
        raise self._refusal()

    def _refusal(self) -> NotSupportedError:
        return NotSupportedError(
            f"this version of UAL only watches an autopilot that is {self.name}; it flies PX4", {"autopilot": self.name}
        )


_RELEASE = ("dev", "alpha", "beta", "rc", "")
_RELEASE_STEP = 64


def version_text(number: int) -> str:
    """A version number of MAVLink (FIRMWARE_VERSION_TYPE in the lowest byte) for people: ``1.17.0``, ``1.17.0 rc``."""
    major, minor, patch, release = number >> 24, number >> 16 & 0xFF, number >> 8 & 0xFF, number & 0xFF
    kind = _RELEASE[min(-(-release // _RELEASE_STEP), len(_RELEASE) - 1)]
    return f"{major}.{minor}.{patch} {kind}".rstrip()
