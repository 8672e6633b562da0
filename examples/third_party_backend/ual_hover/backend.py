"""The backend: translates between the imaginary autopilot and UAL."""

from __future__ import annotations

import math
import threading
import time
from concurrent.futures import Future
from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from ual.errors import RejectedByAutopilotError
from ual.geometry import Pose, Quaternion, Twist, Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.base import Backend, BackendOptions, Clock, UpdateCallback
from ual_daemon.backends.values import (
    Control,
    Estimator,
    Freshness,
    LandedState,
    Mode,
    PositionSetpoint,
    Sample,
    Setpoint,
    Snapshot,
    VehicleInfo,
)
from ual_daemon.settings import Settings, convert
from ual_hover.autopilot import HORIZONTAL_M_S, VERTICAL_M_S, YAW_RATE_DEG_S, Autopilot, Packet, Target, Triple

CONTROLS = {"follow": Control.REFERENCES, "land": Control.LAND, "hold": Control.OTHER}
INFO = VehicleInfo(
    autopilot="hover",
    capabilities=frozenset(Capability)
    - {Capability.GEO, Capability.EXTERNAL_POSE},  # it does not know its position on Earth
    limits=Limits(HORIZONTAL_M_S, VERTICAL_M_S, VERTICAL_M_S, yaw_rate_rad_s=math.radians(YAW_RATE_DEG_S)),
)


class HoverSettings(Settings, frozen=True, kw_only=True):
    """Section ``hover`` of the configuration. The autopilot's time runs `speed` times as fast as real time."""

    speed: Annotated[float, Meta(gt=0.0, le=100.0)] = 1.0


class HoverClock(Clock):
    """The autopilot's time, estimated by the computer's clock."""

    def __init__(self, speed: float) -> None:
        self._begin_s, self._speed = time.monotonic(), speed

    @override
    def now_s(self) -> float:
        return (time.monotonic() - self._begin_s) * self._speed


class HoverBackend(Backend):
    """One thread receives the autopilot's packets and calls `on_update`."""

    name = "hover"
    freshness = Freshness(link_s=1.0, pose_s=1.0, mode_s=1.0, landed_s=1.0, estimator_s=1.0)

    def __init__(self, options: BackendOptions) -> None:
        super().__init__(options)
        settings = convert(options.settings, HoverSettings, self.name)
        self.clock = HoverClock(settings.speed)
        if settings.speed > 1.0:  # a pause of this computer is longer in the autopilot's time
            self.freshness = Freshness(*[settings.speed] * 5)
        self._packet_timeout_s = 0.1 / settings.speed
        self._epoch_s = time.time()
        self._autopilot = Autopilot(settings.speed)
        self._newest: Sample[Packet] | None = None
        self._looked_s = time.monotonic()
        self._is_closing = threading.Event()
        self._thread: threading.Thread | None = None

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._thread = threading.Thread(target=self._receive, args=(on_update,), name="hover", daemon=True)
        self._thread.start()

    @override
    def close(self) -> None:
        self._is_closing.set()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()

    def _receive(self, on_update: UpdateCallback) -> None:
        while not self._is_closing.is_set():
            packet = self._autopilot.receive(self._packet_timeout_s)
            self._looked_s = time.monotonic()
            if packet is not None:
                self._newest = Sample(packet, self.clock.now_s())
            on_update(self.snapshot())  # also if nothing came: old data changes the state

    @override
    def info(self) -> VehicleInfo:
        return INFO

    @override
    def snapshot(self) -> Snapshot:
        newest, now_s = self._newest, self.clock.now_s()
        updated_s = now_s - (time.monotonic() - self._looked_s)
        if newest is None:
            return Snapshot(time_s=now_s, updated_s=updated_s)
        packet, received_s = newest.value, newest.time_s
        rotation = Vector3(0.0, 0.0, -math.radians(packet.yaw_rate_deg_s))
        return Snapshot(
            time_s=now_s,
            heard_s=received_s,
            updated_s=updated_s,
            stamp_s=self._epoch_s + packet.time_s,
            armed=Sample(packet.is_armed, received_s),
            landed=Sample(LandedState.ON_GROUND if packet.is_on_ground else LandedState.IN_AIR, received_s),
            mode=Sample(Mode(packet.mode, CONTROLS[packet.mode]), received_s),
            estimator=Sample(Estimator(True), received_s),
            pose=Sample(
                Pose(_ned_to_enu(packet.position), Quaternion.from_yaw(_yaw_rad(packet.heading_deg))), received_s
            ),
            velocity=Sample(Twist(_ned_to_enu(packet.velocity), rotation), received_s),
        )

    @override
    def send(self, setpoint: Setpoint) -> None:
        velocity = _enu_to_ned(setpoint.velocity)
        yaw_rate_deg_s = -math.degrees(setpoint.yaw_rate_rad_s)
        if isinstance(setpoint, PositionSetpoint):
            heading_deg = 90.0 - math.degrees(setpoint.yaw_rad)
            self._autopilot.follow(Target(velocity, yaw_rate_deg_s, _enu_to_ned(setpoint.position), heading_deg))
        else:
            self._autopilot.follow(Target(velocity, yaw_rate_deg_s))

    @override
    def arm(self) -> Future[None]:
        return self._command("arm")

    @override
    def disarm(self) -> Future[None]:
        return self._command("disarm")

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        return self._command("follow")  # the climb is flown with setpoints: VehicleInfo.flies_takeoff_on_setpoints

    @override
    def land(self, limits: Limits) -> Future[None]:
        return self._command("land")

    @override
    def take_control(self) -> Future[None]:
        return self._command("follow")

    @override
    def hold(self) -> Future[None]:
        return self._command("hold")

    def _command(self, name: str) -> Future[None]:
        answer: Future[None] = Future()
        words = self._autopilot.command(name)
        if words == "ok":
            answer.set_result(None)
        else:
            answer.set_exception(RejectedByAutopilotError(f"the autopilot refused: {words}", {"text": words}))
        return answer


def _pose(packet: Packet) -> Pose:
    return Pose(_ned_to_enu(packet.position), Quaternion.from_yaw(_yaw_rad(packet.heading_deg)))


def _ned_to_enu(triple: Triple) -> Vector3:
    """Converts north, east, down to east, north, up."""
    return Vector3(triple[1], triple[0], -triple[2])


def _enu_to_ned(vector: Vector3) -> Triple:
    """Converts east, north, up to north, east, down."""
    return (vector.y, vector.x, -vector.z)


def _yaw_rad(heading_deg: float) -> float:
    """Converts a heading clockwise from north to one counter-clockwise from east."""
    return math.radians(90.0 - heading_deg)
