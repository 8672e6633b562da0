"""An autopilot that UAL does not fly: only its telemetry is read."""

from __future__ import annotations

from collections.abc import Mapping

from typing_extensions import override

from ual.errors import NotSupportedError
from ual.types import Limits
from ual_daemon.backends.firmwares.autopilot import NO_PARAMETERS, AutopilotBoard, SimulationVerdict
from ual_daemon.backends.mavlink.dialects.command_long import (
    LongCommand,
    pose_streams,
    set_message_interval,
    slow_streams,
)
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink, member_name
from ual_daemon.backends.values import Control, Mode, Setpoint, Snapshot
from ual_daemon.geodesy import EllipsoidProjection, Projection


class Unknown(Dialect):
    """An unknown autopilot, or a known one on a vehicle that is not a multirotor: read by the common messages."""

    wanted_messages: tuple[int, ...] = (mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,)
    optional_messages = frozenset({mavlink.MAVLINK_MSG_ID_BATTERY_STATUS})

    def __init__(self, autopilot: int, kind: int = mavlink.MAV_TYPE_GENERIC) -> None:
        of = "" if kind == mavlink.MAV_TYPE_GENERIC else f", {vehicle_text(kind)}"
        self.name = f"unknown ({autopilot_text(autopilot)}{of})"
        if autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
            self.estimator_message = mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT  # with the same flags
        self.limitation = f"UAL only watches an autopilot that is {self.name}; it flies PX4 and ArduPilot multirotors"

    @override
    def mode(self, custom_mode: int) -> Mode:
        return self.mode_named(f"number {custom_mode}")  # told with "mode" before it

    @override
    def mode_named(self, name: str) -> Mode:
        return Mode(name, Control.OTHER)

    @override
    def projection(self, latitude_deg: float, longitude_deg: float, altitude_amsl_m: float) -> Projection:
        return EllipsoidProjection(latitude_deg, longitude_deg, altitude_amsl_m)

    @override
    def streams(self, pose_rate_hz: float) -> list[LongCommand]:
        return [
            set_message_interval(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 5.0),
            set_message_interval(self.estimator_message, 2.0),
            *pose_streams(pose_rate_hz),
            *slow_streams(),
        ]

    @override
    def judge_simulation(
        self, version: AutopilotBoard | None, parameters: Mapping[str, float], system_id: int
    ) -> SimulationVerdict:
        return SimulationVerdict(False, "UAL cannot recognize a simulator of this autopilot")

    @override
    def limits(self, parameters: Mapping[str, float]) -> Limits:
        return Limits()

    @override
    def encode_setpoint(
        self, setpoint: Setpoint, target: MessageSource, time_ms: int, parameters: Mapping[str, float] = NO_PARAMETERS
    ) -> Message:
        raise self._refusal()

    @override
    def arm(self, snapshot: Snapshot) -> LongCommand:
        raise self._refusal()

    @override
    def disarm(self) -> LongCommand:
        raise self._refusal()

    @override
    def take_off(self, height_m: float, snapshot: Snapshot, *, is_slower: bool = False) -> LongCommand:
        raise self._refusal()

    @override
    def land(self) -> LongCommand:
        raise self._refusal()

    @override
    def take_control(self) -> LongCommand:
        raise self._refusal()

    @override
    def hold(self) -> LongCommand:
        raise self._refusal()

    def _refusal(self) -> NotSupportedError:
        return NotSupportedError(self.limitation, {"autopilot": self.name})


class Unaddressed(Unknown):
    """An autopilot of system 0, which stands for all systems: what is sent to it would reach every vehicle."""

    wanted_messages = ()

    def __init__(self, autopilot: int, kind: int = mavlink.MAV_TYPE_GENERIC) -> None:
        super().__init__(autopilot, kind)
        self.limitation = (
            f"UAL only watches an autopilot that sends as system 0 ({autopilot_text(autopilot)}, "
            f"{vehicle_text(kind)}): what is sent to system 0 reaches every vehicle; give it an id of its own "
            "(PX4: MAV_SYS_ID; ArduPilot: SYSID_THISMAV, from 4.7 on MAV_SYSID)"
        )

    @override
    def streams(self, pose_rate_hz: float) -> list[LongCommand]:
        return []


def autopilot_text(autopilot: int) -> str:
    """Returns a human-readable MAV_AUTOPILOT."""
    name = member_name("MAV_AUTOPILOT", autopilot)
    return f"autopilot {autopilot}" if name is None else name.lower()


def vehicle_text(kind: int) -> str:
    """Returns a human-readable MAV_TYPE."""
    name = member_name("MAV_TYPE", kind)
    return f"vehicle {kind}" if name is None else name.replace("_", " ").lower()
