"""A safety pilot at PX4's ground-station link, as QGroundControl with a joystick would be."""

from __future__ import annotations

import socket
from collections.abc import Sequence

from pymavlink.dialects.v20 import all as mavlink
from typing_extensions import override

from tests.sitl.transmitter import Transmitter
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame, split

GROUND_STATION_ID = 255
_POSCTL = 3
POSCTL, OFFBOARD, _TERMINATION = _POSCTL << 16, 6 << 16, 10 << 16
_HEARTBEATS = 20  # one in so many times of the sticks: 1 Hz


class SafetyPilot(Transmitter):
    """Holds the transmitter: sticks at 20 Hz, without which PX4 counts manual control as lost and returns home. The
    pilot flies in POSCTL.

    `port` is PX4's ground-station link (18570 + instance). PX4 answers for good to the port that it first heard
    there, so it is always the same: 100 above. `local_port` is another, where many are flown (0: any).
    """

    autopilot = "PX4"
    sticks_s = 0.05
    heard_messages = frozenset(
        {mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_STATUSTEXT}
    )

    def __init__(self, host: str, port: int, *, local_port: int | None = None) -> None:
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.bind((host, port + 100 if local_port is None else local_port))
        super().__init__(link, GROUND_STATION_ID)
        self._address = (host, port)
        self._is_heard = True
        self._thread.start()

    @property
    @override
    def is_terminated(self) -> bool:
        return self.mode == _TERMINATION

    def begin(self) -> None:
        self._wait(lambda: bool(self._system_id), "there")
        self._fly_by_hand()

    def wait_until_ready(self) -> None:
        self._fly_by_hand()  # after a landing PX4 goes to OFFBOARD by itself, or stays in LAND
        self._wait(lambda: self.is_ready, "ready to be armed")

    def take_over(self) -> None:
        self._command(mavlink.MAV_CMD_DO_SET_MODE, (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(_POSCTL)))

    def lose_signal(self) -> None:
        self._is_heard = False

    def find_signal(self) -> None:
        self._is_heard = True

    def stand_by(self) -> None:
        """The switch is a button of the ground station, which can be pressed again."""

    def _fly_by_hand(self) -> None:
        if self.mode != POSCTL:
            self.set_mode(POSCTL, _POSCTL)

    def _hold_sticks(self, count: int) -> None:
        if count % _HEARTBEATS == 0:
            self._tell(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
        if self._system_id and self._is_heard:
            s = self.sticks
            axes = (s.forward * 1000, s.right * 1000, 500 + s.up * 500, s.turn_right * 1000)
            self._tell(mavlink.MAVLink_manual_control_message(self._system_id, *(int(each) for each in axes), 0))

    def _send(self, data: bytes) -> None:
        self._link.sendto(data, self._address)

    def _frames(self, data: bytes) -> Sequence[MavlinkFrame]:
        return split(data)[0]
