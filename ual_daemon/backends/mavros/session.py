"""The exchange with one autopilot through MAVROS. Belongs to the link's thread, but for what says otherwise."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import replace

from ual.gripper import GripperState
from ual.types import Capability
from ual_daemon import logs
from ual_daemon.backends.engine.agreement import Agreement
from ual_daemon.backends.engine.command_runner import CommandRunner, RunnerSettings
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.engine.readings import ahead_s
from ual_daemon.backends.engine.severe_texts import SevereTexts
from ual_daemon.backends.firmwares import px4_events
from ual_daemon.backends.firmwares.autopilot import (
    NO_PARAMETERS,
    Autopilot,
    SimulationVerdict,
    assumed_text,
    assumption_text,
    version_text,
)
from ual_daemon.backends.firmwares.cause_watch import CauseWatch
from ual_daemon.backends.firmwares.feed_forward import FeedForward
from ual_daemon.backends.firmwares.health_report import HealthReport
from ual_daemon.backends.firmwares.numbers import IGNORES_POSITION, VtolState
from ual_daemon.backends.firmwares.sender_watch import SenderWatch
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavros import messages, topics
from ual_daemon.backends.mavros.commands import CALL_S, TEXT_S, Answer, MavrosCall, read_answer
from ual_daemon.backends.mavros.parameters import ParameterReader
from ual_daemon.backends.mavros.settings import MavrosSettings
from ual_daemon.backends.mavros.streams import GIMBAL, StreamRequests, streams_of
from ual_daemon.backends.mavros.telemetry import MavrosTelemetry, target
from ual_daemon.backends.mavros.vehicle import VehicleDescription
from ual_daemon.backends.rosbridge import Message, RosGeneration
from ual_daemon.backends.rosbridge.calls import ServiceError
from ual_daemon.backends.rosbridge.fields import number, numbers, stamp_s
from ual_daemon.backends.values import Freshness, PositionSetpoint, Setpoint, Snapshot, VehicleInfo

_log = logging.getLogger(__name__)

FRESHNESS = Freshness(link_s=1.0, pose_s=1.2, mode_s=2.5, landed_s=1.5, estimator_s=3.0)
"""A lost autopilot shows by the age of its topics: MAVROS itself says so only after 10 s (``conn/timeout``)."""
FAST_HEARTBEAT_S, HEARTBEAT_S, SLOW_HEARTBEAT_S = 0.1, 0.2, 1.0
"""Seconds between two requests to PX4 for a heartbeat, which it sends once a second otherwise: while a command is under
way; while it is armed; else.
"""
HOME_S, ORIGIN_S = 0.5, 2.0
"""Seconds between two requests for home and for the origin while they are not known."""
_DISGUISED = "it calls itself a multirotor, but is a VTOL"
_REQUEST_MESSAGE_COMMAND = 512
_HEARTBEAT_ID, _ORIGIN_ID, _VERSION_ID, _HOME_ID = 0, 49, 148, 242
_EVENT_BYTES = 40

CallService = Callable[[str, Message, Callable[[Answer], None], float], "Future[Message]"]
"""Calls a service: its name, its arguments, the handler of the answer, and the time limit in seconds. Cancelling the
future withdraws the call, if it has not left yet.
"""


class MavrosSession:
    """The session with the autopilot of a description. `sent` are the setpoints that were sent to it."""

    def __init__(
        self,
        description: VehicleDescription,
        autopilot: Autopilot,
        settings: MavrosSettings,
        sent: SetpointMonitor,
        call: CallService,
        watch: LinkWatch,
        utc_s: Callable[[], float],
        holds_up_calls: Callable[[], bool] = lambda: False,
    ) -> None:
        """`holds_up_calls` returns whether a call that is made now may be executed late."""
        self.description = description
        self.autopilot = autopilot
        self.telemetry = telemetry = MavrosTelemetry(autopilot, watch, utc_s)
        self._watch = watch
        watch.on_lost = self._on_lost
        self.freshness = FRESHNESS
        self._call = call
        learns = settings.learns_feed_forward and autopilot.takes_feed_forward
        self._feed_forward = FeedForward(settings.drag_1_s, telemetry.parameters) if learns else None
        self._holds_up_calls = holds_up_calls
        self.runner: CommandRunner[MavrosCall] = CommandRunner(
            autopilot.name,
            self._transmit,
            telemetry.snapshot,
            watch,
            sent.duration_s,
            RunnerSettings(TEXT_S, bridge="MAVROS"),
            self._why_late,
        )
        self._causes = CauseWatch(
            autopilot,
            sent,
            names_intended_mode=False,
            setpoints_lost_s=lambda: autopilot.setpoints_lost_s(self.telemetry.parameters),
        )
        self._senders = SenderWatch(sent, stays_without_setpoints=autopilot.stays_without_setpoints)
        self._health, self._severe_texts = HealthReport(), SevereTexts()
        self._is_vtol = Agreement(assumed=False)
        """Whether its VTOL state shows that it is none of the multirotors that it calls itself."""
        self.doubt = ""
        """Doubt that is reported in flight, and does not count before the landing. Set by the discovery."""
        self._parameters = ParameterReader(
            autopilot,
            telemetry.parameters,
            telemetry.plausibility,
            self._on_parameters,
            lambda: telemetry.gimbal.wanted,
        )
        self._ros = RosGeneration.ROS1
        self._streams = StreamRequests(streams_of(autopilot, settings.pose_rate_hz), telemetry.counts)
        self.reads_parameters = True
        """Whether MAVROS has its whole copy of the parameters. It has not while it fetches them."""
        self._command_calls: list[Future[Message]] = []
        """The calls of commands since none was in progress."""
        self._calling = ""
        self._requested_s = dict.fromkeys((_HEARTBEAT_ID, _ORIGIN_ID, _VERSION_ID, _HOME_ID), -math.inf)
        self._boots_count = telemetry.boots_count
        self._reported_missing: tuple[str, ...] = ()
        self._began_s = math.inf
        self.gripper_state = GripperState.UNKNOWN
        """State of the gripper by the autopilot's texts. For any thread."""
        self._now_s = -math.inf
        """The time of the newest message or tick."""

    @property
    def label(self) -> str:
        """Human-readable name of the autopilot."""
        return f"{self.autopilot.name} (system {self.description.system_id})"

    @property
    def takes_setpoints(self) -> bool:
        """Whether it is in the mode in which it flies by setpoints."""
        return self.telemetry.mode_name == self.autopilot.setpoint_mode

    def on_message(self, topic: str, message: Message, now_s: float) -> None:
        """Takes a message of MAVROS."""
        self._now_s = now_s
        if not self.telemetry.update(topic, message, now_s):
            return
        if topic == topics.VELOCITY:
            self._learn(message)
        elif topic == topics.STATE:
            self._causes.on_system_status(int(message["system_status"]), now_s)
            self.runner.on_state(now_s)
            self._withdraw_calls()
        elif topic == topics.EXTENDED_STATE:
            is_vtol = not self.autopilot.is_multirotor(self.telemetry.vtol_state, NO_PARAMETERS)
            self._is_vtol.note(is_vtol, now_s, is_flying=self.telemetry.flight.is_flying(now_s))
        elif topic == topics.SYS_STATUS:
            self._causes.on_sensors(int(message["sensors_enabled"]), int(message["sensors_health"]), now_s)
        elif topic == topics.RC_IN:
            self._causes.on_rc_channels([int(each) for each in numbers(message["channels"])], now_s)
        elif topic == topics.RC_OUT:
            if self.autopilot.tells_motors:
                pulses_us = [int(each) for each in numbers(message["channels"])]
                armed, landed = self.telemetry.armed.sample, self.telemetry.landed.sample
                self._causes.on_outputs(pulses_us, self.telemetry.parameters, armed, landed, now_s)
        elif topic == topics.STATUS_TEXT:
            self._on_text(str(message["text"]), int(number(message["severity"])), now_s)
        elif topic == topics.STATUS_EVENT:
            self._on_event(message, now_s)
        elif topic == topics.TARGET:
            position, velocity, mask = target(message)
            self._senders.on_target(position, velocity, now_s, has_position=not mask & IGNORES_POSITION)

    def _on_lost(self) -> None:
        self.telemetry.readings.discard_state()
        self.forget_gripper()

    def encode(self, setpoint: Setpoint, now_s: float) -> tuple[Setpoint, Message]:
        """Returns the setpoint with what was learned of the vehicle, and its message. From any thread."""
        autopilot = self.autopilot
        if self._feed_forward is not None:
            setpoint = self._feed_forward.apply(setpoint, now_s)
        if isinstance(setpoint, PositionSetpoint):
            setpoint = autopilot.position_setpoint(setpoint, self.telemetry.parameters)
        return setpoint, messages.position_target(setpoint, with_acceleration=autopilot.takes_acceleration)

    def restart(self, now_s: float) -> None:
        """Discards what may have changed in a time in which nothing came, and requests everything again."""
        self.telemetry.readings.discard_state()
        self.forget_gripper()
        self.runner.drop(now_s)
        self._streams.restart()
        self._calling = ""

    def tick(self, now_s: float, ros: RosGeneration) -> None:
        """Does what is due; to be called often."""
        self._now_s = now_s
        self._began_s = min(self._began_s, now_s)
        self._ros = ros
        self.telemetry.flight.update(self.telemetry.armed.sample, self.telemetry.landed.sample, now_s)
        self._is_vtol.tick(now_s, is_flying=self.telemetry.flight.is_flying(now_s))
        self.runner.tick(now_s)
        self._withdraw_calls()
        self._update_freshness()
        self._check_boot(now_s)
        # One call at a time: in ROS 2 MAVROS serves them one after another, and each waits for the autopilot's answer.
        if self._calling or not self.telemetry.is_connected:
            return
        if not self._request(_HEARTBEAT_ID, now_s, self._heartbeat_s()) and not self.runner.is_any_pending:
            self._ask(now_s, ros)

    def snapshot(self, now_s: float) -> Snapshot:
        """Returns the newest data as of now."""
        telemetry, causes = self.telemetry, self._causes
        armed, mode, landed = telemetry.armed.sample, telemetry.mode.sample, telemetry.landed.sample
        other_sender = self._senders.another(now_s, armed, mode, landed)
        control = causes.control_state(armed, landed, mode, other_sender, now_s)
        doubt = self.doubt or (_DISGUISED if self._is_vtol.pending else "")
        health = self._health.report(now_s, telemetry.is_ready_to_arm, causes.failing_sensors, lambda: None, doubt)
        return telemetry.snapshot(now_s, control, health, self._severe_texts.fresh(now_s), causes.aids)

    def judge_simulation(self) -> SimulationVerdict:
        """Judges whether it is a simulator, and surely not a flight controller. From any thread."""
        found = self.description
        board = found if found.has_version else None
        return self.autopilot.judge_simulation(board, self.telemetry.parameters, found.system_id)

    def is_ready_to_arm(self) -> bool:
        """Returns whether its data say that arming would succeed. From any thread."""
        telemetry = self.telemetry
        return bool(telemetry.is_ready_to_arm) or not self.autopilot.can_be_armed_in(telemetry.mode_name)

    def info(self) -> VehicleInfo:
        """Returns what is known of the vehicle so far."""
        autopilot, parameters, found = self.autopilot, self.telemetry.parameters, self.description
        is_multirotor = autopilot.is_multirotor(VtolState.UNDEFINED, parameters) and not self._is_vtol.value
        limits = autopilot.limits(parameters)
        return VehicleInfo(
            autopilot=autopilot.name,
            autopilot_version=version_text(found.software_version) if found.has_version else "",
            is_simulation=self.judge_simulation().is_simulated is True,
            capabilities=autopilot.capabilities - {Capability.EXTERNAL_POSE} if is_multirotor else frozenset(),
            limits=limits,
            note=assumption_text(self._parameters.missing if self._reported_missing else (), limits),
            flies_takeoff_on_setpoints=autopilot.flies_takeoff_on_setpoints,
            identity=f"{autopilot.name} {found.system_id} {found.uid:x}" if found.has_version else "",
            limitation="" if is_multirotor else f"{_DISGUISED}: UAL only watches it",
            cruise_speed_m_s=autopilot.cruise_speed_m_s(parameters),
            acceleration_share=autopilot.acceleration_share(parameters),
            velocity_responses=autopilot.velocity_responses(parameters),
            drops_positions_beyond_fence=autopilot.drops_positions_beyond_fence,
            keeps_target_of_a_kind=autopilot.keeps_target_of_a_kind,
        )

    # --- What comes ---------------------------------------------------------------------------------------------------

    def _learn(self, message: Message) -> None:
        telemetry = self.telemetry
        pose, velocity = telemetry.pose.value, telemetry.velocity.value
        if self._feed_forward is None or pose is None or velocity is None:
            return
        if stamp_s(message) == telemetry.measured_s:  # the two topics are of one message of the autopilot
            self._feed_forward.learn(telemetry.measured_s, pose, velocity.linear)

    def forget_gripper(self) -> None:
        """Forgets the reports of the gripper: an order leaves, or a boot or a silence came."""
        self.gripper_state = GripperState.UNKNOWN

    def _on_text(self, text: str, severity: int, now_s: float) -> None:
        if self.autopilot.gripper is not None:
            self.gripper_state = self.autopilot.gripper.texts.get(text, self.gripper_state)
        self.runner.on_text(text)
        self._causes.on_text(text, now_s)
        self._health.on_text(text, now_s)
        self._severe_texts.on_text(text, severity, now_s, self.autopilot.ends_of_text(text))

    def _on_event(self, message: Message, now_s: float) -> None:
        """Takes an event of PX4: in ROS 2 MAVROS publishes them, without the component in their numbers."""
        arguments = bytes(int(each) for each in numbers(message["arguments"])).ljust(_EVENT_BYTES, b"\0")
        identity = int(message["px4_id"]) | px4_events.AUTOPILOT_ID
        severity = int(number(message["severity"]))
        event = px4_events.read(identity, 0.0, severity, arguments, self.telemetry.mode_name)
        self._requested_s[_HEARTBEAT_ID] = -math.inf
        self._causes.on_sign(event.cause, now_s, lasting=event.lasting)
        self._health.on_event(event)
        self._severe_texts.on_text(event.severe_text, event.severity, now_s)
        if event.armed is not None:
            self.telemetry.set_armed(event.armed, ahead_s(now_s), now_s)
            self.runner.on_state(now_s)
        if event.text:
            self.runner.on_text(event.text)

    def on_own_order(self) -> None:
        """Takes note of an order of ours about its mission. From any thread."""
        self._causes.on_own_order(self._now_s)

    # --- What is requested --------------------------------------------------------------------------------------------

    def _why_late(self) -> str:
        """Returns why a command may wait: with ROS 2 MAVROS executes it after ``set_message_interval``."""
        is_late = self._calling == topics.SET_INTERVAL or self._holds_up_calls()
        return "the bridge or MAVROS would execute it late" if is_late else ""

    def _transmit(self, call: MavrosCall, _: int, key: Hashable) -> Callable[[], object]:
        """Calls the service of a command. Returns what takes the call back while it has not left."""
        if call.mode:
            self._causes.on_own_command(call.mode, self._now_s)

        sent_s = self._now_s

        def take(answer: Answer) -> None:
            reply = read_answer(call, answer, self._now_s - sent_s)
            self._requested_s[_HEARTBEAT_ID] = -math.inf  # its effect may show at once
            self.runner.on_answer(key, reply.verdict, self._now_s, reply.text, reply.by)

        answer = self._call(call.service, call.arguments, take, CALL_S)
        self._command_calls.append(answer)
        return answer.cancel

    def _withdraw_calls(self) -> None:
        """Withdraws the calls of commands that have ended, as far as they have not left: one whose mode was entered
        already may still wait in the socket.
        """
        if self._command_calls and not self.runner.is_any_pending:
            for answer in self._command_calls:
                answer.cancel()
            self._command_calls.clear()

    def _heartbeat_s(self) -> float:
        if not self.autopilot.takes_feed_forward:
            return math.inf  # ArduPilot streams them
        if self.runner.is_any_pending:
            return FAST_HEARTBEAT_S
        return HEARTBEAT_S if self.telemetry.is_armed else SLOW_HEARTBEAT_S

    def _ask(self, now_s: float, ros: RosGeneration) -> bool:
        telemetry = self.telemetry
        return (
            (self._is_home_wanted(now_s) and self._request(_HOME_ID, now_s, HOME_S))
            or (telemetry.origin.projection is None and self._request(_ORIGIN_ID, now_s, ORIGIN_S))
            or (not self.description.has_version and self._request(_VERSION_ID, now_s, ORIGIN_S))
            or (telemetry.knows_arming and self._streams.tick(now_s, self._call_alone, is_flying=telemetry.is_flying))
            or (self.reads_parameters and self._read_parameters(now_s, ros))
        )

    def _is_home_wanted(self, now_s: float) -> bool:
        watch = self.telemetry.home_watch
        is_wanted, watch.is_wanted = watch.is_wanted, False
        return is_wanted or self.telemetry.home_s < now_s

    def _read_parameters(self, now_s: float, ros: RosGeneration) -> bool:
        missing = self._parameters.missing
        if missing and now_s - self._began_s > 60.0 and missing != self._reported_missing:
            self._reported_missing = missing
            logs.event(
                _log,
                logging.WARNING,
                "parameters_missing",
                names=", ".join(missing),
                assumed=assumed_text(self.info().limits),
            )
        return self._parameters.tick(now_s, ros, self._call_alone)

    def _on_parameters(self) -> None:
        self.telemetry.fence.update()
        if self._ros is RosGeneration.ROS2 and self.telemetry.gimbal.identity is not None:
            self._streams.add(GIMBAL)

    def _request(self, message_id: int, now_s: float, period_s: float) -> bool:
        """Asks the autopilot for a message, if that is due."""
        if now_s - self._requested_s[message_id] < period_s or period_s == math.inf:
            return False
        self._requested_s[message_id] = now_s
        arguments = {"command": _REQUEST_MESSAGE_COMMAND, "param1": float(message_id)}
        self._call_alone(topics.COMMAND, arguments, lambda _: None, CALL_S)
        return True

    def _call_alone(self, service: str, arguments: Message, take: Callable[[Message], None], limit_s: float) -> None:
        def ended(answer: Answer) -> None:
            self._calling = ""
            if answer and not isinstance(answer, ServiceError):
                take(answer)

        self._calling = service
        self._call(service, arguments, ended, limit_s)

    def _update_freshness(self) -> None:
        link_s = min(FRESHNESS.link_s, self.autopilot.setpoints_lost_s(self.telemetry.parameters))
        if link_s != self.freshness.link_s:
            self.freshness = replace(FRESHNESS, link_s=link_s)
            self._watch.lost_s = link_s

    def _check_boot(self, now_s: float) -> None:
        boots_count = self.telemetry.boots_count
        if boots_count != self._boots_count:
            self._boots_count = boots_count
            self.forget_gripper()
            self.runner.drop(now_s)
            self._streams.restart()
