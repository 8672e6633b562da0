"""The session with one autopilot: takes its messages, sends it what is due. Belongs to the thread that receives."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import NamedTuple

from ual_daemon import logs
from ual_daemon.backends.engine.agreement import AirborneWatch
from ual_daemon.backends.engine.command import FLYING, Verdict
from ual_daemon.backends.engine.command_runner import CommandContext, CommandRunner
from ual_daemon.backends.engine.limits import RESTART_SILENCE_S
from ual_daemon.backends.engine.link_watch import LinkWatchState
from ual_daemon.backends.engine.readings import ahead_s
from ual_daemon.backends.engine.severe_texts import SevereTexts
from ual_daemon.backends.firmwares.autopilot import SimulationVerdict, assumed_text, assumption_text
from ual_daemon.backends.firmwares.cause_watch import CauseWatch
from ual_daemon.backends.firmwares.feed_forward import FeedForward
from ual_daemon.backends.firmwares.health_report import HealthReport
from ual_daemon.backends.firmwares.numbers import IGNORES_POSITION
from ual_daemon.backends.firmwares.sender_watch import SenderWatch
from ual_daemon.backends.firmwares.setpoint_monitor import SetpointMonitor
from ual_daemon.backends.mavlink.dialects.axes import ned_to_enu
from ual_daemon.backends.mavlink.dialects.command_long import (
    LEAST_STREAM_RATE_HZ,
    CommandLong,
    LongCommand,
    default_interval,
    request_message,
    set_message_interval,
    slow_streams,
    slower,
    target_stream,
)
from ual_daemon.backends.mavlink.dialects.data_streams import request_group
from ual_daemon.backends.mavlink.dialects.detection import HeartbeatKind, dialect_of, kind_of
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.dialects.setpoint_encoder import SetpointEncoder
from ual_daemon.backends.mavlink.links import Address
from ual_daemon.backends.mavlink.protocols.mission_progress import MissionNews
from ual_daemon.backends.mavlink.protocols.protocol import Handler
from ual_daemon.backends.mavlink.protocols.protocols import Protocols
from ual_daemon.backends.mavlink.session.conversions import channels, pulses
from ual_daemon.backends.mavlink.session.fence_download import FenceDownload
from ual_daemon.backends.mavlink.session.heartbeat_watchdog import OWN_HEARTBEAT_S, HeartbeatWatchdog, own_heartbeat
from ual_daemon.backends.mavlink.session.identity import VehicleIdentity
from ual_daemon.backends.mavlink.session.late_messages import LateMessages
from ual_daemon.backends.mavlink.session.payload_messages import PayloadMessages
from ual_daemon.backends.mavlink.session.rate_fit import RateFit
from ual_daemon.backends.mavlink.session.setup_requests import SetupRequests
from ual_daemon.backends.mavlink.session.shape import Shape
from ual_daemon.backends.mavlink.session.supervision import LinkCounts
from ual_daemon.backends.mavlink.session.telemetry import AutopilotTelemetry
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink, member_name
from ual_daemon.backends.mavlink.wire.sender import Sender
from ual_daemon.backends.mavlink.wire.signing import KEY_MISSING
from ual_daemon.backends.values import Snapshot, VehicleInfo

_log = logging.getLogger(__name__)

OLD_EVENT_S = 1.0
"""An event of PX4 that is this much older than the newest time since boot is a repetition."""
HOME_REQUEST_S = 0.2
"""Seconds between two requests for home while the one of the present arming is not known, or while it moves."""
STREAMLESS_S = 10.0
"""Seconds between two requests for everything from an autopilot that is received, but does not stream any more."""

QUATERNION_S = 3.0
"""Seconds without a quaternion after which the attitude is taken from the angles that many autopilots send."""
UNUSED_RATE_HZ = 1.0
"""Rate in Hz at which a message that UAL does not use may come on a link that is overrun. Others on the link may use
it.
"""
REQUEST_PACE_S = 0.1
"""The interval of requests that leave whatever the answers are."""
ALL_SYSTEMS_ID = 0
"""The system id that addresses every vehicle: nothing is sent to it."""
VERSION_S = 0.5
"""Seconds between two requests for the version while it is doubted."""
ORIGIN_S = 0.5
"""Seconds between two requests for the origin of the local frame while it is doubted."""


class _Info(NamedTuple):
    """A `VehicleInfo`, and what it was made from."""

    version: Message | None
    basis: tuple[object, ...]
    parameters: dict[str, float]
    value: VehicleInfo


class Successor(NamedTuple):
    """The vehicle of the session that has to follow: what its heartbeats say, what it is, and the verdict on that."""

    heartbeats_kind: HeartbeatKind
    kind: HeartbeatKind
    shape: Shape | None = None


def _ignore(_: float) -> None:
    """Nobody wants to know."""


class MavlinkSession:
    """The session with the autopilot `source`. `setpoints` are those that were sent to it."""

    def __init__(
        self,
        source: MessageSource,
        kind: HeartbeatKind,
        dialect: Dialect,
        settings: MavlinkSettings,
        sender: Sender,
        supervision: LinkCounts,
        setpoints: SetpointMonitor,
        payload_messages: PayloadMessages | None = None,
        protocols: Protocols | None = None,
        shape: Shape | None = None,
    ) -> None:
        """`shape` is that of the session before, where that has made the verdict that this one follows."""
        self.source = source
        self.system_id = source.system_id
        self.dialect = dialect
        flight = AirborneWatch()
        self.identity = VehicleIdentity(self.system_id, kind, flight)
        self.successor: Successor | None = None
        """The vehicle that this one has turned out to be, or that has taken its place; None if neither."""
        self._shape = shape or Shape(dialect_of(kind), flight, self._request_parameter)
        self._shape.read, self._shape.flight = self._request_parameter, flight
        self._is_vtol = self._shape.is_vtol
        self.telemetry = AutopilotTelemetry(dialect, supervision.watch.begin_boot(), flight)
        self.freshness = dialect.freshness
        """As the dialect's, with a shorter `link_s` where the autopilot leaves the mode of our setpoints sooner."""
        learns = settings.learns_feed_forward and dialect.takes_feed_forward
        self._feed_forward = FeedForward(settings.drag_1_s, self.telemetry.parameters) if learns else None
        self.setpoint_encoder = SetpointEncoder(dialect, source, self.telemetry.parameters, self._feed_forward)
        self._own_ids = (self.system_id, settings.component_id)
        self._pose_rate_hz = settings.pose_rate_hz
        self._has_key, self._signs = settings.signing_key_file is not None, False
        self._sender = sender
        self._payload_messages = payload_messages or PayloadMessages()
        self._protocols = protocols or Protocols(sender.send, supervision.watch.is_up)
        self._supervision = supervision
        self._commands = CommandRunner(
            dialect.name, self._transmit, self.telemetry.snapshot, supervision.watch, setpoints.duration_s
        )
        self._reported_missing: tuple[str, ...] = ()
        self._info: _Info | None = None
        self._fit = RateFit()
        self._unused_ids: set[int] = set()
        """Of messages that are not used, and came while the link lost much."""
        self._paced: deque[Message] = deque()
        """Messages that leave one at a time, as a slow link would lose them otherwise."""
        self._next_paced_s = -math.inf
        self._began_s: float | None = None
        self._setup = self._new_setup()
        self._fence_download = self._new_fence_download() if dialect.has_zones else None
        self._next_setup_s = -math.inf
        self._next_origin_s = self._next_version_s = -math.inf
        self._heartbeats = HeartbeatWatchdog()
        self._late_messages = LateMessages(
            {
                dialect.estimator_message: (self.telemetry.estimator, dialect.freshness.estimator_s),
                mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: (self.telemetry.landed, dialect.freshness.landed_s),
            }
        )
        causes = self._causes = CauseWatch(
            dialect,
            setpoints,
            names_intended_mode=dialect.names_intended_mode,
            setpoints_lost_s=lambda: dialect.setpoints_lost_s(self.telemetry.parameters),
        )
        self.on_mode: Callable[[float], None] = _ignore
        """Called with each new mode, before the next message: a pilot may take over within a hundredth of a second."""
        self._mode_name = ""
        self._health, self._severe_texts = HealthReport(), SevereTexts()
        self._sender_watch = SenderWatch(setpoints, stays_without_setpoints=dialect.stays_without_setpoints)
        self._next_own_heartbeat_s = -math.inf
        self._next_home_request_s = -math.inf
        self._unlearned_s: tuple[float, float] | None = None
        """Time of the newest position that the feed-forward has not taken yet, by our clock and the autopilot's."""
        self._handlers: dict[int, Callable[[Message, float, float], None]] = {
            **{each: self._for_us(handler) for each, handler in self._protocols.handlers.items()},
            mavlink.MAVLINK_MSG_ID_COMMAND_ACK: self._on_ack,
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            mavlink.MAVLINK_MSG_ID_CURRENT_MODE: self._on_current_mode,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._on_vtol_state,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: lambda message, now_s, _: causes.on_sensors(
                message.onboard_control_sensors_enabled, message.onboard_control_sensors_health, now_s
            ),
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: lambda message, now_s, _: causes.on_rc_channels(
                channels(message), now_s
            ),
            **({mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: self._on_outputs} if dialect.tells_motors else {}),
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._on_position,
            mavlink.MAVLINK_MSG_ID_STATUSTEXT: self._on_text,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            mavlink.MAVLINK_MSG_ID_PARAM_VALUE: self._on_parameter,
            mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: self._on_target,
            mavlink.MAVLINK_MSG_ID_EVENT: self._on_event,
        }
        """Handlers of messages, which are called after `telemetry` has taken their values."""
        self._own_decoded_ids = self.decoded_ids = frozenset(self.telemetry.decoded_ids | self._handlers.keys())
        """Ids of the messages that are worth decoding; of others only the arrival counts."""
        self._payload_messages.listen_by(self._decode_also)

    def _decode_also(self, wanted_ids: frozenset[int]) -> None:
        self.decoded_ids = self._own_decoded_ids | wanted_ids

    @property
    def mission_news(self) -> MissionNews | None:
        """The newest of what was received of its mission. From any thread."""
        return self._protocols.progress.heard

    @property
    def is_urgent(self) -> bool:
        """Whether a command is in progress, or a heartbeat is wanted at once, so that `tick` should be called often."""
        return self._heartbeats.is_wanted or self._commands.is_any_pending

    def on_message(
        self,
        message_id: int,
        sequence: int,
        message: Message,
        address: Address | None,
        now_s: float,
        utc_now_s: float,
        is_signed: bool,
    ) -> None:
        """Takes a message of this autopilot."""
        identity, telemetry, is_foreign = self.identity, self.telemetry, False
        self._supervision.on_frame(sequence, now_s)
        self._signs = is_signed
        if address == identity.address:  # nearly always: as `on_frame`, without a call
            identity.sequence = sequence
        else:
            identity.on_frame(sequence, address, now_s)
        boot_ms = message.time_boot_ms if message_id in _LIVE_IDS else 0  # 0: it is not known
        if boot_ms > 0:
            identity.on_boot_time(boot_ms / 1000.0, now_s)
        elif message_id == _HEARTBEAT:
            is_foreign = self._identify(message, now_s)
        if identity.conflict != telemetry.conflict:
            self._follow_conflict(now_s)
        if identity.conflict or self.successor is not None or is_foreign:
            telemetry.on_frame(sequence, now_s)
        else:
            self._on_content(message_id, sequence, message, boot_ms, now_s, utc_now_s)

    def on_unused(self, message_id: int, sequence: int, address: Address | None, now_s: float, is_signed: bool) -> None:
        """Takes note of a frame whose content is not used: its number and where it came from count."""
        identity, telemetry = self.identity, self.telemetry
        self._supervision.on_frame(sequence, now_s)
        self._signs = is_signed
        if address == identity.address:  # as in `on_message`
            identity.sequence = sequence
        else:
            identity.on_frame(sequence, address, now_s)
        if identity.conflict != telemetry.conflict:
            self._follow_conflict(now_s)
        telemetry.on_frame(sequence, now_s)
        if self._fit.is_high and not identity.conflict and self.successor is None:
            self._unused_ids.add(message_id)

    def _identify(self, heartbeat: Message, now_s: float) -> bool:
        """Takes what a heartbeat says that it is. Returns whether that is another kind of vehicle."""
        kind = kind_of(heartbeat)
        if self.identity.on_heartbeat(kind, now_s):
            self.successor = Successor(kind, kind)
        return kind != self.identity.kind

    def _follow_conflict(self, now_s: float) -> None:
        """Discards what is known where a conflict begins."""
        if self.identity.conflict and not self.telemetry.conflict:
            self.discard_state()
            self._commands.drop(now_s)
        self.telemetry.conflict = self.identity.conflict

    def discard_state(self) -> None:
        """Discards all that may have changed, as `AutopilotTelemetry.discard_state` does, and requests a heartbeat at
        once.
        """
        self.telemetry.discard_state()
        self._heartbeats.want()

    def restart_setup(self) -> None:
        """Requests everything again: the autopilot may have booted, or have been connected again."""
        _log.debug("requesting everything anew from %s", self.dialect.name)
        self._setup = self._new_setup()
        if self._fence_download is not None:
            self._fence_download.want()

    def submit(
        self,
        command: LongCommand,
        now_s: float,
        result: Future[None] | None = None,
        asked: CommandContext | None = None,
    ) -> Future[None]:
        """Sends a command; see `CommandRunner.submit`."""
        if command.group == FLYING:
            self._causes.on_own_command(command.mode, now_s)
        result = self._commands.submit(command, now_s, result, asked)
        result.add_done_callback(lambda _: self._heartbeats.want())
        return result

    def on_own_order(self, now_s: float) -> None:
        """Takes note of an order of ours about its mission, which was sent besides the commands."""
        self._causes.on_own_order(now_s)

    def on_mission_report(self, now_s: float, *, is_complete: bool) -> None:
        """Takes a report of the autopilot about its mission."""
        self._causes.on_mission_report(now_s, is_complete=is_complete)

    def tick(self, now_s: float) -> None:
        """Does what is due, and what could wait until the last update was published; to be called often."""
        self.learn()
        if now_s >= self._next_own_heartbeat_s:
            self._next_own_heartbeat_s = now_s + OWN_HEARTBEAT_S
            self._sender.send(own_heartbeat())
        requested_ns = self._supervision.timesync.request_ns(now_s)
        if requested_ns is not None:
            self._sender.send(mavlink.MAVLink_timesync_message(0, requested_ns))
        if self._has_stopped_streaming(now_s):
            _log.info("%s is heard, but sends no attitude any more: requesting everything anew", self.dialect.name)
            self._next_setup_s = now_s + STREAMLESS_S
            self._setup = self._new_setup()
        self._update_freshness()
        self._judge(now_s)
        self._setup.tick(now_s)
        self._stream_attitude(now_s)
        self._fit_rates(now_s)
        self._send_paced(now_s)
        if self._fence_download is not None:
            self._fence_download.tick(now_s, is_armed=self.telemetry.is_armed)
        self._commands.tick(now_s)
        is_late = self._heartbeats.is_late(now_s) and self._supervision.watch.state is not LinkWatchState.LOST
        if self._heartbeats.take_request(now_s, is_needed=is_late or self._commands.wants_state(now_s)):
            self._send_command(request_message(mavlink.MAVLINK_MSG_ID_HEARTBEAT))
        if self._causes.take_report_request():
            self._send_command(request_message(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT))
        if self.telemetry.mode_names.take_request(now_s):
            self._send_command(request_message(mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES))
        for message_id in self._late_messages.due(now_s, self.telemetry.heard_s):
            self._send_command(request_message(message_id))
        if (
            self.telemetry.is_home_missing or self.telemetry.home_watch.is_wanted
        ) and now_s >= self._next_home_request_s:
            self.request_home(now_s)

    def speed_up(self, factor: float) -> None:
        """Asks for all streams so many times as often as usual, paced, and whatever the answers are."""
        self._paced.extend(slower(each, factor).request.encode(self.source, 0) for each in self._streams())

    def request_home(self, now_s: float) -> None:
        """Requests home: it is not known, it has moved, or a command is about to rely on it."""
        self._next_home_request_s = now_s + HOME_REQUEST_S
        self.telemetry.home_watch.is_wanted = False
        self._send_command(request_message(mavlink.MAVLINK_MSG_ID_HOME_POSITION))

    def _update_freshness(self) -> None:
        usual = self.dialect.freshness
        link_s = min(usual.link_s, self.dialect.setpoints_lost_s(self.telemetry.parameters))
        if link_s != self.freshness.link_s:
            self.freshness = replace(usual, link_s=link_s)
            self._supervision.watch.lost_s = link_s
            _log.info(
                "%s waits %.2g s for setpoints: after so long a gap nothing is sent unasked", self.dialect.name, link_s
            )

    def _judge(self, now_s: float) -> None:
        """Makes the verdicts that are due."""
        telemetry, shape = self.telemetry, self._shape
        telemetry.flight.update(telemetry.armed.sample, telemetry.landed.sample, now_s)
        self.identity.tick(now_s)
        if self.identity.conflict != telemetry.conflict:
            self._follow_conflict(now_s)
        shape.tick(now_s)
        if self.successor is None and shape.is_vtol != self._is_vtol:
            kind = self.identity.kind
            text = "is a VTOL: it is only watched" if shape.is_vtol else "does not say any more that it is a VTOL"
            _log.warning("%s calls itself a multirotor, and %s", self.dialect.name, text)
            self.successor = Successor(kind, kind._replace(vehicle=_VTOL) if shape.is_vtol else kind, shape)
        if telemetry.is_version_doubtful and now_s >= self._next_version_s:
            self._next_version_s = now_s + VERSION_S
            self._send_command(request_message(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION))

    def snapshot(self, now_s: float, updated_s: float = math.inf, scheduling_gap: str = "") -> Snapshot:
        """Returns the newest data as of now. `updated_s` and `scheduling_gap` are those of the snapshot."""
        telemetry, causes = self.telemetry, self._causes
        armed, mode, landed = telemetry.armed.sample, telemetry.mode.sample, telemetry.landed.sample
        other_sender = self._sender_watch.another(now_s, armed, mode, landed)
        control = causes.control_state(armed, landed, mode, other_sender, now_s)
        return telemetry.snapshot(
            now_s,
            control,
            self._health.report(
                now_s,
                telemetry.readiness,
                causes.failing_sensors,
                lambda: self._supervision.loss(now_s),
                self.identity.doubt or self._shape.doubt,
            ),
            updated_s=updated_s,
            scheduling_gap=scheduling_gap,
            refused=self.refused if self._setup.refused else "",
            corrections=self._protocols.corrections.status(now_s),
            severe_texts=self._severe_texts.fresh(now_s),
            aids=causes.aids,
        )

    @property
    def label(self) -> str:
        """Human-readable name of the autopilot."""
        return f"{self.dialect.name} (system {self.system_id})"

    def judge_simulation(self) -> SimulationVerdict:
        """Judges whether it is a simulator, and surely not a flight controller. From any thread."""
        telemetry = self.telemetry
        if telemetry.is_hardware_in_the_loop:
            return SimulationVerdict(False, "it is a flight controller in a simulation (hardware in the loop)")
        if telemetry.is_version_contradicted:
            return SimulationVerdict(None, "its version and unique id are not sure: it has said two")
        return self.dialect.judge_simulation(telemetry.version, telemetry.parameters, self.system_id)

    def is_ready_to_arm(self) -> bool:
        """Returns whether its data say that arming would succeed. From any thread.

        In a mode in which it cannot be armed, PX4 is not ready because of the mode; that says nothing of the mode in
        which it will be armed.
        """
        mode = self.telemetry.mode_name
        return self.telemetry.is_ready_to_arm or not self.dialect.can_be_armed_in(mode)

    def info(self) -> VehicleInfo:
        """Returns what is known of the vehicle so far: the same object while nothing of it has changed."""
        telemetry, known = self.telemetry, self._info
        basis = (
            self._setup.has_awaited_parameters,
            telemetry.is_hardware_in_the_loop,
            telemetry.is_version_contradicted,
            telemetry.fence.is_applied,
            self.note,
        )
        is_same = known is not None and known.version is telemetry.version and known.basis == basis
        if known is None or not is_same or known.parameters != telemetry.parameters:
            new = self._new_info()
            value = new if known is None or new != known.value else known.value
            known = self._info = _Info(telemetry.version, basis, dict(telemetry.parameters), value)
        return known.value

    def _new_info(self) -> VehicleInfo:
        telemetry, dialect = self.telemetry, self.dialect
        version, limits = telemetry.version, dialect.limits(telemetry.parameters)
        return VehicleInfo(
            autopilot=dialect.name,
            autopilot_version="" if version is None else dialect.version(version),
            is_simulation=telemetry.is_hardware_in_the_loop or self.judge_simulation().is_simulated is True,
            capabilities=dialect.capabilities,
            limits=limits,
            note="; ".join(filter(None, (self.note, assumption_text(self._setup.missing, limits)))),
            flies_takeoff_on_setpoints=dialect.flies_takeoff_on_setpoints,
            identity=self._identity(),
            limitation=dialect.limitation,
            cruise_speed_m_s=dialect.cruise_speed_m_s(telemetry.parameters),
            acceleration_share=dialect.acceleration_share(telemetry.parameters),
            velocity_responses=dialect.velocity_responses(telemetry.parameters),
            drops_positions_beyond_fence=dialect.drops_positions_beyond_fence,
            keeps_target_of_a_kind=dialect.keeps_target_of_a_kind,
            applies_fence=telemetry.fence.is_applied if dialect.fence_switches else None,
        )

    def _identity(self) -> str:
        version = self.telemetry.version
        if version is None:
            return ""
        uid = bytes(version.uid2).rstrip(b"\0").hex() or f"{version.uid:x}"
        return f"{self.dialect.name} {self.system_id} {uid}"

    def _on_content(
        self, message_id: int, sequence: int, message: Message, boot_ms: int, now_s: float, utc_now_s: float
    ) -> None:
        telemetry = self.telemetry
        if boot_ms > 0 and self._supervision.on_boot_time(boot_ms / 1000.0, now_s):
            telemetry.discard_boot(self._supervision.watch.begin_boot())
            self._commands.drop(now_s)
            self._protocols.drop("the autopilot has booted")
            self._heartbeats.want()
            self.restart_setup()
        elif boot_ms > 0 and (self._supervision.watch.is_boot_doubtful or self._supervision.watch.is_boot_foreign):
            telemetry.on_frame(sequence, now_s)
            return
        telemetry.on_frame(sequence, now_s)
        telemetry.on_content(message_id, message, now_s, utc_now_s)
        if telemetry.is_mode_doubtful:
            telemetry.is_mode_doubtful = False
            self._heartbeats.want()
        if telemetry.origin.is_wanted:
            telemetry.origin.is_wanted = False
            self._request_origin(now_s)
        handler = self._handlers.get(message_id)
        if handler is not None:
            handler(message, now_s, utc_now_s)
        if self._payload_messages.ids:
            self._payload_messages.on_message(message, now_s)

    def _on_event(self, message: Message, now_s: float, _: float) -> None:
        event = self.dialect.event(message, self.telemetry.mode_name)
        # PX4 repeats its last events when any program requests them, and every listener receives the repetitions.
        if event is not None and event.boot_s >= self._supervision.watch.boot_s - OLD_EVENT_S:
            # PX4 reports arming, disarming and failsafes by an event at once, in a heartbeat up to 1 s later.
            self._heartbeats.want()
            self._causes.on_sign(event.cause, now_s, lasting=event.lasting)
            self._health.on_event(event)
            self._severe_texts.on_text(event.severe_text, event.severity, now_s)
            if event.armed is not None:
                self.telemetry.set_armed(event.armed, ahead_s(now_s))
                self._commands.on_state(now_s)
            if event.text:
                self._commands.on_text(event.text)

    def learn(self) -> None:
        """Learns from the newest position, where it has not: what could wait until that was published."""
        if self._unlearned_s is None:
            return
        (received_s, autopilot_s), self._unlearned_s = self._unlearned_s, None
        pose, velocity = self.telemetry.pose.sample, self.telemetry.velocity.sample
        if self._feed_forward is None or pose is None or velocity is None or pose.time_s != received_s:
            return
        self._feed_forward.learn(autopilot_s, pose.value, velocity.value.linear)

    def _has_stopped_streaming(self, now_s: float) -> bool:
        """Returns whether messages arrive, but not the requested attitude any more, as after a short reboot."""
        heard_s, attitude_s = self.telemetry.heard_s, self.telemetry.attitude_time_s
        if heard_s is None or attitude_s is None or now_s < self._next_setup_s:
            return False
        return now_s - heard_s < RESTART_SILENCE_S < heard_s - attitude_s

    def _on_ack(self, message: Message, now_s: float, _: float) -> None:
        if (message.target_system, message.target_component) in (self._own_ids, (0, 0)):
            verdict = _VERDICTS.get(message.result, Verdict.REFUSED)
            answer = message.command, message.result
            if answer in self.dialect.busy_answers:
                verdict = Verdict.IN_PROGRESS
            elif answer in self.dialect.replaced_answers:
                verdict = Verdict.REPLACED
            self._commands.on_answer(message.command, verdict, now_s, _result_name(message.result))
            self._protocols.gimbals.on_ack(self.source.component_id, message, now_s)

    def _on_heartbeat(self, message: Message, now_s: float, _: float) -> None:
        self._heartbeats.on_heartbeat(now_s)
        self._causes.on_system_status(message.system_status, now_s)
        self._commands.on_state(now_s)
        self._note_mode(now_s)

    def _on_current_mode(self, message: Message, now_s: float, _: float) -> None:
        self._causes.on_intention(message.custom_mode, message.intended_custom_mode, now_s)
        self._commands.on_state(now_s)
        self._note_mode(now_s)

    def _note_mode(self, now_s: float) -> None:
        mode_name = self.telemetry.mode_name
        if mode_name != self._mode_name:
            self._mode_name = mode_name
            self.on_mode(now_s)

    def _on_vtol_state(self, message: Message, now_s: float, _: float) -> None:
        self._shape.on_vtol_state(message.vtol_state, now_s)

    def _on_position(self, message: Message, now_s: float, _: float) -> None:
        if self._feed_forward is not None:
            self._unlearned_s = (now_s, message.time_boot_ms / 1000.0)

    def _on_target(self, message: Message, now_s: float, _: float) -> None:
        self._sender_watch.on_target(
            ned_to_enu(message.x, message.y, message.z),
            ned_to_enu(message.vx, message.vy, message.vz),
            now_s,
            has_position=not message.type_mask & IGNORES_POSITION,
        )
        if self._sender_watch.wants_mode:
            self._heartbeats.want()

    def _on_text(self, message: Message, now_s: float, _: float) -> None:
        text = self.telemetry.status_text
        self._protocols.handlers[mavlink.MAVLINK_MSG_ID_STATUSTEXT](message, now_s)
        self._commands.on_text(text)
        self._causes.on_text(text, now_s)
        self._health.on_text(text, now_s)
        self._severe_texts.on_text(text, message.severity, now_s, self.dialect.ends_of_text(text))

    def _on_parameter(self, message: Message, now_s: float, _: float) -> None:
        self._protocols.handlers[mavlink.MAVLINK_MSG_ID_PARAM_VALUE](message, now_s)
        if self.telemetry.changed_parameter:  # one message does not change how it flies for good
            self._request_parameter(self.telemetry.changed_parameter)
            self.telemetry.changed_parameter = ""
        self._shape.on_parameter(message.param_id, now_s)
        if self._fence_download is not None and message.param_id == self.dialect.zones_parameter:
            self._fence_download.want()

    def _on_outputs(self, message: Message, now_s: float, _: float) -> None:
        if message.port == 0:  # another one has the outputs from 17 on
            armed, landed = self.telemetry.armed.sample, self.telemetry.landed.sample
            self._causes.on_outputs(pulses(message), self.telemetry.parameters, armed, landed, now_s)

    def _for_us(self, handler: Handler) -> Callable[[Message, float, float], None]:
        """Returns what gives a protocol the messages that are not meant for another station."""

        def on_message(message: Message, now_s: float, _: float) -> None:
            system_id, component_id = self._own_ids
            is_ours = getattr(message, "target_system", 0) in (0, system_id)
            if is_ours and getattr(message, "target_component", 0) in (0, component_id):
                handler(message, now_s)

        return on_message

    def _on_timesync(self, message: Message, now_s: float, utc_now_s: float) -> None:
        if message.tc1:  # an answer
            self._supervision.timesync.on_answer(message.ts1, now_s)
            self._sender_watch.round_trip_s = self._supervision.timesync.round_trip_s or 0.0
        else:
            self._sender.send(mavlink.MAVLink_timesync_message(round(utc_now_s * 1e9), message.ts1))

    def _stream_attitude(self, now_s: float) -> None:
        """Takes angles where no quaternion comes. PX4 sends them a hundred times a second as well, for others."""
        began_s = self._began_s = now_s if self._began_s is None else self._began_s
        if self.telemetry.attitude_time_s is None and now_s - began_s > QUATERNION_S:
            self._own_decoded_ids |= {mavlink.MAVLINK_MSG_ID_ATTITUDE}
            self._payload_messages.listen_by(self._decode_also)

    def _fit_rates(self, now_s: float) -> None:
        """Asks for less where the link carries less than the autopilot sends; see `RateFit`."""
        fit = self._fit
        if not fit.is_due(now_s):
            return
        before_hz, loss, is_armed = self._position_rate_hz, self._supervision.loss(now_s), bool(self.telemetry.is_armed)
        if fit.update(now_s, loss, is_armed=is_armed, has_unused=bool(self._unused_ids)):
            streams = self._streams()
            self._commands.drop_requests(lambda request: request.id == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, now_s)
            self._setup.change_streams(streams)
            unused = [set_message_interval(each, UNUSED_RATE_HZ) for each in sorted(self._unused_ids)]
            if not fit.level:
                unused = [default_interval(each) for each in (*unused, *slow_streams())]
            # Whatever the answer: on an overrun link it would not come.
            self._paced = deque(each.request.encode(self.source, 0) for each in (*unused, *streams))
            logs.event(
                _log, logging.WARNING, "stream_rates_changed", loss=round(fit.loss, 2), unused=len(unused),
                position_hz=round(self._position_rate_hz, 1), before_hz=round(before_hz, 1),
            )  # fmt: skip

    def _send_paced(self, now_s: float) -> None:
        if self._paced and now_s >= self._next_paced_s:
            self._next_paced_s = now_s + REQUEST_PACE_S
            self._sender.send(self._paced.popleft())

    @property
    def _position_rate_hz(self) -> float:
        """Requested rate of the position."""
        return max(LEAST_STREAM_RATE_HZ, self._pose_rate_hz * self._fit.share)

    def _streams(self) -> list[LongCommand]:
        """The requests for all streams, at the rates that the link carries."""
        streams = self.dialect.streams(self._pose_rate_hz)
        if not self._fit.level or not streams:
            return streams
        usual = {round(each.request.params[0]): each for each in (*slow_streams(), *streams)}
        target = mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED
        if target in usual:
            usual[target] = target_stream(LEAST_STREAM_RATE_HZ)  # the pose goes first
        return [slower(each, self._fit.share) for each in usual.values()]

    @property
    def note(self) -> str:
        """Human-readable peculiarities of the link: it loses much, or less is requested; empty if there are none."""
        fit, text = self._fit, []
        if fit.is_high:
            text.append(f"the link loses {fit.loss * 10.0:.0f}0 % of its messages")
        if fit.level:
            less = f"{self._position_rate_hz:.3g} positions a second" if fit.level > 1 else "only what is used"
            text.append(f"it is asked for {less}, as the link carries no more")
        return "; ".join(text)

    @property
    def refused(self) -> str:
        """Human-readable list of refused requests for streams, and why it may not hear them; empty if none was."""
        refused = ", ".join(f"{name} ({result})" for name, result in self._setup.refused.items())
        return f"{refused}; it {KEY_MISSING}" if refused and self._signs and not self._has_key else refused

    def _new_setup(self) -> SetupRequests:
        return SetupRequests(
            self.dialect,
            self.telemetry,
            self._commands,
            self._request_parameter,
            self._streams(),
            self._supervision.loss,
            self._report_missing,
            self._request_group,
        )

    def _request_group(self, group: int, rate_hz: int) -> None:
        self._sender.send(request_group(self.source, group, rate_hz))

    def _new_fence_download(self) -> FenceDownload:
        fence, name = self.telemetry.fence, self.dialect.name

        def give_up(why: str) -> None:
            _log.debug("the zones of the own fence of %s were not read: %s", name, why)
            fence.stop_waiting()

        return FenceDownload(self._protocols.missions, fence.set_zones, give_up)

    def _report_missing(self, names: tuple[str, ...]) -> None:
        """Logs once what is assumed instead of parameters that the autopilot does not send."""
        if names == self._reported_missing:
            return
        self._reported_missing = names
        logs.event(
            _log,
            logging.WARNING,
            "parameters_missing",
            names=", ".join(names),
            assumed=assumed_text(self.info().limits),
        )

    def release(self) -> None:
        """Requests the default rates of all messages, as ours are not needed any more; does not wait for answers."""
        unused = (set_message_interval(each, UNUSED_RATE_HZ) for each in self._unused_ids)
        for stream in (*self._streams(), *(unused if self._fit.level else ())):
            self._send_command(default_interval(stream))

    def _request_origin(self, now_s: float) -> None:
        request = request_message(mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
        if now_s >= self._next_origin_s and not self._commands.is_pending(request):
            self._next_origin_s = now_s + ORIGIN_S
            self._commands.submit(request, now_s)

    def _send_command(self, command: LongCommand) -> None:
        """Sends a command once, whatever its answer is."""
        self._transmit(command.request, 0)

    def _transmit(self, request: CommandLong, sent_before_count: int, _: object = None) -> None:
        if self.system_id != ALL_SYSTEMS_ID:
            self._sender.send(request.encode(self.source, sent_before_count))

    def _request_parameter(self, name: str) -> None:
        self._sender.send(mavlink.MAVLink_param_request_read_message(*self.source, name.encode("ascii"), -1))


_HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
_LIVE_IDS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED,
        mavlink.MAVLINK_MSG_ID_RC_CHANNELS,
    }
)
"""Messages whose time since boot is the present one. Others may have that of an old report: PX4's on its gimbal."""
_VTOL = mavlink.MAV_TYPE_VTOL_QUADROTOR
_VERDICTS = {
    mavlink.MAV_RESULT_ACCEPTED: Verdict.ACCEPTED,
    mavlink.MAV_RESULT_IN_PROGRESS: Verdict.IN_PROGRESS,
}
"""Meaning of COMMAND_ACK's results; all others refuse."""


def _result_name(result: int) -> str:
    return member_name("MAV_RESULT", result) or f"result {result}"
