"""One gimbal of the vehicle: a device, and the manager that takes orders for it."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import NamedTuple

from ual.errors import LinkLostError, TaskAbortedError, UalError
from ual.gimbals import GimbalAbility, GimbalAngles, GimbalControl, GimbalInfo, GimbalReference
from ual_daemon.backends.engine.agreement import Agreement
from ual_daemon.backends.firmwares import gimbal_protocol
from ual_daemon.backends.firmwares.gimbal_protocol import GimbalIdentity
from ual_daemon.backends.mavlink.protocols.camera_exchanges import CameraOrder, CameraSender
from ual_daemon.backends.mavlink.protocols.gimbal_values import aiming, identity_of
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.offers.gimbals import GimbalAttitude

_log = logging.getLogger(__name__)

LOST_GIMBAL_S = 5.0
"""Seconds of silence after which a gimbal counts as not connected."""
ATTITUDE_AGE_LIMIT_S = 1.0
"""Seconds after a report for which a gimbal's attitude counts as known, ..."""
ASK_S, LATER_ASK_S = 2.0, 10.0
"""... and seconds between two questions for it: at first, and after `EARLY_REQUESTS` times."""
EARLY_REQUESTS = 10
ATTITUDE_HZ, STATUS_HZ = 10.0, 2.0
LATE_ANSWER_S = 0.7
"""Seconds for which an order waits after one of its kind that was repeated: late answers to that would be taken for its
own. After one that was sent once and not answered it leaves at once, and is repeated until an answer is surely its own.
"""
_ATTITUDE, _STATUS = (
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS,
    mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS,
)
_TURN, _CONFIGURE = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
_UNCHANGED, _RELEASE = -1.0, -3.0


class GimbalSender(NamedTuple):
    """Line to the manager of a gimbal.

    Attributes:
        send: Sends a message.
        send_perishable: Sends one that is of no use when it is late.
        stream: Asks for a stream: of which message, and how often.
        read_kind: Asks for its kind.
        own_ids: Returns our system and component.
    """

    send: Callable[[Message], object]
    send_perishable: Callable[[Message], object]
    stream: Callable[[int, float, float], object]
    read_kind: Callable[[], object]
    own_ids: Callable[[], MessageSource]


