"""A motion capture system around a simulated UAV: its true poses with noise, as poses from outside."""

from __future__ import annotations

import math
import random
import threading
import time
from dataclasses import replace

from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.transmitter import Transmitter
from ual.errors import UalError
from ual.geometry import Pose, PoseStamped, Quaternion, Vector3
from ual.interface import Uav
from ual_daemon.backends.mavlink.dialects.axes import orientation_to_enu
from ual_daemon.backends.mavlink.wire.messages import Message

RATE_HZ = 50.0
NOISE_M = 0.005
_LATITUDE_M = 111_195.0
_TRUTH_HZ = 100.0


class Outside:
    """Measures from its first moment on, and gives poses in ``map`` while it `is_on`; its origin is `origin` there.

    The place of the simulator comes in steps of 1 cm, the autopilots' own resolution of latitudes.
    """

    def __init__(self, uav: Uav, pilot: Transmitter, origin: Vector3 | None = None) -> None:
        self._uav = uav
        self._origin = origin or Vector3()
        self._first: tuple[float, float, float] | None = None
        self._random = random.Random(1)
        self._newest: PoseStamped | None = None
        self._is_closing = threading.Event()
        self.is_on = True
        self.given_count = 0
        self.refusals: list[UalError] = []
        pilot.listen(mavlink.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, _TRUTH_HZ, self._hear)
        pilot.listen(mavlink.MAVLINK_MSG_ID_SIM_STATE, _TRUTH_HZ, self._hear)
        self._thread = threading.Thread(target=self._run, name="motion capture")
        self._thread.start()

    def close(self) -> None:
        self._is_closing.set()
        self._thread.join()

    @property
    def pose(self) -> Pose:
        """True pose."""
        assert self._newest is not None
        return self._newest.pose

    def _hear(self, message: Message) -> None:
        if isinstance(message, mavlink.MAVLink_hil_state_quaternion_message):
            place = (message.lat / 1e7, message.lon / 1e7, message.alt / 1e3)
            self._measure(place, orientation_to_enu(*message.attitude_quaternion))
        elif isinstance(message, mavlink.MAVLink_sim_state_message):
            place = (message.lat_int / 1e7, message.lon_int / 1e7, message.alt)
            self._measure(place, orientation_to_enu(message.q1, message.q2, message.q3, message.q4))

    def _measure(self, place: tuple[float, float, float], orientation: Quaternion) -> None:
        self._newest = PoseStamped(Pose(self._position(*place), orientation), "map", time.time())

    def _position(self, latitude_deg: float, longitude_deg: float, altitude_m: float) -> Vector3:
        first = self._first = self._first or (latitude_deg, longitude_deg, altitude_m)
        east_m = (longitude_deg - first[1]) * _LATITUDE_M * math.cos(math.radians(first[0]))
        north_m = (latitude_deg - first[0]) * _LATITUDE_M
        return self._origin + Vector3(east_m, north_m, altitude_m - first[2])

    def _run(self) -> None:
        last: PoseStamped | None = None
        while not self._is_closing.wait(1.0 / RATE_HZ):
            newest = self._newest
            if newest is not None and newest is not last and self.is_on:
                last = newest
                self._give(replace(newest, pose=replace(newest.pose, position=newest.pose.position + self._noise())))

    def _noise(self) -> Vector3:
        return Vector3(*(self._random.gauss(0.0, NOISE_M) for _ in range(3)))

    def _give(self, measured: PoseStamped) -> None:
        try:
            self._uav.set_external_pose(measured, position_std_dev_m=NOISE_M)
            self.given_count += 1
        except UalError as error:
            self.refusals.append(error)
