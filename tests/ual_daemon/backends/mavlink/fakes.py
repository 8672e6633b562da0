"""A scripted autopilot without sockets, and what exchanges messages with it."""

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import all as mavlink
from typing_extensions import override

from tests.simulators.codec import AutopilotCodec
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavlink.links import Address
from ual_daemon.backends.mavlink.playback import NoLink
from ual_daemon.backends.mavlink.session.discovery import Discovery
from ual_daemon.backends.mavlink.session.session import MavlinkSession
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire.frames import split
from ual_daemon.backends.mavlink.wire.messages import Message
from ual_daemon.backends.mavlink.wire.signing import Signer

UTC_S = 1.8e9
"""UTC when the fake clock is at 0."""
ADDRESS = ("127.0.0.1", 14580)
BOOT_MS = 5000
"""Time since boot when the fake clock is at 0."""


def packer(system_id: int = 1, component_id: int = mavlink.MAV_COMP_ID_AUTOPILOT1) -> Callable[[Message], bytes]:
    """Returns the encoder of messages into the bytes that a component of a system sends."""
    codec = AutopilotCodec(component_id)
    codec.join(system_id)
    return codec.encode


def heartbeat(
    custom_mode: int = 0x03040000,
    *,
    armed: bool = False,
    autopilot: int = mavlink.MAV_AUTOPILOT_PX4,
    kind: int = mavlink.MAV_TYPE_QUADROTOR,
) -> Message:
    base_mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, base_mode, custom_mode, 3, 3)


def attitude(yaw_ned_rad: float = 0.0, boot_ms: int = 0) -> Message:
    """Without a time since boot, so that it is of no other boot than a position at whatever time."""
    return mavlink.MAVLink_attitude_quaternion_message(
        boot_ms, math.cos(yaw_ned_rad / 2), 0.0, 0.0, math.sin(yaw_ned_rad / 2), 0.1, 0.2, 0.3
    )


def position(now_s: float, north: float = 1.0, east: float = 2.0, down: float = -3.0) -> Message:
    return mavlink.MAVLink_local_position_ned_message(BOOT_MS + int(now_s * 1000), north, east, down, 0.5, 0.25, -0.125)


def ack(command: int, result: int, target: tuple[int, int] = (1, 191)) -> Message:
    return mavlink.MAVLink_command_ack_message(command, result, 0, 0, *target)


class FakeLink(NoLink):
    """Keeps what is sent."""

    def __init__(self, *, is_stream: bool = False) -> None:
        super().__init__(is_stream=is_stream)
        self.sent: list[bytes] = []

    @override
    def send(self, data: bytes, *, is_perishable: bool = False) -> bool:
        self.sent.append(data)
        return True

    def take(self, kind: str) -> list[Any]:
        """The messages of a kind sent since the last `take`."""
        codec = AutopilotCodec(1)
        frames = [frame for data in self.sent for frame in split(data)[0]]
        self.sent.clear()
        return [message for frame in frames if (message := codec.decode(frame)).get_type() == kind]


class FakeSetpoints(SetpointMonitor):
    """Setpoints that count as sent for as long as a test says."""

    def __init__(self) -> None:
        super().__init__()
        self.sent_for_s = 0.0

    @override
    def duration_s(self, now_s: float) -> float:
        return self.sent_for_s


class Harness:
    """Discovery and session with a scripted PX4 of system 1, without sockets, on a clock that is moved by hand."""

    def __init__(
        self, settings: MavlinkSettings | None = None, *, is_stream: bool = False, signer: Signer | None = None
    ) -> None:
        self.now_s = 0.0
        self.setpoints = FakeSetpoints()
        self.link = FakeLink(is_stream=is_stream)
        self.discovery = Discovery(settings or MavlinkSettings(), self.link, "test", self.setpoints, signer)
        self.supervision = self.discovery.supervision
        self.pack = packer()

    def receive(self, *messages: Message, data: bytes = b"", address: Address = ADDRESS) -> None:
        """The autopilot sends messages (or bytes)."""
        for datagram in (*map(self.pack, messages), *([data] if data else [])):
            self.discovery.receiver.receive(datagram, address, self.now_s, UTC_S + self.now_s)

    def run(self, duration_s: float, step_s: float = 0.05) -> None:
        """Time passes."""
        for _ in range(round(duration_s / step_s)):
            self.now_s += step_s
            self.discovery.tick(self.now_s)

    def commands(self, command: int) -> list[Any]:
        """The commands of an id sent since the last call."""
        return [message for message in self.link.take("COMMAND_LONG") if message.command == command]

    @property
    def session(self) -> MavlinkSession:
        session = self.discovery.session
        assert session is not None
        return session

    def snapshot(self) -> Any:
        """As of now. Not typed: what a test reads from it is there, or the test fails."""
        return self.session.snapshot(self.now_s)
