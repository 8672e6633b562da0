"""Chooses the dialect of an autopilot."""

from __future__ import annotations

from typing import NamedTuple

from ual_daemon.backends.firmwares.autopilot import MULTIROTORS
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.dialects.unknown import Unaddressed, Unknown, autopilot_text, vehicle_text
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

_NO_VEHICLES = frozenset(
    {
        mavlink.MAV_TYPE_ANTENNA_TRACKER,
        mavlink.MAV_TYPE_GCS,
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_TYPE_GIMBAL,
        mavlink.MAV_TYPE_ADSB,
        mavlink.MAV_TYPE_CAMERA,
        mavlink.MAV_TYPE_CHARGING_STATION,
        mavlink.MAV_TYPE_FLARM,
        mavlink.MAV_TYPE_SERVO,
        mavlink.MAV_TYPE_ODID,
        mavlink.MAV_TYPE_BATTERY,
        mavlink.MAV_TYPE_PARACHUTE,
        mavlink.MAV_TYPE_LOG,
        mavlink.MAV_TYPE_OSD,
        mavlink.MAV_TYPE_IMU,
        mavlink.MAV_TYPE_GPS,
        mavlink.MAV_TYPE_WINCH,
    }
)
"""Types that run an autopilot's firmware or use its component id, and are no vehicle."""


_NO_FIRMWARE = frozenset({mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_AUTOPILOT_GENERIC, mavlink.MAV_AUTOPILOT_RESERVED})
"""Autopilots of heartbeats that name no firmware."""


class HeartbeatKind(NamedTuple):
    """Kind of a heartbeat's sender: MAV_AUTOPILOT and MAV_TYPE."""

    autopilot: int
    vehicle: int

    @property
    def is_autopilot(self) -> bool:
        """Whether it says that it is an autopilot: ground stations, cameras and companion computers do not."""
        return self.autopilot != int(mavlink.MAV_AUTOPILOT_INVALID)

    @property
    def names_firmware(self) -> bool:
        """Whether it says which autopilot it is."""
        return self.autopilot not in _NO_FIRMWARE

    @property
    def names_vehicle(self) -> bool:
        """Whether it says which vehicle it is on."""
        return self.is_vehicle and self.vehicle != int(mavlink.MAV_TYPE_GENERIC)

    @property
    def is_vehicle(self) -> bool:
        """Whether it moves: an antenna tracker does not."""
        return self.vehicle not in _NO_VEHICLES


def kind_of(heartbeat: Message) -> HeartbeatKind:
    """Returns what a heartbeat says of its sender."""
    return HeartbeatKind(heartbeat.autopilot, heartbeat.type)


def kind_text(kind: HeartbeatKind) -> str:
    """Returns a human-readable kind."""
    if not kind.is_autopilot:
        return f"a {vehicle_text(kind.vehicle)}"
    return f"{autopilot_text(kind.autopilot)} on a {vehicle_text(kind.vehicle)}"


def dialect_of(kind: HeartbeatKind, *, is_addressable: bool = True) -> Dialect:
    """Returns the dialect of an autopilot of this kind. One that is not addressable is only listened to."""
    autopilot, vehicle = kind
    if not is_addressable:
        return Unaddressed(autopilot, vehicle)
    if vehicle in MULTIROTORS and autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return Px4()
    if vehicle in MULTIROTORS and autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        return ArduCopter()
    return Unknown(autopilot, vehicle)
