"""A safety pilot at ArduCopter's simulator: a transmitter, and a ground station's link to arm by."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Sequence

from pymavlink.dialects.v20 import all as mavlink

from tests.sitl.transmitter import PATIENCE_S, Transmitter
from ual_daemon.backends.mavlink.wire.frames import FrameReader, MavlinkFrame
from ual_daemon.backends.mavlink.wire.messages import Message

GROUND_STATION_ID = 254
FIRST_PORT, FIRST_STICKS_PORT = 5762, 5501
SWITCH_LOITER, SWITCH_GUIDED = 1700, 1500
GUIDED = 4
SWITCH_S = 1.0
"""ArduPilot takes a switch for moved when it has stood for 0.2 s, and says nothing where that changes no mode."""
_LOW, _MIDDLE, _HALF_WAY = 1000, 1500, 500
_STREAMS = {
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 4.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 10.0,
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 10.0,
}


class CopterPilot(Transmitter):
    """Holds the transmitter: throttle low on the ground, in the middle in the air. The switch of the flight mode is
    channel 5, as ``copter.parm`` of ArduPilot's tests has it, with GUIDED (``FLTMODE4 4``) where nobody takes over. The
    pilot flies in LOITER.

    `port` is one of the simulator's TCP ports for ground stations (5762 + 10 * instance). `sticks_port` is where the
    simulator hears the transmitter (None: 5501 + 10 * instance).
    """

    autopilot = "ArduCopter"
    sticks_s = 0.025
    home_items_count = 1
    heard_messages = frozenset({*_STREAMS, mavlink.MAVLINK_MSG_ID_STATUSTEXT})

    def __init__(self, host: str, port: int, *, sticks_port: int | None = None) -> None:
        super().__init__(socket.create_connection((host, port), timeout=PATIENCE_S), GROUND_STATION_ID)
        self._sticks_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sticks_address = (host, FIRST_STICKS_PORT + port - FIRST_PORT if sticks_port is None else sticks_port)
        self._reader = FrameReader()
        self.switch = SWITCH_GUIDED
        self.landed_state = mavlink.MAV_LANDED_STATE_UNDEFINED
        self._thread.start()

    def close(self) -> None:
        super().close()
        self._sticks_socket.close()

    def begin(self) -> None:
        self._wait(lambda: bool(self._system_id), "there")
        for message_id, rate_hz in _STREAMS.items():
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (float(message_id), 1e6 / rate_hz))

    def wait_until_ready(self) -> None:
        self.switch = SWITCH_GUIDED  # not before: flipping it back in the air would be taking over again
        if self.mode != GUIDED:  # the switch stands there already, so that only a ground station can change it
            self.set_mode(GUIDED, GUIDED)
        self._wait(lambda: self.is_ready, "ready to be armed")

    def take_over(self) -> None:
        self.switch = SWITCH_LOITER

    def lose_signal(self) -> None:
        self.set_parameter("SIM_RC_FAIL", 1.0)

    def find_signal(self) -> None:
        self.set_parameter("SIM_RC_FAIL", 0.0)

    def stand_by(self) -> None:
        if self.switch != SWITCH_GUIDED:
            self.switch = SWITCH_GUIDED
            time.sleep(SWITCH_S)

    def _hold_sticks(self, count: int) -> None:
        if self.landed_state == mavlink.MAV_LANDED_STATE_UNDEFINED:
            return  # a throttle in the middle would keep it from being armed
        s = self.sticks
        is_landed = self.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
        throttle = _LOW if is_landed else _MIDDLE + s.up * _HALF_WAY
        roll, pitch, yaw = (_MIDDLE + each * _HALF_WAY for each in (s.right, -s.forward, s.turn_right))
        channels = (roll, pitch, throttle, yaw, self.switch, _MIDDLE, _MIDDLE, _MIDDLE)
        self._sticks_socket.sendto(struct.pack("<8H", *(int(each) for each in channels)), self._sticks_address)

    def _send(self, data: bytes) -> None:
        self._link.sendall(data)

    def _frames(self, data: bytes) -> Sequence[MavlinkFrame]:
        return self._reader.feed(data)

    def _take(self, message: Message) -> None:
        super()._take(message)
        if isinstance(message, mavlink.MAVLink_extended_sys_state_message):
            self.landed_state = message.landed_state
