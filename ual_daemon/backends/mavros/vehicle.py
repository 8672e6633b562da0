"""Vehicle that MAVROS is connected to."""

from __future__ import annotations

from typing import NamedTuple

from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.autopilot import MULTIROTORS, Autopilot
from ual_daemon.backends.firmwares.numbers import Firmware
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.rosbridge import Message

_HAS_HEARTBEAT, _HAS_VERSION = 1, 2


class VehicleDescription(NamedTuple):
    """Description of the autopilot by MAVROS (VehicleInfo). `has_version`: the versions of software and board came."""

    system_id: int
    firmware: int
    kind: int
    has_version: bool
    software_version: int = 0
    board_version: int = 0
    vendor_id: int = 0
    product_id: int = 0
    uid: int = 0

    @property
    def autopilot(self) -> Autopilot | None:
        """Autopilot class in UAL; None where UAL does not fly it."""
        if self.kind not in MULTIROTORS:
            return None
        return {Firmware.PX4: Px4(), Firmware.ARDUPILOT: ArduCopter()}.get(self.firmware)  # type: ignore[call-overload,no-any-return]

    @property
    def text(self) -> str:
        """Human-readable type of the vehicle."""
        return f"autopilot {self.firmware} on a vehicle of type {self.kind} (MAV_AUTOPILOT, MAV_TYPE)"


def read_vehicle(answer: Message) -> VehicleDescription | None:
    """Reads the answer of ``vehicle_info_get``; None while MAVROS has heard no heartbeat.

    Raises:
        KeyError: It is no such answer.
        TypeError: The same.

    """
    vehicles = answer["vehicles"] if answer["success"] else ()
    if not vehicles or not int(vehicles[0]["available_info"]) & _HAS_HEARTBEAT:
        return None
    found = vehicles[0]
    names = ("sysid", "autopilot", "type")
    versions = ("flight_sw_version", "board_version", "vendor_id", "product_id", "uid")
    system_id, firmware, kind = (int(found[name]) for name in names)
    has_version = bool(int(found["available_info"]) & _HAS_VERSION)
    return VehicleDescription(system_id, firmware, kind, has_version, *(int(found[name]) for name in versions))
