"""The other end of what a server flies, as a process that notes when each setpoint came: ``fly``, ``setpoints``.

``px4`` is the PX4-like test autopilot. ``sink`` takes what `benchmarks.attacks.noted` and `benchmarks.attacks.plain`
send: the number of each setpoint.
"""

from __future__ import annotations

import struct
import subprocess
import sys
import threading
from typing import Any

from pymavlink.dialects.v20 import all as mavlink
from typing_extensions import override

from benchmarks import marks
from benchmarks.attacks import recorder
from benchmarks.children import serve
from tests.simulators.ports import Address, Port
from tests.simulators.px4 import Px4
from tests.simulators.runner import run

_SETPOINT_ID = mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED
_HEADER_SIZE = 10
_YAW_RATE = struct.Struct("<f")
_YAW_RATE_AT = _HEADER_SIZE + 44
NUMBER = struct.Struct("<d")
"""The yaw rate of a setpoint, in a datagram to the sink."""


class ReceivedSetpoints:
    """The setpoints that came: number (see `marks`) and time."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._came: list[tuple[int, int]] = []

    def add(self, yaw_rate_rad_s: float, came_ns: int) -> None:
        with self._lock:
            self._came.append((marks.number_of_yaw_rate(yaw_rate_rad_s), came_ns))

    def take(self) -> list[tuple[int, int]]:
        """Returns those since the last call."""
        with self._lock:
            came, self._came = self._came, []
        return came


class NotingPort(Port):
    """The autopilot's UDP port, which sends to one other port of this computer."""

    def __init__(self, remote_port: int, setpoints: ReceivedSetpoints) -> None:
        self.socket = recorder.socket_with_times()
        self._remote = ("127.0.0.1", remote_port)
        self._setpoints = setpoints

    @override
    def receive(self, now_s: float) -> list[bytes]:
        found = []
        try:
            while True:
                data, _, came_ns = recorder.receive(self.socket)
                found.append(data)
                if data[0] == mavlink.PROTOCOL_MARKER_V2 and int.from_bytes(data[7:10], "little") == _SETPOINT_ID:
                    self._setpoints.add(_YAW_RATE.unpack_from(data, _YAW_RATE_AT)[0], came_ns)
        except (BlockingIOError, ConnectionError):
            return found

    @override
    def send(self, data: bytes, now_s: float) -> None:
        try:
            self.socket.sendto(data, self._remote)
        except (BlockingIOError, ConnectionError):
            return  # nobody there yet

    @property
    def address(self) -> Address:
        """Address from which it sends."""
        address: Address = self.socket.getsockname()
        return address


class AttackedAutopilot:
    """The program's tasks."""

    def __init__(self) -> None:
        self._setpoints = ReceivedSetpoints()
        self._port: NotingPort | None = None
        self._garbage: subprocess.Popen[str] | None = None

    def handle(self, task: dict[str, Any]) -> dict[str, Any]:
        do = task.pop("do")
        answer: dict[str, Any] = getattr(self, do)(**task)
        return answer

    def px4(self, port: int) -> dict[str, Any]:
        """Flies a PX4 that sends to a port. Returns its own port."""
        self._port = NotingPort(port, self._setpoints)
        vehicle = Px4(self._port)
        threading.Thread(target=run, args=(vehicle, threading.Event()), daemon=True).start()
        return {"port": self._port.address[1]}

    def sink(self) -> dict[str, Any]:
        """Takes numbers at a port, which it returns."""
        taken = recorder.socket_with_times()
        taken.setblocking(True)
        threading.Thread(target=self._take, args=(taken,), daemon=True).start()
        return {"port": taken.getsockname()[1]}

    def setpoints(self) -> dict[str, Any]:
        """Returns the setpoints since the last call."""
        return {"came": self._setpoints.take()}

    def garbage(self, kind: str, port: int, rate: float) -> dict[str, Any]:
        """Begins to send garbage from its own address, by a process that has its socket."""
        assert self._port is not None
        descriptor = self._port.socket.fileno()
        arguments = (kind, str(port), "--rate", str(rate), "--descriptor", str(descriptor))
        self._garbage = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.attacks.garbage", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            pass_fds=[descriptor],
        )
        return {}

    def garbage_end(self) -> dict[str, Any]:
        """Ends it. Returns how many bytes were sent."""
        assert self._garbage is not None
        return {"count": int(self._garbage.communicate()[0])}

    def _take(self, taken: Any) -> None:  # noqa: ANN401
        while True:
            data, _, came_ns = recorder.receive(taken)
            self._setpoints.add(NUMBER.unpack(data)[0], came_ns)


if __name__ == "__main__":
    sys.setswitchinterval(0.001)
    serve(AttackedAutopilot().handle)