class GimbalLink:
    """Belongs to the thread that receives; what is requested as a value is for any thread.

    One order of a kind runs at a time. A newer one takes the place of the one before. Unless `is_kind_known`, the
    autopilot is queried for the kind of its own gimbal, and where that looks is not known until then.
    """

    def __init__(
        self, number: int, manager: MessageSource, device_id: int, line: GimbalSender, *, is_kind_known: bool = True
    ) -> None:
        self.number = number
        self.manager = manager
        self.device_id = device_id
        self.heard_s = -math.inf
        self.attitude: GimbalAttitude | None = None
        self._identities: Agreement[GimbalIdentity] | None = None
        self.is_identified = False
        """Whether it has identified itself since it was received first, or again."""
        self.failures: tuple[str, ...] = ()
        self._line = line
        self.is_kind_known = is_kind_known
        self.meant: GimbalReference | None = None
        """Axes of its attitude, whatever its flags say. None: as they say."""
        self._controller: MessageSource | None = None
        self._takes_control = False
        """Whether this daemon has ordered to take the control, and not given it up since."""
        self._orders: dict[int, CameraOrder] = {}
        self._next: dict[int, CameraOrder] = {}
        self._quiet_until_s: dict[int, float] = {}
        self._doubtful_until_s: dict[int, float] = {}
        """Until when an answer to each kind of order may be to one that has ended."""
        self._next_ask_s = -math.inf
        self._asks_count = 0
        self.has_asked = False
        """Whether its streams were requested."""
        self._is_odd = False

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    def identity(self) -> GimbalIdentity | None:
        """Identity of the gimbal; None while that is not known."""
        return None if self._identities is None else self._identities.value

    @property
    def is_doubtful(self) -> bool:
        """Whether it has reported to be something else, so that it is to be asked again."""
        return self._identities is not None and self._identities.is_open

    @property
    def name(self) -> str:
        """Human-readable name of the gimbal."""
        where = "the autopilot" if self.manager.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1 else ""
        return f"gimbal {self.device_id} of {where or f'component {self.manager.component_id}'}"

    def info(self, now_s: float) -> GimbalInfo:
        """Returns what it is."""
        identity, is_connected = self.identity, now_s - self.heard_s <= LOST_GIMBAL_S
        if identity is None:
            return GimbalInfo(self.number, self.name, frozenset(), is_connected, note="it has not said what it is")
        roll, pitch, yaw = identity.roll, identity.pitch, identity.yaw
        odd = "it says an orientation that cannot be" if self._is_odd else ""
        unknown = "" if self.is_kind_known else "its kind is not known yet, so where it looks is not told"
        note = "; ".join(filter(None, (identity.note, odd, unknown)))
        return GimbalInfo(self.number, self.name, identity.abilities, is_connected, "", roll, pitch, yaw, note)

    def attitude_at(self, now_s: float) -> GimbalAttitude | None:
        """Returns where it looks, if it has reported so lately."""
        attitude = self.attitude
        return attitude if attitude is not None and now_s - attitude.time_s <= ATTITUDE_AGE_LIMIT_S else None

    @property
    def control(self) -> tuple[GimbalControl | None, str]:
        """Program that has the control of the gimbal."""
        controller = self._controller
        if controller is None:
            return None, ""
        if controller.system_id == 0:
            return GimbalControl.FREE, ""
        if controller == self._line.own_ids():
            return GimbalControl.OURS, "this daemon"
        return GimbalControl.OTHER, f"system {controller.system_id}, component {controller.component_id}"

    # --- What is ordered ----------------------------------------------------------------------------------------------

    def turn(self, angles: GimbalAngles, reference: GimbalReference, future: Future[None]) -> None:
        """Turns to angles. A roll has no command, so it is sent after the others were accepted."""
        if angles.roll_rad:
            future.add_done_callback(
                lambda done: None if done.cancelled() or done.exception() is not None else self.aim(angles, reference)
            )
        self._add(_TURN, gimbal_protocol.turning_params(angles, reference, self.device_id), future)

    def turn_at_rates(self, pitch_rad_s: float, yaw_rad_s: float, future: Future[None]) -> None:
        """Turns at rates."""
        self._add(_TURN, gimbal_protocol.rates_params(pitch_rad_s, yaw_rad_s, self.device_id), future)

    def rest(self, future: Future[None], *, is_retracted: bool) -> None:
        """Turns to neutral, or is retracted."""
        flag = gimbal_protocol.RETRACT if is_retracted else gimbal_protocol.NEUTRAL
        self._add(_TURN, gimbal_protocol.resting_params(flag, self.device_id), future)

    def aim(self, angles: GimbalAngles, reference: GimbalReference) -> None:
        """Turns to angles, without an answer. From any thread."""
        self._line.send_perishable(aiming(self.manager, angles, reference, self.device_id))

    def take(self, future: Future[None]) -> None:
        """Takes the control. By our ids: PX4 would take -2, "the sender", for itself."""
        self._configure(self._line.own_ids(), future)

    def release(self, future: Future[None]) -> None:
        """Gives the control up."""
        self._configure((_RELEASE, _RELEASE), future)

    def leave(self) -> None:
        """Gives the control up, once and without an answer, where this daemon may have it: a manager ignores others."""
        if self._takes_control:
            self._command(_CONFIGURE, self._configuration((_RELEASE, _RELEASE)), 0)

    def _configuration(self, primary: Sequence[float]) -> tuple[float, ...]:
        system_id, component_id = map(float, primary)
        return system_id, component_id, _UNCHANGED, _UNCHANGED, 0.0, 0.0, float(self.device_id)

    def _configure(self, primary: Sequence[float], future: Future[None]) -> None:
        system_id = float(primary[0])
        self._takes_control = self._takes_control or system_id >= 0.0

        def on_done(done: Future[None]) -> None:
            if done.cancelled() or done.exception() is not None:
                return
            self._takes_control = system_id >= 0.0
            if system_id >= 0.0:
                self._controller = self._line.own_ids()
            elif self.control[0] is GimbalControl.OURS:
                self._controller = MessageSource(0, 0)

        future.add_done_callback(on_done)
        self._add(_CONFIGURE, self._configuration(primary), future)

    def _add(self, command_id: int, params: Sequence[float], future: Future[None]) -> None:
        line = CameraSender(self._command, self.name)
        replaced = self._next.pop(command_id, None)
        if replaced is not None:
            replaced.fail(TaskAbortedError(f"a newer order to {self.name} has replaced this one"))
        self._next[command_id] = CameraOrder(future, line, command_id, params)

    def _command(self, command_id: int, params: Sequence[float], sent_count: int) -> None:
        self._line.send(mavlink.MAVLink_command_long_message(*self.manager, command_id, min(sent_count, 255), *params))

    @property
    def is_busy(self) -> bool:
        """Whether an order is in progress."""
        return bool(self._orders or self._next)

    def forget(self, *, is_kind_known: bool) -> None:
        """Forgets what a boot may have changed, and requests it again. Its kind is requested unless that is known."""
        if self._identities is not None:
            self._identities = Agreement(self._identities.value)
        self.is_identified, self.is_kind_known = False, is_kind_known
        self.attitude = self.meant = self._controller = None
        self._takes_control = False
        self._next_ask_s, self._asks_count = -math.inf, 0

    def drop(self, error: UalError) -> None:
        """Ends what is in progress, and what waits."""
        for order in (*self._orders.values(), *self._next.values()):
            order.fail(error)
        self._orders.clear()
        self._next.clear()

    # --- What comes, and what is due ----------------------------------------------------------------------------------

    def on_information(
        self, message: Message, now_s: float, lacks: frozenset[GimbalAbility], *, is_flying: bool
    ) -> None:
        """Takes what it is. It lacks what its autopilot only says that it has."""
        self._hear(now_s)
        self.is_identified = True
        identity = identity_of(message)
        identity = identity._replace(abilities=identity.abilities - lacks)
        is_first = self._identities is None
        self._identities = self._identities or Agreement(identity)
        if self._identities.note(identity, now_s, is_flying=is_flying) or is_first:
            can = ", ".join(sorted(each.name.lower() for each in identity.abilities))
            _log.info("gimbal %d (%s) can: %s%s", self.number, self.name, can, identity.note and f"; {identity.note}")

    def on_status(self, message: Message, now_s: float) -> None:
        """Takes a GIMBAL_MANAGER_STATUS."""
        self._hear(now_s)
        self._controller = MessageSource(message.primary_control_sysid, message.primary_control_compid)

    def on_attitude(self, message: Message, now_s: float, *, is_of_manager: bool) -> None:
        """Takes a GIMBAL_DEVICE_ATTITUDE_STATUS."""
        self._hear(now_s)
        self.failures = gimbal_protocol.failures_of(message.failure_flags)
        if not self.is_kind_known and is_of_manager:
            return
        found = gimbal_protocol.attitude_of(message.flags, message.q, self.meant if is_of_manager else None)
        self._is_odd = found is None
        self.attitude = None if found is None else GimbalAttitude(*found, now_s)

    def _hear(self, now_s: float) -> None:
        if now_s - self.heard_s > LOST_GIMBAL_S and self.heard_s > -math.inf:
            _log.info("%s is heard again", self.name)
            self.is_identified, self._controller = False, None
        self.heard_s = now_s

    def on_ack(self, message: Message, now_s: float) -> None:
        """Takes an answer to a command."""
        order = self._orders.get(message.command)
        if order is not None and now_s >= self._doubtful_until_s.get(message.command, -math.inf):
            order.on_ack(message.command, message.result, now_s)

    def tick(self, now_s: float) -> None:
        """Sends what is due; to be called often."""
        if self.is_busy and now_s - self.heard_s > LOST_GIMBAL_S:
            silent_s = now_s - self.heard_s
            self.drop(LinkLostError(f"{self.name} is not heard: its last message came {silent_s:.0f} s ago"))
        self._ask(now_s)
        for command_id in (_CONFIGURE, _TURN):
            self._tick_order(command_id, now_s)

    def _tick_order(self, command_id: int, now_s: float) -> None:
        running = self._orders.get(command_id)
        if running is not None and command_id in self._next and not running.is_over:
            running.fail(TaskAbortedError(f"a newer order to {self.name} has replaced this one"))
        if running is not None and running.is_over:
            if running.was_repeated:
                self._quiet_until_s[command_id] = now_s + LATE_ANSWER_S
            elif running.was_sent and not running.is_answered:
                self._doubtful_until_s[command_id] = now_s + LATE_ANSWER_S
            del self._orders[command_id]
            running = None
        if running is None and now_s >= self._quiet_until_s.get(command_id, -math.inf):
            waiting = self._next.pop(command_id, None)
            if waiting is not None and not waiting.is_over:
                self._orders[command_id] = running = waiting
        if running is not None:
            running.tick(now_s)

    def _ask(self, now_s: float) -> None:
        """Asks for its streams where they do not come."""
        if now_s < self._next_ask_s:
            return
        if self.attitude_at(now_s) is not None and self._controller is not None:
            self._asks_count = 0
            return
        self._asks_count += 1
        self.has_asked = True
        if not self.is_kind_known:
            self._line.read_kind()
        self._next_ask_s = now_s + (ASK_S if self._asks_count < EARLY_REQUESTS else LATER_ASK_S)
        self._line.stream(_ATTITUDE, ATTITUDE_HZ, now_s)
        self._line.stream(_STATUS, STATUS_HZ, now_s)
