"""Vehicle as its simulator has it, whatever the autopilot or the daemon says."""

from __future__ import annotations

import math
import time

from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.transmitter import PATIENCE_S, Transmitter
from tests.waiting import until
from ual_daemon.backends.mavlink.wire.messages import Message

FALLS_M_S = 3.0
"""Faster than any descent of these flights."""
_NEAR_GROUND_M, _AT_REST_M_S = 1.0, 0.3
_STANDS_S = 0.3
"""Longer than any moment at rest in a fall."""
_RATE_HZ = 20.0
_LATITUDE_M = 111_195.0


class Truth:
    """Height over the place where it stood, place on Earth, and velocity. `fell_s` is when it first fell."""

    def __init__(self, pilot: Transmitter) -> None:
        self.height_m = self.down_m_s = self.speed_m_s = 0.0
        self.place_deg = (0.0, 0.0)
        self._at_rest_s: float | None = None
        self._ground_m: float | None = None
        self._pilot = pilot
        self.fell_s: float | None = None
        self.ask()

    def ask(self) -> None:
        """Asks for the truth, which comes until the autopilot boots."""
        is_px4 = self._pilot.autopilot == "PX4"
        wanted = mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION if is_px4 else mavlink.MAVLINK_MSG_ID_SIM_STATE
        self._pilot.listen(wanted, _RATE_HZ, self._take)

    def begin_at_rest(self) -> None:
        """Begins once it stands: what the test before has disarmed in the air may still fall."""
        until(lambda: self._stands_s() > _STANDS_S, "that it stands", limit_s=PATIENCE_S)
        self._ground_m, self.fell_s = None, None

    def _stands_s(self) -> float:
        return 0.0 if self._at_rest_s is None else time.monotonic() - self._at_rest_s

    @property
    def is_down(self) -> bool:
        """Whether it is at rest near the ground."""
        return self.height_m < _NEAR_GROUND_M and abs(self.down_m_s) < _AT_REST_M_S

    def distance_m(self, place_deg: tuple[float, float]) -> float:
        """Returns the distance from a place on Earth, latitude and longitude, along the ground."""
        (latitude_deg, longitude_deg), (to_latitude_deg, to_longitude_deg) = self.place_deg, place_deg
        east_m = (longitude_deg - to_longitude_deg) * _LATITUDE_M * math.cos(math.radians(latitude_deg))
        return math.hypot(east_m, (latitude_deg - to_latitude_deg) * _LATITUDE_M)

    def _take(self, message: Message) -> None:
        if isinstance(message, mavlink.MAVLink_hil_state_quaternion_message):
            self.place_deg, altitude_m = (message.lat / 1e7, message.lon / 1e7), message.alt / 1e3
            velocity = message.vx / 100.0, message.vy / 100.0, message.vz / 100.0
        else:
            self.place_deg, altitude_m = (message.lat_int / 1e7, message.lon_int / 1e7), message.alt
            velocity = message.vn, message.ve, message.vd
        self.speed_m_s, self.down_m_s = math.hypot(*velocity[:2]), velocity[2]
        if self._ground_m is None:
            self._ground_m = altitude_m
        self.height_m = altitude_m - self._ground_m
        is_at_rest = math.hypot(self.speed_m_s, self.down_m_s) < _AT_REST_M_S
        self._at_rest_s = (self._at_rest_s or time.monotonic()) if is_at_rest else None
        if self.fell_s is None and self.down_m_s > FALLS_M_S:
            self.fell_s = time.monotonic()
