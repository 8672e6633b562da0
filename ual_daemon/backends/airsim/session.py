"""The exchange with one vehicle of a simulator. Belongs to the loop's thread, but for what says otherwise."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from functools import partial
from typing import NamedTuple

from ual.errors import LinkLostError, RejectedByAutopilotError
from ual.geometry import Pose
from ual_daemon import logs
from ual_daemon.backends.airsim.clock import SimulatorClock
from ual_daemon.backends.airsim.collisions import CollisionWatch
from ual_daemon.backends.airsim.commands import Action, AirsimCommandQueue
from ual_daemon.backends.airsim.link import SimulatorLink
from ual_daemon.backends.airsim.rpc import RpcCaller
from ual_daemon.backends.airsim.snapshots import API, COLLISION, HOVER, REMOTE_CONTROL, make_snapshot, projection_of
from ual_daemon.backends.airsim.state import AirsimReport
from ual_daemon.backends.engine.command import Verdict
from ual_daemon.backends.engine.command_runner import CommandRunner, RunnerSettings
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.loop import Loop, LoopThread
from ual_daemon.backends.engine.plausibility import Plausibility
from ual_daemon.backends.engine.severe_texts import SEVERE, SevereTexts
from ual_daemon.backends.mailbox import SetpointMailbox
from ual_daemon.backends.values import LandedState, Mode, Setpoint, Snapshot

_log = logging.getLogger(__name__)

LINK_S = 2.0
"""Unreal pauses, too."""
_NO_TEXTS = RunnerSettings(text_s=0.0)
"""A refusal says its reason itself."""


def nothing() -> None:
    """Nothing begins with it."""


class AirsimRequest(NamedTuple):
    """A command as it is executed, and what is to be noted as it leaves."""

    actions: tuple[Action, ...]
    begin: Callable[[], None] = nothing

    def execute(self, connection: RpcCaller) -> None:
        """Does one after another."""
        for action in self.actions:
            action(connection)


class AirsimSession:
    """It is what the loop drives."""

    def __init__(
        self,
        link: SimulatorLink,
        queue: AirsimCommandQueue,
        mailbox: SetpointMailbox,
        clock: SimulatorClock,
        mass_kg: float,
        wall_s: Callable[[], float],
    ) -> None:
        self.watch = LinkWatch(str(link.address), LINK_S, on_lost=self._discard)
        self.runner: CommandRunner[AirsimRequest] = CommandRunner(
            "the simulator",
            self._transmit,
            self._data,
            self.watch,
            lambda _: math.inf,
            _NO_TEXTS,
            lambda: queue.why_late,
        )
        self.loop = Loop(self, clock, self.watch, wake=link.wake, watched_s=wall_s)
        self.thread = LoopThread(
            self.loop, clock, f"airsim {link.address}", self._receive, lambda error, _: link.lose(error), link.close
        )
        self.on_pose: Callable[[float, Pose], object] = lambda *_: None
        """Called with the simulator's time and where the vehicle was then. Set by the backend."""
        self._link = link
        self._queue = queue
        self._mailbox = mailbox
        self._clock = clock
        self._mass_kg = mass_kg
        self._plausibility = Plausibility()
        self._collisions = CollisionWatch()
        self._report: AirsimReport | None = None
        self._snapshot = Snapshot(0.0)
        self._boots_count = 0
        self._sending = threading.Lock()
        """Held from the decision that a setpoint may leave until it waits to be sent."""
        self._has_collided = self._is_holding = self._is_paused = self._is_disarming = False
        self._status_text, self._severe_texts = "", SevereTexts()

    # --- From any thread ----------------------------------------------------------------------------------------------

    @property
    def report(self) -> AirsimReport | None:
        """Last report of the simulator; None while the link is down."""
        return self._report if self._link.is_up else None

    @property
    def boots_count(self) -> int:
        """Starts of the simulator that were noticed."""
        return self._boots_count

    @property
    def utc_s(self) -> float | None:
        """The simulator's time; None before it has reported it."""
        return None if self._report is None else self._report.time_s

    @property
    def is_on_ground(self) -> bool:
        """Whether it stands on the ground, as far as it is received."""
        report = self.report
        return report is not None and report.is_on_ground(self._mass_kg)

    @property
    def vehicle(self) -> str:
        """Its name in the simulator."""
        assert self._link.simulator is not None
        return self._link.simulator.vehicle

    @property
    def own_speed(self) -> float:
        """Speed of simulated time by the simulator's settings."""
        return 1.0 if self._link.simulator is None else self._link.simulator.clock_speed

    def require_runner(self, what: str) -> CommandRunner[AirsimRequest] | LinkLostError:
        """Returns what runs commands; or why none can leave."""
        return self.runner if self._link.is_up else LinkLostError(f"cannot {what}: {self._link.trouble}")

    def send(self, setpoint: Setpoint) -> None:
        """Sends a setpoint, unless the vehicle is to have none."""
        with self._sending:
            is_free = not (self._has_collided or self._is_holding or self._is_paused or self._is_disarming)
            if self._link.is_up and is_free:
                self._mailbox.put(setpoint)

    def execute(self, action: Action) -> Future[None]:
        """Executes what the simulated pilot and the world around the vehicle do, by none of the rules of commands."""
        return self._queue.submit(action)

    def begin_hold(self) -> None:
        """Sends no setpoint until control is taken again."""
        with self._sending:
            self._is_holding = True
            self._mailbox.drop()

    def begin_disarming(self) -> None:
        """Sends no setpoint until it is disarmed: a velocity would start the motors again."""
        with self._sending:
            self._is_disarming = True
            self._mailbox.drop()

    def begin_control(self) -> None:
        """Sends setpoints again: after a collision, or where it held by itself."""
        self._has_collided = self._is_holding = self._is_disarming = False

    @contextmanager
    def without_setpoints(self) -> Iterator[None]:
        """No setpoint is sent until the block ends. Blocks until one whose sending has begun has left."""
        with self._sending:
            self._is_paused = True
        self._mailbox.settle()
        try:
            yield
        finally:
            self._is_paused = False

    # --- What the loop drives -----------------------------------------------------------------------------------------

    @property
    def is_urgent(self) -> bool:
        """Whether an answer is awaited."""
        return self.runner.is_any_pending

    def discard(self, now_s: float, pause_s: float) -> None:
        """Discards what may have changed in a pause of this computer."""
        del now_s, pause_s
        self._discard()
        self._link.discard()

    def tick(self, now_s: float) -> None:
        """Does what is due; to be called often."""
        self.watch.tick(now_s)
        self.runner.tick(now_s)

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns the newest data."""
        link, known = self._link, self._snapshot.link
        if known.trouble != link.trouble or known.conflict != link.why_not:  # seldom
            known = known._replace(trouble=link.trouble, conflict=link.why_not)
        heard_s = now_s if link.why_not else self._snapshot.heard_s  # the simulator answers, but not for our vehicle
        return self._data(now_s)._replace(
            heard_s=heard_s, updated_s=updated_s, scheduling_gap=scheduling_gap, link=known
        )

    def _data(self, now_s: float) -> Snapshot:
        return self._snapshot._replace(time_s=now_s)

    def _discard(self) -> None:
        known = self._snapshot
        self._snapshot = known._replace(
            control=known.control._replace(armed=None, landed=None, mode=None),
            motion=known.motion._replace(estimator=None, pose=None, velocity=None),
        )

    def _receive(self, timeout_s: float) -> None:
        was_up = self._link.is_up
        report = self._link.receive(timeout_s)
        now_s = self._clock.now_s()
        if not was_up:  # connecting takes its time, which is no pause of this computer
            self.loop.restart(now_s)
            self.loop.publish(now_s)
        if self.loop.woke(now_s):
            report = None
        if report is not None:
            now_s = self._on_report(report)
        self.loop.step(now_s, has_news=report is not None)

    # --- What comes ---------------------------------------------------------------------------------------------------

    def on_connect(self, has_booted: bool) -> None:
        """Notes a new connection, and whether it is to a simulator that was started since the last one."""
        if has_booted:
            self.runner.drop(self._clock.now_s())
            self._boots_count = self.watch.begin_boot()
        self._queue.disconnect()  # it was lost as well

    def _on_report(self, report: AirsimReport) -> float:
        """Takes what the simulator reports. Returns the time."""
        assert self._link.simulator is not None
        now_s = self._clock.advance(report.time_s)
        self.watch.on_message(now_s)
        self._report = report
        is_on_ground = report.is_on_ground(self._mass_kg)
        self._note_collision(report, now_s, is_on_ground)
        self._is_disarming = self._is_disarming and is_on_ground and report.is_armed
        snapshot = make_snapshot(
            report,
            now_s,
            self._mode(report),
            LandedState.ON_GROUND if is_on_ground else LandedState.IN_AIR,
            projection_of(self._link.simulator),
            is_plausible=self._plausibility.accepts_motion(report.pose, report.velocity),
        )
        motion = snapshot.motion
        if motion.pose is not None:
            self.on_pose(motion.stamp_s, motion.pose.value)
        self._snapshot = snapshot._replace(
            condition=snapshot.condition._replace(
                status_text=self._status_text, severe_texts=self._severe_texts.fresh(now_s)
            ),
            link=snapshot.link._replace(boots_count=self._boots_count),
        )
        self.runner.tick(now_s)  # the loop's own ticks stand still with simulated time
        return now_s

    def _mode(self, report: AirsimReport) -> Mode:
        if not report.has_api_control:
            return REMOTE_CONTROL
        if self._is_holding:
            return HOVER
        return COLLISION if self._has_collided else API

    def _note_collision(self, report: AirsimReport, now_s: float, is_on_ground: bool) -> None:
        what = self._collisions.observe(report)
        if what:
            self._status_text = f"collision with {what}"
            self._severe_texts.on_text(self._status_text, SEVERE, now_s)
            logs.event(_log, logging.WARNING, "collision", object=what)
            with self._sending:
                self._mailbox.drop()
                self._has_collided = not is_on_ground
        elif is_on_ground:
            self._has_collided = self._is_holding = False

    # --- Commands -----------------------------------------------------------------------------------------------------

    def _transmit(self, request: AirsimRequest, _: int, key: Hashable) -> Callable[[], object]:
        """Has a command executed. Returns what stops it, as far as its calls have not left yet."""
        request.begin()
        answer = self._queue.submit(request.execute)
        answer.add_done_callback(partial(self._on_ended, key))
        return answer.cancel

    def _on_ended(self, key: Hashable, answer: Future[None]) -> None:
        """Takes the end of a command, on the thread that executes them."""
        if not answer.cancelled():
            verdict, text = _read(answer.exception())
            self.loop.post(lambda now_s: self.runner.on_answer(key, verdict, now_s, text))


def _read(error: BaseException | None) -> tuple[Verdict, str]:
    if error is None:
        return Verdict.ACCEPTED, ""
    if isinstance(error, RejectedByAutopilotError):
        return Verdict.REFUSED, error.metadata["text"]
    return Verdict.LOST, ""
