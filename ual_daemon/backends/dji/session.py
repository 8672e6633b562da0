"""The exchange with one aircraft through its wrapper. Belongs to the link's thread, but for what says otherwise."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from functools import partial

from ual.errors import LinkLostError, RejectedByAutopilotError
from ual_daemon import logs
from ual_daemon.backends.base import Clock
from ual_daemon.backends.dji.authority import Holding
from ual_daemon.backends.dji.commands import TEXT_S, DjiRequest, Grant, obtaining, read_answer, request
from ual_daemon.backends.dji.discovery import WrapperDiscovery
from ual_daemon.backends.dji.gimbals import ROTATION, ROTATION_TYPE
from ual_daemon.backends.dji.landing import LandingRequest
from ual_daemon.backends.dji.settings import DjiSettings
from ual_daemon.backends.dji.telemetry import LINK_S, DjiTelemetry
from ual_daemon.backends.dji.wrappers import JOY, DjiCall, DjiTopic, OsdkVehicleNode, Wrapper
from ual_daemon.backends.engine.command import Command, Verdict
from ual_daemon.backends.engine.command_runner import CommandRunner, RunnerSettings
from ual_daemon.backends.engine.limits import BLIND_SILENCE_S
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.rosbridge import Message, RosbridgeLink, RosbridgeState
from ual_daemon.backends.values import Snapshot, VelocitySetpoint

_log = logging.getLogger(__name__)

_TOPIC_SILENCE_S = 5.0
"""Seconds of silence after which a topic is subscribed to again."""
_MOST_NAMED_TOPICS = 3
"""More topics are not named at once."""
_CONFIRM_AGAIN_S = 1.0
_LONGEST_LANDING_GAP_S = 10.0
"""After a longer silence the aircraft's own landing may be that of others."""
_GIVEN_UP = "the landing was given up, as nothing was heard for a while and others may fly; land it, or let the pilot"
_CONFIRM, _RELEASE = "confirm", "release"
"""Groups of commands."""


