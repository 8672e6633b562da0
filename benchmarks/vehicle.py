"""A minimal MAVLink vehicle: a process that reports that it flies, and records when each setpoint reached it.

It streams to a UDP port of this computer the messages of a PX4 that hovers in OFFBOARD, or a recorded flight. It
accepts all commands. It records, on the monotonic clock that all processes of a computer share, when it sent each
marked position and when each marked setpoint came. See `marks`.

Tasks (see `children`): ``fly``, ``replay``, ``rest``, ``setpoints``, ``positions``. In the first two it has a fence of
its own, or none.
"""

from __future__ import annotations

import gzip
import heapq
import json
import math
import os
import select
import socket
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from benchmarks import marks

_TRACES = Path(__file__).parents[1] / "tests" / "data"
_HEADER_SIZE, _SEQUENCE_AT, _SYSTEM_AT = 10, 4, 5
_SYSTEM_ID = 1
_SETPOINT_ID = mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
_FLOAT = struct.Struct("<f")
_NORTH_SPEED_AT, _YAW_RATE_AT = _HEADER_SIZE + 16, _HEADER_SIZE + 44
_BUFFER = 4 << 20
_OFFBOARD = 6 << 16
_RATES_HZ = {"attitude": 50.0, "position": 30.0, "landed": 5.0, "power": 5.0, "heartbeat": 1.0, "estimator": 1.0}
"""PX4's default rates."""
PARAMETERS = {
    "MPC_XY_VEL_MAX": 12.0,
    "MPC_Z_VEL_MAX_UP": 3.0,
    "MPC_Z_VEL_MAX_DN": 1.5,
    "MPC_ACC_HOR": 3.0,
    "MPC_ACC_UP_MAX": 4.0,
    "MPC_ACC_DOWN_MAX": 3.0,
    "MPC_YAWRAUTO_MAX": 60.0,
    "MPC_XY_CRUISE": 5.0,
    "MPC_XY_VEL_P_ACC": 1.8,
    "MPC_XY_VEL_D_ACC": 0.2,
    "MPC_Z_VEL_P_ACC": 4.0,
    "MPC_Z_VEL_D_ACC": 0.0,
    "COM_OF_LOSS_T": 1.0,
    "GF_ACTION": 2.0,
    "GF_MAX_HOR_DIST": 0.0,
    "GF_MAX_VER_DIST": 0.0,
}
"""PX4's defaults of what UAL reads: no fence. Others are not answered, as by PX4."""
OWN_FENCE = {"GF_MAX_HOR_DIST": 100.0, "GF_MAX_VER_DIST": 50.0}
"""Parameters that differ with a fence."""


