"""Backend of an autopilot that reports its whole state in one message, and takes commands by name: the shortest way to
a backend of one's own. An autopilot that sends its state in parts needs a session of its own on the engine.
"""

from __future__ import annotations

import math
import time
from abc import abstractmethod
from collections.abc import Hashable
from concurrent.futures import Future
from typing import NamedTuple

from typing_extensions import override

from ual.errors import LinkLostError, UalError
from ual.geometry import Pose, Twist
from ual.types import Limits
from ual_daemon.backends.base import BackendOptions, Clock, UpdateCallback
from ual_daemon.backends.clock import SpedUpClock
from ual_daemon.backends.engine.backend import EngineBackend
from ual_daemon.backends.engine.command import ARMING, FLYING, Command, Repeat, Verdict, shows_armed, shows_mode
from ual_daemon.backends.engine.command_entrance import CommandEntrance
from ual_daemon.backends.engine.command_runner import CommandRunner
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.loop import Loop, LoopThread
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.engine.readings import Reading, Readings, Valid
from ual_daemon.backends.values import (
    Control,
    ControlState,
    Estimator,
    Freshness,
    LandedState,
    LinkState,
    Mode,
    MotionState,
    Sample,
    Setpoint,
    Snapshot,
    VehicleInfo,
)

ARM, DISARM = "arm", "disarm"
_AGAIN = Repeat(every_s=0.25, most=18)


class VehicleReport(NamedTuple):
    """State of the vehicle at one moment.

    Attributes:
        boot_s: Time of the measurement, in seconds since the autopilot's boot.
        is_armed: Whether its motors are armed.
        is_on_ground: Whether it is on the ground, as the autopilot judges.
        mode: Name of its mode.
        pose: Pose of the body (x forward, y left, z up) in the autopilot's local frame: east, north, up, in metres.
        velocity: Linear along the local axes in m/s, angular in the body in rad/s.

    """

    boot_s: float
    is_armed: bool
    is_on_ground: bool
    mode: str
    pose: Pose
    velocity: Twist


class Answer(NamedTuple):
    """Answer to a command. `refusal` quotes the autopilot's reason; empty: accepted."""

    command: str
    refusal: str = ""


class ReportingBackend(EngineBackend[str]):
    """Flies an autopilot that sends `VehicleReport`s. A subclass has a `vehicle`, three modes and the abstract methods.

    It takes off on setpoints. `speed`: how many times as fast as real time the time of a simulated autopilot passes;
    its reports are believed for so much longer in its own time. Tests pass a `clock` of their own.
    """

    freshness = Freshness(link_s=1.0, pose_s=1.0, mode_s=1.0, landed_s=1.0, estimator_s=1.0)
    vehicle: VehicleInfo
    """Description of the vehicle: capabilities and limits."""
    follow_mode: str
    """Mode in which it follows setpoints."""
    hold_mode: str
    """Mode in which it holds its position by itself."""
    land_mode: str
    """Mode in which it lands where it is, and stops its motors."""
    _loop: Loop

    def __init__(self, options: BackendOptions, speed: float = 1.0, clock: Clock | None = None) -> None:
        super().__init__(options)
        if speed > 1.0:  # a pause of this computer is longer in the autopilot's time
            self.freshness = Freshness(*[speed] * 5)
        self.clock = SpedUpClock(speed) if clock is None else clock
        self._speed = speed
        self._session = session = _Session(self)
        watched_s = time.monotonic if speed > 1.0 else None
        self._loop = Loop(session, self.clock, session.watch, watched_s=watched_s)
        self._entrance = CommandEntrance(self._loop, self.clock, self._require_runner)
        self._thread = LoopThread(self._loop, self.clock, self.name, self._receive, session.on_defect)

    # --- What a subclass does -----------------------------------------------------------------------------------------

    @abstractmethod
    def receive(self, timeout_s: float) -> VehicleReport | Answer | None:
        """Returns the next message of the autopilot; None if none came within so many seconds. One thread calls it."""

    @abstractmethod
    def command(self, name: str) -> None:
        """Sends ``arm``, ``disarm``, or the name of the mode to change to. The same thread calls it."""

    @abstractmethod
    def follow(self, setpoint: Setpoint) -> None:
        """Sends a setpoint. From any thread, while messages of the autopilot arrive."""

    def reconnect(self) -> None:
        """Connects again, after an error that `receive` or `command` has raised. The same thread calls it."""

    # --- What it makes of that ----------------------------------------------------------------------------------------

    @override
    def open(self, on_update: UpdateCallback) -> None:
        self._loop.on_update = on_update
        self._thread.open()

    @override
    def close(self) -> None:
        self._thread.close()

    @override
    def info(self) -> VehicleInfo:
        return self.vehicle

    @override
    def send(self, setpoint: Setpoint) -> None:
        if self._session.watch.is_up(self.clock.now_s()):
            self.follow(setpoint)

    @override
    def arm(self) -> Future[None]:
        return self._give(_arming(ARM, is_armed=True))

    @override
    def disarm(self) -> Future[None]:
        return self._give(_arming(DISARM, is_armed=False))

    @override
    def take_off(self, height_m: float, limits: Limits) -> Future[None]:
        del height_m, limits  # the climb is flown with setpoints: VehicleInfo.flies_takeoff_on_setpoints
        return self._give(_flying("take off", self.follow_mode))

    @override
    def land(self, limits: Limits) -> Future[None]:
        del limits
        return self._give(_flying("land", self.land_mode))

    @override
    def take_control(self) -> Future[None]:
        return self._give(_flying("take control", self.follow_mode))

    @override
    def hold(self) -> Future[None]:
        return self._give(_flying("hold", self.hold_mode))

    def _give(self, command: Command[str]) -> Future[None]:
        return self._order(command.what, lambda: command)

    def _require_runner(self, what: str) -> CommandRunner[str] | UalError:
        session = self._session
        return session.runner if session.watch.is_up(self.clock.now_s()) else self._unreached(what)

    @override
    def _unreached(self, what: str) -> LinkLostError:
        return LinkLostError(f"cannot {what}: nothing is heard of the autopilot")

    def _receive(self, timeout_s: float) -> None:
        """Takes all that waits. The loop does the rest."""
        message = self.receive(timeout_s / self._speed)
        now_s = self.clock.now_s()
        has_paused = self._loop.woke(now_s) > 0.0
        has_pose = False
        while message is not None and not has_paused:
            self._session.on_message(message, now_s)
            has_pose = has_pose or isinstance(message, VehicleReport)
            message = self.receive(0.0)
        self._loop.step(now_s, has_news=has_pose)


