"""One autopilot that was met: what it says, what it is asked and told. Belongs to the thread that receives."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from concurrent.futures import Future
from typing import Protocol

from ual_daemon.backends.mavlink.autopilots.dialect import Dialect, Reality
from ual_daemon.backends.mavlink.autopilots.feed_forward import FeedForward
from ual_daemon.backends.mavlink.session.commands import Command, Commands, request_message
from ual_daemon.backends.mavlink.session.interview import Interview
from ual_daemon.backends.mavlink.session.supervision import LinkState, Supervision
from ual_daemon.backends.mavlink.session.telemetry import Telemetry
from ual_daemon.backends.mavlink.wire.frames import Frame
from ual_daemon.backends.mavlink.wire.messages import EVENT_ID, Message, mavlink
from ual_daemon.backends.values import PositionSetpoint, Setpoint, Snapshot, VehicleInfo

_log = logging.getLogger(__name__)

HEARTBEAT_S = 1.0
ASK_HEARTBEAT_S = 0.1
"""At most this often the autopilot is asked for a heartbeat out of turn."""
HEARTBEAT_LATE_S = 1.1
"""A heartbeat this late was lost. On a bad link three in a row can be, and nothing else tells whether it is armed."""
SILENCE_S = 3.0
"""After a silence as long as this it is asked everything anew: it may have booted, or the link been another's."""
OLD_EVENT_S = 1.0
"""An event of PX4 that is this much older than the newest time since boot is no news."""
STREAMLESS_S = 10.0
"""How often one that does not stream any more is asked everything anew."""


class Transmit(Protocol):
    """Sends a message; false when it could not leave, or when it is perishable and would be late."""

    def __call__(self, message: Message, *, is_perishable: bool = False) -> bool: ...


