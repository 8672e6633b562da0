"""Commands as calls of MAVROS' services. Each is repeated until the autopilot shows its effect, or refuses.

``set_mode`` answers only that its message was sent, and ``cmd/...`` with the autopilot's acknowledgement, or after 5 s
without one. So the effect counts.

A safety pilot who takes over must not be overruled. So a mode is asked for only when nothing holds up the call and the
present mode was said just now, once until it is answered, and again only if the autopilot shows after the answer that
it was not entered.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from ual.errors import RejectedByAutopilotError, UalError, UalTimeoutError
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.mavros import topics
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.values import LandedState, Snapshot

AGAIN_S = 1.0
"""A command that shows no effect is given again after this."""
LIMIT_S = 4.5
"""A command is not sent any more after this."""
CALL_S = 6.0
SETPOINTS_WAIT_S = 3.0
"""A mode that needs setpoints is asked for after this even without them, so that the autopilot says what is wrong."""
HEARD_S = 0.3
"""Nothing is sent, neither first nor again, while nothing has been heard for so long: what MAVROS gets in a stall, it
executes after it, when the safety pilot may have taken over. In flight messages come at 50 Hz, and before the streams
are set with the time of the autopilot, at 10 Hz. Where even that does not come, a command leaves with a heartbeat.
"""
MODE_S = 0.3
"""A mode is asked for only while the present one was said within this time: after a stall the safety pilot may have
taken over. A PX4 that is armed is asked for a heartbeat each 0.2 s, and an ArduPilot streams ten a second. Where they
come once a second, a mode leaves with one of them.
"""
ENTERED_S = 0.3
"""A mode that was sent may show so late. Another one that is shown sooner does not say that it was not entered."""
TEXT_S = 0.3
"""How long after a refusal the autopilot's texts about it may come."""
MOST_TEXTS = 20
_ACCEPTED = 0
_RESULTS = {1: "TEMPORARILY_REJECTED", 2: "DENIED", 3: "UNSUPPORTED", 4: "FAILED", 5: "IN_PROGRESS", 6: "CANCELLED"}
_IN_PROGRESS = 5

Answer = Message | ServiceError
"""The answer of a service, or why there is none."""
CallService = Callable[[str, Message, Callable[[Answer], None], float], "Future[Message]"]
"""Calls a service: its name, its arguments, who takes the answer, and the time limit in seconds. Cancelling the future
withdraws the call, if it has not left yet.
"""
Shows = Callable[[Snapshot, float], bool]
"""Whether a snapshot shows the effect of what was sent at a time."""


@dataclass(frozen=True, slots=True)
class Step:
    """One call of a service. `is_mode`: its answer says nothing of the autopilot's."""

    service: str
    arguments: Message
    what: str
    shows: Shows
    is_mode: bool = False
    setpoints_before_s: float = 0.0


def set_mode(name: str, what: str, setpoints_before_s: float = 0.0) -> Step:
    """Changes the mode."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        mode = snapshot.mode
        return mode is not None and mode.time_s > since_s and mode.value.name == name

    arguments = {"base_mode": 0, "custom_mode": name}
    return Step(topics.SET_MODE, arguments, what, shows, is_mode=True, setpoints_before_s=setpoints_before_s)


def arm_or_disarm(*, is_arming: bool) -> Step:
    """Arms or disarms, never by force."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        armed = snapshot.armed
        return armed is not None and armed.time_s > since_s and armed.value is is_arming

    return Step(topics.ARMING, {"value": is_arming}, "arm" if is_arming else "disarm", shows)


