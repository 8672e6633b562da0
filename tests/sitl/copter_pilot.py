"""A safety pilot at ArduCopter's simulator: a transmitter, and a ground station's link to arm by."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable

from ual_daemon.backends.mavlink.frames import FrameReader
from ual_daemon.backends.mavlink.messages import Codec, CorruptFrameError, mavlink

PATIENCE_S = 90.0
STICKS_S = 0.025
GROUND_STATION_ID = 254
FIRST_PORT, FIRST_STICKS_PORT = 5762, 5501
SWITCH_LOITER, SWITCH_GUIDED = 1700, 1500
LOITER, GUIDED = 5, 4
_LOW, _MIDDLE = 1000, 1500
_STREAMS = {
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 4.0,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 10.0,
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 10.0,
}
_HEARD = frozenset({*_STREAMS, mavlink.MAVLINK_MSG_ID_STATUSTEXT})


class CopterPilot:
    """Holds the transmitter: throttle low on the ground, in the middle in the air. The switch of the flight mode is
    channel 5, as ``copter.parm`` of ArduPilot's tests has it, with GUIDED (``FLTMODE4 4``) where nobody takes over.

    `port` is one of the simulator's TCP ports for ground stations (5762 + 10 * instance).
    """

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port), timeout=PATIENCE_S)
        self._socket.settimeout(STICKS_S)
        self._sticks_socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sticks_address = (host, FIRST_STICKS_PORT + port - FIRST_PORT)
        self._codec = Codec(mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._codec.join(GROUND_STATION_ID)
        self._changed = threading.Condition()
        self._system_id = 0
        self._reader = FrameReader()
        self.switch = SWITCH_GUIDED
        self.is_ready = False
        self.is_armed = False
        self.mode = -1
        self.landed_state = mavlink.MAV_LANDED_STATE_UNDEFINED
        self.said = ""
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="safety pilot")
        self._thread.start()

    def close(self) -> None:
        self._is_closing = True
        self._thread.join()
        self._socket.close()
        self._sticks_socket.close()

    def begin(self) -> None:
        """As before any day's first flight: it is there, and tells what the pilot must see."""
        self._wait(lambda: bool(self._system_id), "there")
        for message_id, rate_hz in _STREAMS.items():
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (float(message_id), 1e6 / rate_hz))

    def wait_until_ready(self) -> None:
        """Until it may be armed."""
        self._wait(lambda: self.is_ready, "ready to be armed")

    def arm(self) -> None:
        self.switch = SWITCH_GUIDED  # not before: flipping it back in the air would be taking over again
        if self.mode != GUIDED:  # the switch stands there already, so that only a ground station can change it
            self._wait_sending(mavlink.MAV_CMD_DO_SET_MODE, (1.0, GUIDED), lambda: self.mode == GUIDED, "in GUIDED")
        self._wait_sending(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), lambda: self.is_armed, "armed")

    def take_over(self) -> None:
        """Flips the switch to LOITER, and returns at once."""
        self.switch = SWITCH_LOITER

    def _wait_sending(self, command: int, params: tuple[float, ...], is_done: Callable[[], bool], what: str) -> None:
        deadline_s = time.monotonic() + PATIENCE_S
        while not is_done():
            assert time.monotonic() < deadline_s, f"ArduCopter is not {what}; it says {self.said!r}"
            self._command(command, params)
            with self._changed:
                self._changed.wait_for(is_done, timeout=1.5)

    def _wait(self, is_done: Callable[[], bool], what: str) -> None:
        with self._changed:
            assert self._changed.wait_for(is_done, timeout=PATIENCE_S), f"ArduCopter is not {what}: {self.said!r}"

    def _command(self, command: int, params: tuple[float, ...]) -> None:
        padded = (*params, *(0.0,) * (7 - len(params)))
        message = mavlink.MAVLink_command_long_message(self._system_id, 1, command, 0, *padded)
        self._socket.sendall(self._codec.encode(message))

    def _run(self) -> None:
        next_s = time.monotonic()
        while not self._is_closing:
            if time.monotonic() >= next_s:
                next_s += STICKS_S
                is_landed = self.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
                throttle = _LOW if is_landed else _MIDDLE
                if self.landed_state != mavlink.MAV_LANDED_STATE_UNDEFINED:
                    sticks = (_MIDDLE, _MIDDLE, throttle, _MIDDLE, self.switch, _MIDDLE, _MIDDLE, _MIDDLE)
                    self._sticks_socket.sendto(struct.pack("<8H", *sticks), self._sticks_address)
            self._receive()

    def _receive(self) -> None:
        try:
            data = self._socket.recv(4096)
        except TimeoutError:
            return
        for frame in self._reader.feed(data):
            if frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1 and frame.message_id in _HEARD:
                try:
                    message = self._codec.decode(frame)
                except CorruptFrameError:
                    continue
                self._take(frame.system_id, message)

    def _take(self, system_id: int, message: object) -> None:
        with self._changed:
            self._system_id = system_id
            if isinstance(message, mavlink.MAVLink_heartbeat_message):
                self.is_armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                self.mode = message.custom_mode
            elif isinstance(message, mavlink.MAVLink_sys_status_message):
                self.is_ready = bool(message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)
            elif isinstance(message, mavlink.MAVLink_extended_sys_state_message):
                self.landed_state = message.landed_state
            elif isinstance(message, mavlink.MAVLink_statustext_message):
                self.said = message.text
            self._changed.notify_all()
