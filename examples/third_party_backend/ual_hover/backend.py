"""The backend: translates between the imaginary autopilot and UAL."""

from __future__ import annotations

import math
from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from ual.geometry import Pose, Twist, Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.base import BackendOptions, Clock
from ual_daemon.backends.engine.reporting import Answer, ReportingBackend, VehicleReport
from ual_daemon.backends.values import PositionSetpoint, Setpoint, VehicleInfo
from ual_daemon.settings import Settings, convert
from ual_hover.autopilot import HORIZONTAL_M_S, VERTICAL_M_S, YAW_RATE_DEG_S, Autopilot, Packet, Target, Triple
from ual_hover.autopilot import Answer as AutopilotAnswer


class HoverSettings(Settings, frozen=True, kw_only=True):
    """Section ``hover`` of the configuration. The autopilot's time runs `speed` times as fast as real time."""

    speed: Annotated[float, Meta(gt=0.0, le=100.0)] = 1.0


class HoverBackend(ReportingBackend):
    """Flies a `hover`."""

    name = "hover"
    follow_mode, hold_mode, land_mode = "follow", "hold", "land"
    vehicle = VehicleInfo(
        autopilot="hover",
        capabilities=frozenset(Capability)
        - {Capability.GEO, Capability.EXTERNAL_POSE},  # it does not know its position on Earth
        limits=Limits(HORIZONTAL_M_S, VERTICAL_M_S, VERTICAL_M_S, yaw_rate_rad_s=math.radians(YAW_RATE_DEG_S)),
    )

    def __init__(self, options: BackendOptions, autopilot: Autopilot | None = None, clock: Clock | None = None) -> None:
        """Tests give an autopilot and a clock of their own."""
        speed = convert(options.settings, HoverSettings, self.name).speed
        super().__init__(options, speed, clock)
        self._autopilot = Autopilot(speed) if autopilot is None else autopilot

    @override
    def receive(self, timeout_s: float) -> VehicleReport | Answer | None:
        message = self._autopilot.receive(timeout_s)
        if isinstance(message, Packet):
            return _report(message)
        if isinstance(message, AutopilotAnswer):
            return Answer(message.command, "" if message.text == "ok" else message.text)
        return None

    @override
    def command(self, name: str) -> None:
        self._autopilot.command(name)

    @override
    def follow(self, setpoint: Setpoint) -> None:
        velocity = enu_to_ned(setpoint.velocity)
        yaw_rate_deg_s = -math.degrees(setpoint.yaw_rate_rad_s)
        if isinstance(setpoint, PositionSetpoint):
            heading_deg = 90.0 - math.degrees(setpoint.yaw_rad)
            self._autopilot.follow(Target(velocity, yaw_rate_deg_s, enu_to_ned(setpoint.position), heading_deg))
        else:
            self._autopilot.follow(Target(velocity, yaw_rate_deg_s))


def _report(packet: Packet) -> VehicleReport:
    position, yaw_rad = ned_to_enu(packet.position), math.radians(90.0 - packet.heading_deg)
    return VehicleReport(
        boot_s=packet.time_s,
        is_armed=packet.is_armed,
        is_on_ground=packet.is_on_ground,
        mode=packet.mode,
        pose=Pose.at(position.x, position.y, position.z, yaw_rad),
        velocity=Twist(ned_to_enu(packet.velocity), Vector3(0.0, 0.0, -math.radians(packet.yaw_rate_deg_s))),
    )


def ned_to_enu(triple: Triple) -> Vector3:
    """Converts north, east, down to east, north, up."""
    return Vector3(triple[1], triple[0], -triple[2])


def enu_to_ned(vector: Vector3) -> Triple:
    """Converts east, north, up to north, east, down."""
    return (vector.y, vector.x, -vector.z)