def climb(altitude_m: float) -> Step:
    """Takes off to a height above home, as ArduPilot takes it. Its place is where it stands."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        landed, flying = snapshot.landed, (LandedState.TAKING_OFF, LandedState.IN_AIR)
        return landed is not None and landed.time_s > since_s and landed.value in flying

    place = {"min_pitch": 0.0, "yaw": 0.0, "latitude": 0.0, "longitude": 0.0}
    return Step(topics.TAKE_OFF, {**place, "altitude": altitude_m}, "take off", shows)


def arming(autopilot: Autopilot, snapshot: Snapshot) -> tuple[Step, ...]:
    """Arms, from a mode in which it can be armed."""
    mode = _mode_in(snapshot)
    arm = arm_or_disarm(is_arming=True)
    if autopilot.can_be_armed_in(mode):
        return (arm,)
    return (set_mode(autopilot.arming_mode, f"leave {mode}, to be armed"), arm)


def taking_off(autopilot: Autopilot, altitude_m: float | None) -> tuple[Step, ...]:
    """Takes off: by setpoints, or to a height above home."""
    enter = set_mode(autopilot.setpoint_mode, "take off", autopilot.setpoints_before_mode_s)
    return (enter,) if altitude_m is None else (enter, climb(altitude_m))


@dataclass(slots=True)
class _Running:
    """A command under way, and the step at which it is."""

    steps: tuple[Step, ...]
    is_withdrawn: Callable[[], bool]
    begun_s: float
    mode_before: str
    future: Future[None] = field(default_factory=Future)
    sent_s: float = 0.0
    next_s: float = 0.0
    sends_count: int = 0
    is_called: bool = False
    call: Future[Message] | None = None
    """The newest call."""
    is_mode_sent: bool = False
    mode_sent_s: float = math.inf
    """When MAVROS had answered that it had sent the mode."""
    refuser: str = ""
    refusal: str = ""
    refused_s: float = 0.0
    texts: list[str] = field(default_factory=list)

    @property
    def step(self) -> Step:
        return self.steps[0]


class Commands:
    """The command under way to one autopilot; a newer one replaces it. Belongs to the link's thread.

    `call` calls a service, `setpoints_s` returns for how long setpoints have been sent, and `is_held_up` whether
    MAVROS may execute a command late: none leaves then. `on_mode_sent` is called when it has been executed.
    """

    def __init__(
        self,
        name: str,
        call: CallService,
        setpoints_s: Callable[[float], float],
        is_held_up: Callable[[], bool],
        on_mode_sent: Callable[[], None],
    ) -> None:
        self._name = name
        self._call = call
        self._setpoints_s = setpoints_s
        self._is_held_up = is_held_up
        self._on_mode_sent = on_mode_sent
        self._running: _Running | None = None
        self._now_s = 0.0
        """The time of the newest tick."""

    @property
    def is_under_way(self) -> bool:
        """Whether a command waits for its effect, so that the state is wanted often."""
        return self._running is not None

    def submit(self, steps: tuple[Step, ...], snapshot: Snapshot, is_withdrawn: Callable[[], bool]) -> Future[None]:
        """Begins a command. The future ends with its effect, with the autopilot's refusal, or because it could not be
        sent or was not answered for `LIMIT_S`; else it stays open.
        """
        self._end()
        running = self._running = _Running(steps, is_withdrawn, snapshot.time_s, _mode_in(snapshot))
        running.future.set_running_or_notify_cancel()
        return running.future

    def drop(self) -> None:
        """Drops the command: what it was for may have changed. Its future stays open."""
        self._end()

    def _end(self) -> None:
        """Ends the command under way, if there is one. A call of it that has not left yet is withdrawn."""
        running, self._running = self._running, None
        if running is not None and running.call is not None:
            running.call.cancel()

    def on_text(self, text: str) -> None:
        """Takes a text of the autopilot, which may explain a refusal."""
        running = self._running
        if running is None or not running.sends_count or text in running.texts:
            return
        if len(running.texts) < MOST_TEXTS:
            running.texts.append(text)

    def tick(self, snapshot: Snapshot) -> None:
        """Does what is due; to be called often."""
        running = self._running
        self._now_s = now_s = snapshot.time_s
        if running is None:
            return
        if running.is_mode_sent and running.mode_sent_s == math.inf:
            running.mode_sent_s = now_s
        running.mode_before = running.mode_before or _mode_in(snapshot)
        if running.is_withdrawn() or self._is_over(running, snapshot):
            self._end()
        elif running.sends_count and running.step.shows(snapshot, running.sent_s):
            self._advance(running, now_s)
        elif running.refusal:
            if now_s - running.refused_s >= TEXT_S:
                self._refuse(running)
        elif now_s >= running.next_s and not running.is_called and not self._hindrance(running, snapshot):
            self._send(running, now_s)

    def _is_over(self, running: _Running, snapshot: Snapshot) -> bool:
        """Whether it is too late, or somebody else has changed the mode since, and must not be overruled."""
        if snapshot.time_s - running.begun_s > LIMIT_S and not running.refusal:
            self._be_late(running, snapshot)
            return True
        if not running.sends_count and running.step.service == topics.ARMING:
            return False  # in whatever mode: that overrules nobody
        return _mode_in(snapshot) not in {running.mode_before, *(_mode_of(step) for step in running.steps), ""}

    def _be_late(self, running: _Running, snapshot: Snapshot) -> None:
        what = running.step.what
        if running.step.is_mode and running.texts:
            running.refusal = "the mode was not entered"
            self._refuse(running)
        elif not running.sends_count:
            why = self._hindrance(running, snapshot) or "it had to wait for too long"
            self._fail(running, UalTimeoutError(f"the command to {what} was not sent: {why}"))
        elif running.is_called:
            words = f"MAVROS has not answered the command to {what}, which may still be executed"
            self._fail(running, UalTimeoutError(words))

    def _hindrance(self, running: _Running, snapshot: Snapshot) -> str:
        """Returns what a command has to wait for, for people; empty if it may be sent."""
        now_s, needed_s = snapshot.time_s, running.step.setpoints_before_s
        if needed_s and self._setpoints_s(now_s) < needed_s and now_s - running.begun_s < SETPOINTS_WAIT_S:
            return "no setpoints were sent before it"
        if self._is_held_up():
            return "the bridge or MAVROS would execute it late"
        if snapshot.heard_s is None or now_s - snapshot.heard_s > HEARD_S:
            return "MAVROS publishes nothing of the autopilot"
        if running.step.is_mode and not self._may_ask(running, snapshot):
            return "MAVROS does not publish the mode"
        return ""

    def _may_ask(self, running: _Running, snapshot: Snapshot) -> bool:
        """Whether the present mode is known, and a mode was not asked for yet, or is known not to have been entered."""
        if not knows_mode(snapshot):
            return False
        mode = snapshot.mode
        since_s = running.mode_sent_s + ENTERED_S
        return running.sends_count == 0 or (mode is not None and mode.time_s >= since_s)

    def _send(self, running: _Running, now_s: float) -> None:
        running.sends_count += 1
        running.sent_s = running.sent_s if running.sends_count > 1 else now_s
        running.next_s = now_s + AGAIN_S
        running.is_called, running.is_mode_sent, running.mode_sent_s = True, False, math.inf
        step = running.step

        def take(answer: Answer) -> None:
            if self._running is running and running.step is step:
                running.is_called = False
                self._take(running, answer)

        running.call = self._call(step.service, step.arguments, take, CALL_S)

    def _take(self, running: _Running, answer: Answer) -> None:
        """Takes the answer of a service. One that has not answered in time may have been executed."""
        if isinstance(answer, ServiceTimeoutError):
            return
        if isinstance(answer, ServiceError):
            running.refuser, running.refusal, running.refused_s = "MAVROS", str(answer), self._now_s
            return
        if running.step.is_mode:
            if answer.get("mode_sent"):
                running.is_mode_sent = True
                self._on_mode_sent()
            else:
                running.refusal, running.refused_s = "MAVROS does not know the mode, or hears no autopilot", 0.0
            return
        result = int(answer.get("result", _ACCEPTED))
        if result not in (_ACCEPTED, _IN_PROGRESS):
            running.refusal = _RESULTS.get(result, f"result {result}")
            running.refused_s = self._now_s
        elif answer.get("success"):
            running.next_s = float("inf")  # acknowledged: only the effect is to come

    def _advance(self, running: _Running, now_s: float) -> None:
        if len(running.steps) == 1:
            self._end()
            running.future.set_result(None)
            return
        running.mode_before = _mode_of(running.step) or running.mode_before
        running.steps = running.steps[1:]
        running.begun_s, running.next_s, running.sends_count = now_s, now_s, 0
        running.is_called = running.is_mode_sent = False

    def _refuse(self, running: _Running) -> None:
        said = "".join(f"; it said: {text}" for text in running.texts)
        words = f"{running.refuser or self._name} refused to {running.step.what}: {running.refusal}{said}"
        metadata = {"result": running.refusal, "text": "; ".join(running.texts)}
        self._fail(running, RejectedByAutopilotError(words, metadata))

    def _fail(self, running: _Running, error: UalError) -> None:
        self._end()
        running.future.set_exception(error)


def knows_mode(snapshot: Snapshot) -> bool:
    """Whether the mode was said just now."""
    return snapshot.mode is not None and snapshot.time_s - snapshot.mode.time_s <= MODE_S


def _mode_in(snapshot: Snapshot) -> str:
    return "" if snapshot.mode is None else snapshot.mode.value.name


def _mode_of(step: Step) -> str:
    return str(step.arguments["custom_mode"]) if step.is_mode else ""