class DjiSession:
    """It is what the backend's loop drives."""

    def __init__(self, link: RosbridgeLink, clock: Clock, settings: DjiSettings) -> None:
        self.telemetry: DjiTelemetry | None = None
        """None until the wrapper was found."""
        self.watch = LinkWatch(str(link.url), LINK_S, on_lost=self._discard)
        self.runner: CommandRunner[DjiRequest] = CommandRunner(
            "the aircraft",
            self._transmit,
            self._data,
            self.watch,
            lambda _: math.inf,
            RunnerSettings(TEXT_S),
            self._why_late,
        )
        self.holding = Holding()
        self.on_payload: Callable[[str, Message, float], object] = lambda *_: None
        """Takes what is reported of the gimbal: the handler's name, the message and the time. Set by the backend."""
        self.has_news = False
        """Whether a pose came since this was set back."""
        self._link = link
        self._clock = clock
        self._settings = settings
        self._discovery = WrapperDiscovery(link)
        self._had_authority = False
        self._landing: LandingRequest | None = None
        self._confirmation: Future[None] = Future()
        self._confirmed_s = -math.inf
        self._blocking: Future[Message] | None = None
        """The answer without which the wrapper serves nothing else."""
        self._joystick: Future[Message] | None = None
        self._braked = ""

    # --- From any thread ----------------------------------------------------------------------------------------------

    @property
    def why_no_vehicle(self) -> str:
        """Why no aircraft can be flown, human-readable."""
        return self._link.why_not if self._link.state is not RosbridgeState.UP else self._discovery.why_not

    def require_runner(self, what: str) -> CommandRunner[DjiRequest] | LinkLostError:
        """Returns what runs commands; or why none can leave."""
        is_reached = self.telemetry is not None and self._link.is_up
        return self.runner if is_reached else LinkLostError(f"cannot {what}: {self.why_no_vehicle}")

    def send(self, setpoint: VelocitySetpoint) -> None:
        """Sends a velocity, where the aircraft follows us."""
        telemetry = self.telemetry
        if telemetry is None or not telemetry.has_authority or not self._link.is_up or self._is_blocked:
            return
        message = telemetry.wrapper.setpoint(setpoint)
        if telemetry.wrapper.setpoint_topic:
            self._link.publish(telemetry.wrapper.setpoint_topic, message)
        elif self._joystick is None or self._joystick.done():  # else the next one leaves when this one is answered
            self._joystick = self._link.call_service(OsdkVehicleNode.joystick, message, 0.5)
        braked = telemetry.note_setpoint(setpoint.velocity, self._clock.now_s())
        if braked and not self._braked:
            logs.event(_log, logging.WARNING, "braked", why=braked)
        self._braked = braked

    # --- What the loop drives -----------------------------------------------------------------------------------------

    @property
    def is_urgent(self) -> bool:
        """Whether an answer is awaited."""
        return self.runner.is_any_pending

    def discard(self, now_s: float, pause_s: float) -> None:
        """Discards what may have changed in a pause of this computer."""
        self._discard()
        self._note_gap(pause_s, now_s)

    def tick(self, now_s: float) -> None:
        """Does what is due; to be called often."""
        if self.telemetry is None and self._link.is_up:
            self._discover(now_s)
        self.watch.tick(now_s)
        self.runner.tick(now_s)
        telemetry = self.telemetry
        if telemetry is not None:
            self._confirm_landing(telemetry, now_s)

    def snapshot(self, now_s: float, updated_s: float, scheduling_gap: str) -> Snapshot:
        """Returns the newest data."""
        telemetry = self.telemetry
        missing = "" if telemetry is None else self._missing(telemetry, now_s)
        snapshot = self._data(now_s, missing)._replace(updated_s=updated_s, scheduling_gap=scheduling_gap)
        why = "" if telemetry is not None and self._link.is_up else self.why_no_vehicle
        return snapshot.with_trouble(why) if why else snapshot

    def _data(self, now_s: float, missing: str = "") -> Snapshot:
        telemetry = self.telemetry
        if telemetry is None:
            return Snapshot(now_s)
        return telemetry.snapshot(now_s, missing)._replace(heard_s=self.watch.heard_s)

    def _missing(self, telemetry: DjiTelemetry, now_s: float) -> str:
        """Returns which topics do not come without which it cannot be flown, human-readable; empty if they come."""
        missing = telemetry.missing_topics(now_s)
        return "; ".join(self._fault(topic) for topic in missing[:_MOST_NAMED_TOPICS])

    def _fault(self, topic: DjiTopic) -> str:
        name = self._link.url.resolve(topic.name)
        known = (fault for fault in self._link.faults() if name in fault.split())
        return next(known, f"nothing comes on {name}")

    # --- What comes ---------------------------------------------------------------------------------------------------

    def _discover(self, now_s: float) -> None:
        wrapper = self._discovery.find(now_s)
        if wrapper is not None:
            telemetry = DjiTelemetry(wrapper, self._settings)
            self._subscribe(wrapper, telemetry)  # raises OSError where the connection breaks: it is found again then
            self.telemetry = telemetry

    def _subscribe(self, wrapper: Wrapper, telemetry: DjiTelemetry) -> None:
        for topic in wrapper.topics:
            is_log = topic.name == "/rosout"
            self._link.subscribe(
                topic.name,
                topic.kind,
                # Every node logs there: that is no sign of life of the aircraft.
                partial(self._on_log, telemetry) if is_log else partial(self._on_message, telemetry, topic.handler),
                queue_length=10 if is_log else 1,
                silence_s=math.inf if is_log else _TOPIC_SILENCE_S,
            )
        for topic in wrapper.payload_topics:
            handler = partial(self._on_payload, topic.handler)
            self._link.subscribe(topic.name, topic.kind, handler, silence_s=_TOPIC_SILENCE_S)
        if wrapper.payload_topics:
            self._link.advertise(ROTATION, ROTATION_TYPE)
        if wrapper.setpoint_topic:
            self._link.advertise(wrapper.setpoint_topic, JOY)

    def _on_message(self, telemetry: DjiTelemetry, name: str, message: Message, now_s: float) -> None:
        """Takes the message of a topic that the wrapper alone publishes."""
        silence_s = self.watch.on_message(now_s)
        self._note_gap(silence_s, now_s)
        if silence_s > BLIND_SILENCE_S:
            telemetry.authority.note_silence()
        poses_count = telemetry.poses_count
        telemetry.on_message(name, message, now_s)
        self.has_news = self.has_news or telemetry.poses_count != poses_count
        self._withdraw_setpoint(telemetry)
        if telemetry.is_authority_known:
            self.holding.observe(now_s, is_ours=not telemetry.why_authority_lost)
        if self.runner.is_any_pending:
            self.runner.on_state(now_s)

    def _on_payload(self, handler: str, message: Message, now_s: float) -> None:
        self.on_payload(handler, message, now_s)

    def _on_log(self, telemetry: DjiTelemetry, message: Message, now_s: float) -> None:
        """Takes what any node logs: the wrapper writes there what DJI's SDK answered."""
        text = telemetry.text_of(message)
        if text:
            telemetry.say(text, now_s)
            telemetry.note_severity(message, text, now_s)
            self.runner.on_text(text)

    def _withdraw_setpoint(self, telemetry: DjiTelemetry) -> None:
        """Withdraws the setpoint that may wait in a full socket, once the authority is lost."""
        had_authority, self._had_authority = self._had_authority, telemetry.has_authority
        if not had_authority or self._had_authority:
            return
        if telemetry.wrapper.setpoint_topic:
            self._link.withdraw(telemetry.wrapper.setpoint_topic)
        elif self._joystick is not None:
            self._joystick.cancel()

    def _discard(self) -> None:
        if self.telemetry is not None:
            self.telemetry.discard_state()

    # --- Commands -----------------------------------------------------------------------------------------------------

    def with_authority(
        self, grant: Grant, command: Callable[[Wrapper, Grant], Command[DjiRequest]] | None, *, is_known: bool = True
    ) -> Command[DjiRequest]:
        """Returns a command that obtains the control authority first, unless it `is_known` to be ours: DJI starts
        nothing without it.
        """
        telemetry = self._found()
        then = None if command is None else command(telemetry.wrapper, grant)
        if then is not None and is_known and telemetry.wrapper.says_authority and telemetry.has_authority:
            return then
        self.holding.ask(self._clock.now_s())
        return obtaining(telemetry.wrapper, partial(self._on_obtained, telemetry, grant), then)

    def _on_obtained(self, telemetry: DjiTelemetry, grant: Grant, call: DjiCall) -> None:
        """Notes which of the services that obtain the control authority were executed."""
        grant.is_obtained = True
        if call is telemetry.wrapper.obtain[-1]:
            telemetry.note_granted(self.holding.requested_s, self._clock.now_s())

    def let_go(self, grant: Grant, result: Future[None]) -> None:
        """Releases the control authority where the rest of the command was refused, or was not called."""
        error = None if result.cancelled() else result.exception()
        is_unused = grant.is_obtained and not grant.is_used
        if error is None or not (isinstance(error, RejectedByAutopilotError) or is_unused):
            return
        self.holding.drop()
        if grant.is_obtained:
            self.runner.submit(self._releasing(_RELEASE), self._clock.now_s()).add_done_callback(_log_refusal)

    def release(self, group: str) -> Command[DjiRequest]:
        """Gives up the control authority, and forgets a landing. Executed late, it takes nothing from anybody."""
        self.end_landing()
        return self._releasing(group)

    def _releasing(self, group: str) -> Command[DjiRequest]:
        telemetry = self._found()
        telemetry.note_released()
        call = DjiRequest(telemetry.wrapper.release)
        return Command("give up the control authority", call, group, is_harmless=True, on_done=self.holding.drop)

    def _found(self) -> DjiTelemetry:
        assert self.telemetry is not None  # `require_runner` has said so
        return self.telemetry

    @property
    def _is_blocked(self) -> bool:
        """Whether the wrapper serves nothing now, because a service that blocks it has not answered."""
        return self._blocking is not None and not self._blocking.done()

    def _why_late(self) -> str:
        """Returns why a service that is called now would be executed late, human-readable; empty if it would not."""
        if self._is_blocked:
            return "the wrapper serves nothing until its take-off has ended"
        return "the bridge would execute it late" if self._link.holds_up_calls else ""

    def _transmit(self, order: DjiRequest, _: int, key: Hashable) -> Callable[[], object]:
        """Calls a service. Returns what withdraws the call while it has not left.

        One that blocks the wrapper is waited for, as nothing else shows when the wrapper is free again. The aircraft
        refuses it without the control authority.
        """
        call = order.call
        if order.grant is not None:
            order.grant.is_used = True
        answer = self._link.call_service(call.service, call.arguments, call.patience_s)
        if call.blocks:
            self._blocking = answer
        answer.add_done_callback(partial(self._on_answer, call, key))

        def take_back() -> None:
            if not answer.done():
                if self.watch.why_silent(self._clock.now_s()):
                    self._tell_open(call)
                if not call.blocks:
                    answer.cancel()

        return take_back

    def _on_answer(self, call: DjiCall, key: Hashable, answer: Future[Message]) -> None:
        if answer.cancelled():
            return
        reply, telemetry = read_answer(answer), self._found()
        verdict = reply.verdict if self._link.is_up or reply.verdict is Verdict.ACCEPTED else Verdict.LOST
        if verdict is Verdict.LOST:
            self._tell_open(call)
        reasons = (reply.text, telemetry.why_not_start, telemetry.wrapper.reasons)
        self.runner.on_answer(key, verdict, self._clock.now_s(), "; ".join(filter(None, reasons)))

    def _tell_open(self, call: DjiCall) -> None:
        text = f"{call.service} was not answered: it may still be executed"
        logs.event(_log, logging.WARNING, "call_open", why=text)
        self._found().say(text, self._clock.now_s())

    # --- Landings by the aircraft itself ------------------------------------------------------------------------------

    def begin_landing(self) -> None:
        """Notes a landing that was accepted. Where it was refused, one that is in progress goes on."""
        self._landing = LandingRequest(self._clock.now_s())

    def end_landing(self) -> None:
        """Forgets a landing that was requested: it is not confirmed any more."""
        self._landing = None
        self._confirmation.cancel()

    def _note_gap(self, gap_s: float, now_s: float) -> None:
        """Ends a landing, once the flight may have become another's unseen.

        The landing goes on in a silence, and waits above the ground for its confirmation. If the mode and the authority
        still are those of our landing after a short silence, it is confirmed. Within that time nobody takes over, hands
        over to another program, and lands with it. After a long one it waits for the pilot.
        """
        landing = self._landing
        if landing is not None and not landing.has_ended and gap_s > _LONGEST_LANDING_GAP_S:
            self.end_landing()
            self._found().say(_GIVEN_UP, now_s)
            logs.event(_log, logging.WARNING, "landing_given_up", why=_GIVEN_UP)

    def _confirm_landing(self, telemetry: DjiTelemetry, now_s: float) -> None:
        """Confirms a landing that was requested: near the ground the aircraft waits for that."""
        landing, call = self._landing, telemetry.wrapper.confirm_landing
        if landing is None:
            return
        is_needed = landing.needs_confirmation(telemetry, self._settings.confirm_landing_below_m, now_s)
        if is_needed and call is not None and now_s - self._confirmed_s >= _CONFIRM_AGAIN_S:
            self._confirmed_s = now_s
            self._confirmation = self.runner.submit(request("confirm the landing", call, _CONFIRM), now_s)
            self._confirmation.add_done_callback(_log_refusal)
        if landing.has_ended:
            self._confirmation.cancel()


def _log_refusal(answer: Future[None]) -> None:
    """Logs what was refused of what nobody waits for."""
    error = None if answer.cancelled() else answer.exception()
    if error is not None:
        logs.event(_log, logging.WARNING, "not_executed", why=str(error))