class MavlinkVehicle:
    """The conversation with one autopilot. `transmit` sends a message; `setpoints_s` is as for `Commands`."""

    def __init__(
        self,
        system_id: int,
        dialect: Dialect,
        pose_rate_hz: float,
        own_ids: tuple[int, int],
        transmit: Transmit,
        setpoints_s: Callable[[float], float],
        supervision: Supervision,
        *,
        learns_feed_forward: bool = True,
    ) -> None:
        self.system_id = system_id
        self.dialect = dialect
        self.telemetry = Telemetry(dialect)
        self._pose_rate_hz = pose_rate_hz
        self._own_ids = own_ids
        self._transmit = transmit
        self._setpoints_s = setpoints_s
        self._supervision = supervision
        self._commands = Commands(dialect.name, self._send_command, setpoints_s, self.telemetry.snapshot)
        self._interview = self._new_interview()
        self._next_interview_s = -math.inf
        self._next_heartbeat_s: float | None = None
        self._next_ask_s: float | None = None
        self._wants_heartbeat = False
        self._heartbeat_s = -math.inf
        self._unlearnt_s: tuple[float, float] | None = None
        """When the newest position came from which nothing was learnt yet, by our clock and by the autopilot's."""
        self._feed_forward = FeedForward() if learns_feed_forward and dialect.takes_feed_forward else None
        self._handlers: dict[int, Callable[[Message, float, float], None]] = {
            mavlink.MAVLINK_MSG_ID_COMMAND_ACK: self._on_ack,
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._on_position,
            mavlink.MAVLINK_MSG_ID_STATUSTEXT: self._on_text,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
        }
        """What follows from a message beside what it tells of the vehicle, which `telemetry` has taken before."""
        self.used_ids = self.telemetry.used_ids | self._handlers.keys()
        """Of messages that are worth decoding; of others the arrival is enough."""

    @property
    def is_hurried(self) -> bool:
        """Whether a command is under way, or a heartbeat is wanted at once: it should be ticked often."""
        return self._wants_heartbeat or self._commands.is_any_under_way

    def update(self, message: Message, now_s: float, utc_now_s: float) -> None:
        """Takes a decoded message of this autopilot."""
        telemetry = self.telemetry
        self._end_silence(now_s)
        boot_ms = getattr(message, "time_boot_ms", 0)  # 0 also where it is not known
        if boot_ms > 0 and self._supervision.booted(boot_ms / 1000.0, now_s):
            telemetry.booted()
            self.ask_anew()
        telemetry.update(message, now_s, utc_now_s)
        if telemetry.is_mode_doubtful:
            telemetry.is_mode_doubtful = False
            self._wants_heartbeat = True
        handler = self._handlers.get(message.get_msgId())
        if handler is not None:
            handler(message, now_s, utc_now_s)

    def notice(self, frame: Frame, now_s: float) -> None:
        """Takes the arrival of a message that no dialect of pymavlink knows, or that is not used."""
        self._end_silence(now_s)
        self.telemetry.heard(frame.sequence, now_s)
        event = self.dialect.event(frame, self.telemetry.mode_name) if frame.message_id == EVENT_ID else None
        # It sends the last ones again to anybody who asks for them, all that listen included.
        if event is not None and event.boot_s >= self._supervision.boot_s - OLD_EVENT_S:
            # PX4 tells of arming, disarming and failsafes by an event at once, in a heartbeat up to 1 s later.
            self._wants_heartbeat = True
            if event.armed is not None:
                self.telemetry.armed_changed(event.armed, now_s)
            if event.text:
                self._commands.on_text(event.text)

    def _end_silence(self, now_s: float) -> None:
        """Something came. After a silence that counts as a lost link nothing from before it is believed: the autopilot
        may have done what it does without us, and a setpoint sent by its mode of then would take PX4 out of that again.
        """
        heard_s = self.telemetry.heard_s
        silence_s = 0.0 if heard_s is None else now_s - heard_s
        if silence_s > self.dialect.freshness.link_s:
            self.forget()
        if silence_s > SILENCE_S:
            self.ask_anew()

    def forget(self) -> None:
        """See `Telemetry.forget`. A heartbeat is asked for, so that it is known again at once."""
        self.telemetry.forget()
        self._wants_heartbeat = True

    def ask_anew(self) -> None:
        """It may have booted, or have been connected anew: everything is asked again."""
        _log.debug("asking %s everything anew", self.dialect.name)
        self._interview = self._new_interview()

    def submit(self, command: Command, now_s: float, is_withdrawn: Callable[[], bool] = lambda: False) -> Future[None]:
        """Sends a command; see `Commands.submit`."""
        future = self._commands.submit(command, now_s, is_withdrawn)
        future.add_done_callback(self._on_done)  # done by tick or update, so on the thread that this belongs to
        return future

    def send(self, setpoint: Setpoint, now_s: float) -> bool:
        """Sends a setpoint; false when it could not leave. From any thread."""
        time_ms = int(now_s * 1000.0) & 0xFFFFFFFF
        if self._feed_forward is not None and isinstance(setpoint, PositionSetpoint):
            setpoint = self._feed_forward.apply(setpoint, now_s)
        message = self.dialect.setpoint(setpoint, self.system_id, time_ms, self.telemetry.parameters)
        return self._transmit(message, is_perishable=True)

    def tick(self, now_s: float) -> None:
        """Does what time asks for, and what can wait until an update has been told; to be called often."""
        if self._unlearnt_s is not None:
            self._learn(*self._unlearnt_s)
            self._unlearnt_s = None
        if self._next_heartbeat_s is None or now_s >= self._next_heartbeat_s:
            self._next_heartbeat_s = now_s + HEARTBEAT_S
            self._transmit(heartbeat())
        asked_ns = self._supervision.round_trip.request_ns(now_s)
        if asked_ns is not None:
            self._transmit(mavlink.MAVLink_timesync_message(0, asked_ns))
        if self._has_stopped_streaming(now_s):
            _log.info("%s is heard, but sends no attitude any more: asking it everything anew", self.dialect.name)
            self._next_interview_s = now_s + STREAMLESS_S
            self._interview = self._new_interview()
        self._interview.tick(now_s)
        self._commands.tick(now_s)
        is_late = now_s - self._heartbeat_s > HEARTBEAT_LATE_S and self._supervision.state is not LinkState.LOST
        is_wanted = self._wants_heartbeat or is_late or self._commands.awaits_effect(now_s)
        if is_wanted and (self._next_ask_s is None or now_s >= self._next_ask_s):
            self._wants_heartbeat = False
            self._next_ask_s = now_s + ASK_HEARTBEAT_S
            self._send_command(request_message(mavlink.MAVLINK_MSG_ID_HEARTBEAT), 0)

    def snapshot(self, now_s: float) -> Snapshot:
        return self.telemetry.snapshot(now_s)

    def reality(self) -> Reality:
        """Whether it is a simulator, and surely no flight controller. From any thread."""
        telemetry = self.telemetry
        if telemetry.is_hardware_in_the_loop:
            return Reality(False, "it is a flight controller in a simulation (hardware in the loop)")
        return self.dialect.reality(telemetry.version, telemetry.parameters, self.system_id)

    def is_ready_to_arm(self) -> bool:
        """Whether it would be armed when asked to, as far as it tells. From any thread.

        In a mode in which it cannot be armed, PX4 says so of the mode; that says nothing of the one it is armed in.
        """
        mode = self.telemetry.mode_name
        return self.telemetry.is_ready_to_arm or not self.dialect.can_be_armed_in(mode)

    def info(self) -> VehicleInfo:
        """What is known of it so far."""
        telemetry, dialect = self.telemetry, self.dialect
        version = telemetry.version
        return VehicleInfo(
            autopilot=dialect.name,
            autopilot_version="" if version is None else dialect.version(version),
            is_simulation=telemetry.is_hardware_in_the_loop or self.reality().is_simulated is True,
            capabilities=dialect.capabilities,
            limits=dialect.limits(telemetry.parameters),
            flies_takeoff_on_setpoints=dialect.flies_takeoff_on_setpoints,
        )

    def _learn(self, came_s: float, own_s: float) -> None:
        pose, velocity = self.telemetry.pose, self.telemetry.velocity
        if self._feed_forward is None or pose is None or velocity is None or pose.time_s != came_s:
            return
        self._feed_forward.learn(own_s, pose.value, velocity.value.linear)

    def _has_stopped_streaming(self, now_s: float) -> bool:
        """Whether it sends something, but what it was asked for no more, as after a boot that was short."""
        heard_s, attitude_s = self.telemetry.heard_s, self.telemetry.attitude_time_s
        if heard_s is None or attitude_s is None or now_s < self._next_interview_s:
            return False
        return now_s - heard_s < SILENCE_S < now_s - attitude_s

    def _on_ack(self, message: Message, now_s: float, _: float) -> None:
        if (message.target_system, message.target_component) in (self._own_ids, (0, 0)):
            self._commands.on_ack(message, now_s)

    def _on_heartbeat(self, _message: Message, now_s: float, _: float) -> None:
        self._heartbeat_s = now_s

    def _on_position(self, message: Message, now_s: float, _: float) -> None:
        if self._feed_forward is not None:
            self._unlearnt_s = (now_s, message.time_boot_ms / 1000.0)

    def _on_text(self, _message: Message, _now_s: float, _: float) -> None:
        self._commands.on_text(self.telemetry.status_text)

    def _on_timesync(self, message: Message, now_s: float, utc_now_s: float) -> None:
        if message.tc1:  # an answer
            self._supervision.round_trip.answered(message.ts1, now_s)
        else:
            self._transmit(mavlink.MAVLink_timesync_message(round(utc_now_s * 1e9), message.ts1))

    def _on_done(self, _: Future[None]) -> None:
        self._wants_heartbeat = True

    def _new_interview(self) -> Interview:
        return Interview(self.dialect, self.telemetry, self._commands, self._read_parameter, self._pose_rate_hz)

    def _send_command(self, command: Command, sent_before_count: int) -> None:
        params = (*command.params, *(0.0,) * (7 - len(command.params)))
        self._transmit(
            mavlink.MAVLink_command_long_message(
                self.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, command.id, sent_before_count, *params
            )
        )

    def _read_parameter(self, name: str) -> None:
        self._transmit(
            mavlink.MAVLink_param_request_read_message(
                self.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, name.encode("ascii"), -1
            )
        )


def heartbeat() -> Message:
    """Ours: an onboard computer, which PX4 then counts as present, but never as a ground station."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
    )