class MinimalVehicle:
    """The vehicle; `run` serves it until stdin ends."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.setblocking(False)
        self._peer: tuple[str, int] | None = None
        self._mavlink = mavlink.MAVLink(None, srcSystem=_SYSTEM_ID, srcComponent=mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._mavlink.robust_parsing = True
        self._is_numbered = True
        """Whether each message that is sent has the next number."""
        self._began_s = time.monotonic()
        self._due: list[tuple[float, str]] = []
        self._rates_hz = _RATES_HZ
        self._parameters = PARAMETERS
        self._recorded: list[tuple[float, bytes]] = []
        self._setpoints: list[tuple[int, int]] = []
        self._positions: list[tuple[int, int]] = []
        self._position_number = 0
        self._streams: dict[str, Callable[[], Any]] = {
            "heartbeat": self._heartbeat,
            "attitude": lambda: mavlink.MAVLink_attitude_quaternion_message(self._boot_ms(), 1, 0, 0, 0, 0, 0, 0),
            "landed": lambda: mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_IN_AIR),
            "power": lambda: mavlink.MAVLink_sys_status_message(
                0x3FFFFFFF, 0x3FFFFFFF, 0x3FFFFFFF, 200, 15000, 500, 80, 0, 0, 0, 0, 0, 0
            ),
            "estimator": lambda: mavlink.MAVLink_estimator_status_message(
                self._boot_ms() * 1000, 0x37F, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5
            ),
        }
        self._tasks: dict[str, Callable[..., dict[str, Any]]] = {
            "fly": self._fly,
            "replay": self._replay,
            "rest": self._rest,
            "setpoints": self._take_setpoints,
            "positions": self._take_positions,
        }

    def run(self) -> None:
        """Flies and performs tasks until stdin ends."""
        poll = select.poll()
        poll.register(self._socket, select.POLLIN)
        poll.register(sys.stdin, select.POLLIN)
        own = self._socket.fileno()
        lines = b""
        while True:
            wait_s = self._send_due()
            for descriptor, _ in poll.poll(math.ceil(wait_s * 1000.0)):
                if descriptor == own:
                    self.receive()
                    continue
                data = os.read(sys.stdin.fileno(), 65536)
                if not data:
                    return
                *whole, lines = (lines + data).split(b"\n")
                for line in whole:
                    task = json.loads(line)
                    print(json.dumps(self._tasks[task.pop("do")](**task)), flush=True)

    # --- Tasks --------------------------------------------------------------------------------------------------------

    def _fly(self, port: int, rate_factor: float = 1.0, *, has_fence: bool = False) -> dict[str, Any]:
        """Streams to a port, `rate_factor` times as fast as PX4."""
        self._rest()
        self._mavlink.srcSystem, self._is_numbered = _SYSTEM_ID, True
        self._set_fence(has_fence=has_fence)
        self._rates_hz = {name: rate_hz * rate_factor for name, rate_hz in _RATES_HZ.items()}
        self._peer = ("127.0.0.1", port)
        now_s = time.monotonic()
        self._due = [(now_s, name) for name in _RATES_HZ]
        heapq.heapify(self._due)
        return {}

    def _replay(self, port: int, trace: str, from_s: float, to_s: float, *, has_fence: bool = False) -> dict[str, Any]:
        """Sends a part of a recorded flight to a port, as the autopilot did."""
        self._rest()
        self._set_fence(has_fence=has_fence)
        self._peer = ("127.0.0.1", port)
        part = [(time_s, frame) for time_s, frame in frames(trace) if from_s <= time_s <= to_s]
        begin_s = time.monotonic() - part[0][0]
        self._recorded = [(begin_s + time_s, frame) for time_s, frame in reversed(part)]
        return {"messages_per_s": len(part) / (part[-1][0] - part[0][0])}

    def answer_at(self, port: int, *, has_fence: bool) -> None:
        """Sends to a port from now on, in a process that sends what was recorded by itself."""
        self._set_fence(has_fence=has_fence)
        self._peer = ("127.0.0.1", port)

    def _set_fence(self, *, has_fence: bool) -> None:
        self._parameters = {**PARAMETERS, **OWN_FENCE} if has_fence else PARAMETERS

    def _rest(self) -> dict[str, Any]:
        """Stops sending."""
        self._due, self._recorded, self._peer = [], [], None
        return {}

    def _take_setpoints(self) -> dict[str, Any]:
        """Returns the number of each setpoint since the last call, and when it first came."""
        self.receive()
        first: dict[int, int] = {}
        for number, came_ns in self._setpoints:
            first.setdefault(number, came_ns)
        self._setpoints = []
        return {"came": list(first.items())}

    def _take_positions(self) -> dict[str, Any]:
        """Returns the number of each position since the last call, and when it was sent."""
        gone, self._positions = self._positions, []
        return {"gone": gone}

    # --- Sending ------------------------------------------------------------------------------------------------------

    def _send_due(self) -> float:
        """Sends the messages that are due. Returns the time until the next one."""
        while True:
            now_s = time.monotonic()
            if self._due and self._due[0][0] <= now_s:
                due_s, name = self._due[0]
                heapq.heapreplace(self._due, (due_s + 1.0 / self._rates_hz[name], name))
                self._send_position() if name == "position" else self._send(self._streams[name]())
            elif self._recorded and self._recorded[-1][0] <= now_s:
                self.send_recorded(self._recorded.pop()[1])
            else:
                next_s = [*(due_s for due_s, _ in self._due[:1]), *(due_s for due_s, _ in self._recorded[-1:])]
                return min(next_s, default=now_s + 1.0) - now_s

    def _send_position(self) -> None:
        self._position_number += 1
        north_m = marks.distance_m(self._position_number)
        message = mavlink.MAVLink_local_position_ned_message(self._boot_ms(), north_m, 0.0, -10.0, 0.0, 0.0, 0.0)
        data = self._pack(message)
        self._positions.append((self._position_number, time.monotonic_ns()))
        self.send_bytes(data)

    def _heartbeat(self) -> Any:  # noqa: ANN401 (pymavlink has no types)
        mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, mode, _OFFBOARD, mavlink.MAV_STATE_ACTIVE, 3
        )

    def _send(self, message: Any) -> None:  # noqa: ANN401 (pymavlink has no types)
        self.send_bytes(self._pack(message))

    def _pack(self, message: Any) -> bytes:  # noqa: ANN401 (pymavlink has no types)
        data: bytes = message.pack(self._mavlink)
        self._mavlink.seq = (self._mavlink.seq + self._is_numbered) % 256
        return data

    def send_bytes(self, data: bytes) -> None:
        """Sends a datagram."""
        if self._peer is not None:
            try:
                self._socket.sendto(data, self._peer)
            except ConnectionRefusedError:
                return  # nobody there yet

    def send_recorded(self, frame: bytes) -> None:
        """Sends a frame of a recorded autopilot. Until the next one all answers are of that system, and have the
        number of this frame: others would be another vehicle's, or make the next frames late.
        """
        self._mavlink.seq, self._mavlink.srcSystem, self._is_numbered = frame[_SEQUENCE_AT], frame[_SYSTEM_AT], False
        self.send_bytes(frame)

    def _boot_ms(self) -> int:
        return int((time.monotonic() - self._began_s) * 1000.0) + 1000

    # --- Receiving ----------------------------------------------------------------------------------------------------

    def receive(self) -> None:
        """Receives what has come, and answers it."""
        while True:
            try:
                data = self._socket.recv(2048)
            except (BlockingIOError, ConnectionRefusedError):
                return
            came_ns = time.monotonic_ns()
            if data[0] == mavlink.PROTOCOL_MARKER_V2 and int.from_bytes(data[7:10], "little") == _SETPOINT_ID:
                self._setpoints.append((number_of(data), came_ns))
            else:
                for message in self._mavlink.parse_buffer(data) or ():
                    self._obey(message)

    def _obey(self, message: Any) -> None:  # noqa: ANN401 (pymavlink has no types)
        kind = message.get_type()
        if kind == "COMMAND_LONG":
            answers = 2 if message.command == mavlink.MAV_CMD_DO_SET_MODE else 1
            for _ in range(answers):
                self._send(
                    mavlink.MAVLink_command_ack_message(
                        message.command, 0, 0, 0, message.get_srcSystem(), message.get_srcComponent()
                    )
                )
            if message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
                self._send_requested(int(message.param1))
        elif kind == "PARAM_REQUEST_READ":
            self._send_parameter(message.param_id)
        elif kind == "TIMESYNC" and message.tc1 == 0:
            self._send(mavlink.MAVLink_timesync_message(time.monotonic_ns(), message.ts1))

    def _send_parameter(self, name: str) -> None:
        value = self._parameters.get(name)
        if value is not None:
            self._send(mavlink.MAVLink_param_value_message(name.encode("ascii"), value, 9, 1, 0))

    def _send_requested(self, message_id: int) -> None:
        if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self._send(self._heartbeat())
        elif message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            # Protocol 2; PX4 1.17.0; the values by which a simulated PX4 is recognized.
            capabilities = mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
            uid = int.from_bytes(b"ONIDLATI", "little")
            none = bytes(8)
            self._send(
                mavlink.MAVLink_autopilot_version_message(
                    capabilities, 0x011100FF, 0, 0, 0, none, none, none, 0, 0, uid, bytes(18)
                )
            )
        elif message_id == mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN:
            self._send(mavlink.MAVLink_gps_global_origin_message(473977420, 85455940, 488000))
        elif message_id == mavlink.MAVLINK_MSG_ID_HOME_POSITION:
            self._send(
                mavlink.MAVLink_home_position_message(473977420, 85455940, 488000, 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)
            )


def number_of(setpoint: bytes) -> int:
    """Returns the number of a SET_POSITION_TARGET_LOCAL_NED, whose type mask is not 0: else the yaw rate is cut off."""
    (speed_m_s,), (yaw_rate_rad_s,) = (_FLOAT.unpack_from(setpoint, at) for at in (_NORTH_SPEED_AT, _YAW_RATE_AT))
    return marks.number_of_setpoint(speed_m_s, yaw_rate_rad_s)


def frames(trace: str) -> list[tuple[float, bytes]]:
    """Returns the frames of a recorded flight: each is 8-byte big-endian unix microseconds and a MAVLink 2 frame."""
    data = gzip.decompress((_TRACES / f"{trace}.tlog.gz").read_bytes())
    found: list[tuple[float, bytes]] = []
    at = 0
    while at < len(data):
        (microseconds,) = struct.unpack_from(">Q", data, at)
        size = data[at + 9] + 12 + (13 if data[at + 10] & 1 else 0)
        found.append((microseconds / 1e6, data[at + 8 : at + 8 + size]))
        at += 8 + size
    begin_s = found[0][0]
    return [(time_s - begin_s, frame) for time_s, frame in found]


if __name__ == "__main__":
    MinimalVehicle().run()
