"""The backend: translates between the imaginary autopilot and UAL."""

from __future__ import annotations

import math
import time
from concurrent.futures import Future
from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from ual.errors import LinkLostError, UalError
from ual.geometry import Vector3
from ual.types import Capability, Limits
from ual_daemon.backends.base import Backend, BackendOptions, Clock, UpdateCallback
from ual_daemon.backends.engine.command import ARMING, FLYING, Command, Repeat, shows_armed, shows_mode
from ual_daemon.backends.engine.command_desk import CommandDesk
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.loop import Loop, LoopThread
from ual_daemon.backends.values import Freshness, PositionSetpoint, Setpoint, Snapshot, VehicleInfo
from ual_daemon.settings import Settings, convert
from ual_hover.autopilot import HORIZONTAL_M_S, VERTICAL_M_S, YAW_RATE_DEG_S, Autopilot, Packet, Target, Triple
from ual_hover.session import Session

INFO = VehicleInfo(
    autopilot="hover",
    capabilities=frozenset(Capability)
    - {Capability.GEO, Capability.EXTERNAL_POSE},  # it does not know its position on Earth
    limits=Limits(HORIZONTAL_M_S, VERTICAL_M_S, VERTICAL_M_S, yaw_rate_rad_s=math.radians(YAW_RATE_DEG_S)),
)
AGAIN = Repeat(every_s=0.25, most=18)


def arming(what: str, *, is_armed: bool) -> Command[str]:
    """A command that arms or disarms."""
    return Command(what, what, ARMING, key=what, shows=shows_armed(is_armed=is_armed), repeat=AGAIN)


def flying(what: str, mode: str) -> Command[str]:
    """A command that changes the mode."""
    return Command(what, mode, FLYING, key=mode, mode=mode, shows=shows_mode(mode), repeat=AGAIN)


ARM, DISARM = arming("arm", is_armed=True), arming("disarm", is_armed=False)
TAKE_OFF, TAKE_CONTROL = flying("take off", "follow"), flying("take control", "follow")
LAND, HOLD = flying("land", "land"), flying("hold", "hold")


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
    """The face of a session. Its methods may be called from any thread."""

    name = "hover"
    freshness = Freshness(link_s=1.0, pose_s=1.0, mode_s=1.0, landed_s=1.0, estimator_s=1.0)

    def __init__(self, options: BackendOptions, autopilot: Autopilot | None = None, clock: Clock | None = None) -> None:
        """Tests give an autopilot and a clock of their own."""
        super().__init__(options)
        speed = convert(options.settings, HoverSettings, self.name).speed
        if speed > 1.0:  # a pause of this computer is longer in the autopilot's time
            self.freshness = Freshness(*[speed] * 5)
        self.clock = HoverClock(speed) if clock is None else clock
        self._autopilot = Autopilot(speed) if autopilot is None else autopilot
        self._speed = speed
        self._session = session = Session(self._autopilot, self.clock, self.freshness.link_s)
        watched_s = time.monotonic if speed > 1.0 else None
        self._loop = Loop(session, self.clock, session.watch, watched_s=watched_s)
        self._desk = CommandDesk(self._loop, self.clock, self._reach)
        self._thread = LoopThread(self._loop, self.clock, "hover", self._receive, session.on_defect)

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._loop.on_update = on_update
        self._thread.open()

    @override
    def close(self) -> None:
        self._thread.close()

    def _receive(self, timeout_s: float) -> None:
        """Takes all that waits. The loop does the rest."""
        message = self._autopilot.receive(timeout_s / self._speed)
        now_s = self.clock.now_s()
        has_paused = self._loop.woke(now_s) > 0.0
        has_pose = False
        while message is not None and not has_paused:
            self._session.on_message(message, now_s)
            has_pose = has_pose or isinstance(message, Packet)
            message = self._autopilot.receive(0.0)
        self._loop.step(now_s, has_news=has_pose)

    @override
    def info(self) -> VehicleInfo:
        return INFO

    @override
    def snapshot(self) -> Snapshot:
        return self._loop.newest.at(self.clock.now_s())

    @override
    def send(self, setpoint: Setpoint) -> None:
        if not self._session.watch.is_up(self.clock.now_s()):
            return
        velocity = _enu_to_ned(setpoint.velocity)
        yaw_rate_deg_s = -math.degrees(setpoint.yaw_rate_rad_s)
        if isinstance(setpoint, PositionSetpoint):
            heading_deg = 90.0 - math.degrees(setpoint.yaw_rad)
            self._autopilot.follow(Target(velocity, yaw_rate_deg_s, _enu_to_ned(setpoint.position), heading_deg))
        else:
            self._autopilot.follow(Target(velocity, yaw_rate_deg_s))

    @override
    def arm(self) -> Future[None]:
        return self._give(ARM)

    @override
    def disarm(self) -> Future[None]:
        return self._give(DISARM)

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        return self._give(TAKE_OFF)  # the climb is flown with setpoints: VehicleInfo.flies_takeoff_on_setpoints

    @override
    def land(self, limits: Limits) -> Future[None]:
        return self._give(LAND)

    @override
    def take_control(self) -> Future[None]:
        return self._give(TAKE_CONTROL)

    @override
    def hold(self) -> Future[None]:
        return self._give(HOLD)

    def _give(self, command: Command[str]) -> Future[None]:
        return self._desk.give(command.what, lambda: command)

    def _reach(self, what: str) -> CommandRunner[str] | UalError:
        if self._session.watch.is_up(self.clock.now_s()):
            return self._session.runner
        return LinkLostError(f"cannot {what}: nothing is heard of the autopilot")


def _enu_to_ned(vector: Vector3) -> Triple:
    """Converts east, north, up to north, east, down."""
    return (vector.y, vector.x, -vector.z)
