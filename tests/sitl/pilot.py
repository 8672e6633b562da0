"""A safety pilot at PX4's ground-station link, as QGroundControl with a joystick would be."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable

from ual_daemon.backends.mavlink.frames import split
from ual_daemon.backends.mavlink.messages import Codec, CorruptFrameError, mavlink

PATIENCE_S = 60.0
STICKS_S = 0.05
GROUND_STATION_ID = 255
POSCTL, ALTCTL = 3, 2


class SafetyPilot:
    """Holds the transmitter: sticks at 20 Hz, without which PX4 counts manual control as lost and returns home.

    `address` is PX4's ground-station link (18570 + instance). PX4 answers for good to the port that it first heard
    there, so it is always the same: 100 above.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host, port + 100))
        self._socket.settimeout(STICKS_S)
        self._codec = Codec(mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._codec.join(GROUND_STATION_ID)
        self._changed = threading.Condition()
        self._system_id = 0
        self.is_ready = False
        self.is_armed = False
        self.main_mode = 0
        self.sticks = (0, 0, 500, 0)
        """Forward, right, up (500 is the middle), turn to the right; up to 1000."""
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name="safety pilot")
        self._thread.start()

    def close(self) -> None:
        self._is_closing = True
        self._thread.join()
        self._socket.close()

    def begin(self) -> None:
        """As before any day's first flight: PX4 is there, and the mode switch is where the pilot flies."""
        self._wait(lambda: bool(self._system_id), "there")
        self.set_mode(POSCTL)

    def wait_until_ready(self) -> None:
        """Until PX4 says that it may be armed."""
        self._wait(lambda: self.is_ready, "ready to be armed")

    def arm(self) -> None:
        self._wait_sending(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), lambda: self.is_armed, "armed")

    def disarm(self) -> None:
        self._wait_sending(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0,), lambda: not self.is_armed, "disarmed")

    def set_mode(self, main: int, sub: int = 0) -> None:
        """Returns when PX4 has taken the mode."""
        params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(main), float(sub))
        self._wait_sending(mavlink.MAV_CMD_DO_SET_MODE, params, lambda: self.main_mode == main, f"in mode {main}")

    def take_over(self) -> None:
        """Flips the switch to POSCTL, and returns at once."""
        self._command(mavlink.MAV_CMD_DO_SET_MODE, (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), float(POSCTL)))

    def _wait_sending(self, command: int, params: tuple[float, ...], is_done: Callable[[], bool], what: str) -> None:
        deadline_s = time.monotonic() + PATIENCE_S
        while not is_done():
            assert time.monotonic() < deadline_s, f"PX4 is not {what}"
            self._command(command, params)
            with self._changed:
                self._changed.wait_for(is_done, timeout=1.5)

    def _wait(self, is_done: Callable[[], bool], what: str) -> None:
        with self._changed:
            assert self._changed.wait_for(is_done, timeout=PATIENCE_S), f"PX4 is not {what}"

    def _command(self, command: int, params: tuple[float, ...]) -> None:
        padded = (*params, *(0.0,) * (7 - len(params)))
        self._send(mavlink.MAVLink_command_long_message(self._system_id, 1, command, 0, *padded))

    def _send(self, message: object) -> None:
        self._socket.sendto(self._codec.encode(message), self._address)

    def _run(self) -> None:
        next_s, count = time.monotonic(), 0
        while not self._is_closing:
            if time.monotonic() >= next_s:
                next_s += STICKS_S
                if count % 20 == 0:
                    self._send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
                if self._system_id:
                    self._send(mavlink.MAVLink_manual_control_message(self._system_id, *self.sticks, 0))
                count += 1
            self._receive()

    def _receive(self) -> None:
        try:
            data = self._socket.recv(4096)
        except TimeoutError:
            return
        for frame in split(data)[0]:
            if frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1 and frame.message_id in (0, 1):
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
                self.main_mode = message.custom_mode >> 16 & 0xFF
            elif isinstance(message, mavlink.MAVLink_sys_status_message):
                self.is_ready = bool(message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)
            self._changed.notify_all()
