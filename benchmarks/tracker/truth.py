"""True pose of a simulated UAV: the simulator reports it over MAVLink, beside the autopilot's estimate."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.transmitter import Transmitter
from ual.geometry import Vector3
from ual_daemon.backends.mavlink.wire.messages import Message

RATE_HZ = 50.0
_LATITUDE_M = 111_195.0
"""Metres in a degree of latitude. A line of 60 m is 0.1 m too long or too short with it."""


class Truth:
    """The true place, in metres east, north and up from where it was first reported; from any thread."""

    def __init__(self) -> None:
        self.position: Vector3 | None = None
        self.boot_s = 0.0
        """The simulator's own time, which passes more slowly than the computer's where that is too busy."""
        self._first: tuple[float, float, float] | None = None

    def listen(self, pilot: Transmitter) -> None:
        """Asks both for PX4's message and for ArduPilot's; each has only its own."""
        pilot.listen(mavlink.MAVLINK_MSG_ID_ATTITUDE, RATE_HZ, self._hear)
        pilot.listen(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, RATE_HZ, self._hear)
        pilot.listen(mavlink.MAVLINK_MSG_ID_SIM_STATE, RATE_HZ, self._hear)

    def _hear(self, message: Message) -> None:
        if isinstance(message, mavlink.MAVLink_hil_state_quaternion_message):
            self._take(message.lat / 1e7, message.lon / 1e7, message.alt / 1e3)
        elif isinstance(message, mavlink.MAVLink_sim_state_message):
            self._take(message.lat_int / 1e7, message.lon_int / 1e7, message.alt)
        elif isinstance(message, mavlink.MAVLink_attitude_message):
            self.boot_s = message.time_boot_ms / 1e3

    def _take(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> None:
        first = self._first = self._first or (latitude_deg, longitude_deg, altitude_m)
        east_m = (longitude_deg - first[1]) * _LATITUDE_M * math.cos(math.radians(first[0]))
        self.position = Vector3(east_m, (latitude_deg - first[0]) * _LATITUDE_M, altitude_m - first[2])
