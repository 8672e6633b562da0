"""The camera that a simulated autopilot triggers: by ArduPilot's AP_Camera, or PX4's camera_trigger."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.physics import Vector, minus

if TYPE_CHECKING:
    from tests.simulators.autopilot import Autopilot

ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
FAILED: int = mavlink.MAV_RESULT_FAILED
SHOOT: int = mavlink.MAV_CMD_DO_DIGICAM_CONTROL
DISTANCE: int = mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST
START_CAPTURE: int = mavlink.MAV_CMD_IMAGE_START_CAPTURE


class Trigger:
    """Made, it is carried. `places` are where it has taken pictures."""

    def __init__(self, autopilot: Autopilot) -> None:
        self.places: list[Vector] = []
        self.works = True
        """Whether its camera can be triggered now."""
        self.unreported: set[int] = set()
        """The numbers of pictures whose reports are lost."""
        self._autopilot = autopilot
        self._distance_m = 0.0
        self._last: Vector | None = None
        self._is_px4 = autopilot.autopilot == mavlink.MAV_AUTOPILOT_PX4
        self.commands = frozenset({SHOOT, DISTANCE} if self._is_px4 else {SHOOT, DISTANCE, START_CAPTURE})
        with autopilot.lock:
            autopilot.trigger = self

    def obey(self, command: int, params: tuple[float, ...]) -> int:
        """Takes a command. Returns the result (MAV_RESULT)."""
        if command == START_CAPTURE:
            return ACCEPTED if params[2] == 1.0 and self._take() else FAILED
        if command == DISTANCE:
            self._distance_m, self._last = params[0], self._autopilot.position
            if params[2] == 1.0:
                self._take()
        elif params[4] == 1.0:
            self._take()
        return ACCEPTED

    def boot(self) -> None:
        """Forgets all: its numbers begin again, as the autopilot's memory does."""
        self.places, self.unreported, self._distance_m = [], set(), 0.0

    def step(self) -> None:
        """Takes the picture that is due by distance."""
        if self._distance_m and self._last is not None:
            north, east, _ = minus(self._autopilot.position, self._last)
            if math.hypot(north, east) >= self._distance_m:
                self._take()

    def _take(self) -> bool:
        if not self.works:
            return False
        autopilot, number = self._autopilot, len(self.places)
        self._last = autopilot.position
        self.places.append(autopilot.position)
        latitude, longitude, altitude = autopilot.geo(autopilot.position)
        if number in self.unreported:
            return True
        if self._is_px4:
            said = mavlink.MAVLink_camera_image_captured_message(
                autopilot.time_ms, 0, 1, latitude, longitude, altitude, -1000, (1.0, 0.0, 0.0, 0.0), number, 1, b""
            )
        else:
            place = (latitude, longitude, altitude / 1e3, 0.0)
            said = mavlink.MAVLink_camera_feedback_message(0, 0, 0, number, *place, 0.0, 0.0, 0.0, 0.0, 0, 0)
        for channel in autopilot.channels:
            channel.send(said, autopilot.elapsed_s)
        return True