class _Session:
    """State of the autopilot, and the commands in progress. Belongs to the loop's thread, except `watch.is_up`."""

    def __init__(self, backend: ReportingBackend) -> None:
        name, clock = backend.name, backend.clock
        self.watch = LinkWatch(name, backend.freshness.link_s, on_lost=self._discard_state)
        self.runner: CommandRunner[str] = CommandRunner(
            name, self._transmit, self._now, self.watch, setpoints_s=lambda _: math.inf
        )
        self._backend = backend
        self._controls = {backend.follow_mode: Control.REFERENCES, backend.land_mode: Control.LAND}
        self._epoch_s = time.time() - clock.now_s()
        self._plausibility = Plausibility()
        self._readings = Readings()
        self._report: Reading[VehicleReport] = self._readings.add(Valid.WHILE_HEARD)
        self._boots_count = self.watch.begin_boot()

    @property
    def is_urgent(self) -> bool:
        """Whether an answer is awaited."""
        return self.runner.is_any_pending

    def discard(self, now_s: float, pause_s: float) -> None:
        """Discards what may have changed in a pause of this computer, and what waits unread."""
        del now_s, pause_s
        self._discard_state()
        while self._backend.receive(0.0) is not None:
            pass

    def tick(self, now_s: float) -> None:
        """Does what is due."""
        self.watch.tick(now_s)
        self.runner.tick(now_s)

    def on_defect(self, error: Exception, now_s: float) -> None:
        """Begins again."""
        del error, now_s
        self._discard_state()
        self._backend.reconnect()

    def on_message(self, message: VehicleReport | Answer, now_s: float) -> None:
        """Takes a message of the autopilot."""
        self.watch.on_message(now_s)
        if isinstance(message, Answer):
            verdict = Verdict.REFUSED if message.refusal else Verdict.ACCEPTED
            self.runner.on_answer(message.command, verdict, now_s, message.refusal)
            return
        self._readings.order = message.boot_s
        if self.watch.on_boot_time(message.boot_s, now_s):
            self._boots_count = self.watch.begin_boot()
            self._readings.discard_boot()
            self.runner.drop(now_s)
        if not self.watch.is_boot_doubtful and self._plausibility.accepts_motion(message.pose, message.velocity):
            self._report.on_value(message, now_s)
            self.runner.on_state(now_s)

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns the newest data."""
        return self._now(now_s)._replace(updated_s=updated_s, scheduling_gap=scheduling_gap)

    def _discard_state(self) -> None:
        self._readings.discard_state()

    def _transmit(self, name: str, sent_before_count: int, key: Hashable) -> None:
        del sent_before_count, key
        self._backend.command(name)

    def _now(self, now_s: float) -> Snapshot:
        newest, link = self._report.sample, LinkState(boots_count=self._boots_count)
        if newest is None:
            return Snapshot(now_s, self.watch.heard_s, link=link)
        report, received_s = newest.value, newest.time_s
        mode = Mode(report.mode, self._controls.get(report.mode, Control.OTHER))
        return Snapshot(
            time_s=now_s,
            heard_s=self.watch.heard_s,
            control=ControlState(
                armed=Sample(report.is_armed, received_s),
                landed=Sample(LandedState.ON_GROUND if report.is_on_ground else LandedState.IN_AIR, received_s),
                mode=Sample(mode, received_s),
            ),
            motion=MotionState(
                stamp_s=self._epoch_s + received_s,
                measured_s=report.boot_s,
                estimator=Sample(Estimator(True), received_s),
                pose=Sample(report.pose, received_s),
                velocity=Sample(report.velocity, received_s),
            ),
            link=link,
        )


def _arming(what: str, *, is_armed: bool) -> Command[str]:
    return Command(what, what, ARMING, key=what, shows=shows_armed(is_armed=is_armed), repeat=_AGAIN)


def _flying(what: str, mode: str) -> Command[str]:
    return Command(what, mode, FLYING, key=mode, mode=mode, shows=shows_mode(mode), repeat=_AGAIN)
