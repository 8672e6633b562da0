"""A gimbal manager with a gimbal, and the gimbals protocol with it, on a link that loses messages."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import received
from ual.geometry import Quaternion
from ual_daemon.backends.mavlink.dialects.ardupilot import ArduCopter
from ual_daemon.backends.mavlink.dialects.command_long import LongCommand
from ual_daemon.backends.mavlink.dialects.dialect import Dialect
from ual_daemon.backends.mavlink.protocols.gimbal_link import GimbalLink
from ual_daemon.backends.mavlink.protocols.gimbals import GimbalProtocol, GimbalServices
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message

T = TypeVar("T")

STEP_S = 0.05
ACCEPTED, DENIED, BUSY = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_IN_PROGRESS
OURS = MessageSource(7, 191)
AUTOPILOT, OWN = MessageSource(7, 1), MessageSource(7, 154)
CAPABILITIES = (
    mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_RETRACT
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_NEUTRAL
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_FOLLOW
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_LOCK
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_FOLLOW
    | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_LOCK
)


class SimulatedManager:
    """Does as mavlink.io/en/services/gimbal_v2.html says, but for what a test changes."""

    def __init__(self, source: MessageSource, send: Callable[[MessageSource, Message], None]) -> None:
        self._source = source
        self._send = send
        self.is_there = True
        self.device_id = 1
        self.kind: float | None = 4.0
        """The parameter with its kind; None: it has none."""
        self.capabilities = CAPABILITIES
        self.limits = (-0.5, 0.5, -1.6, 0.5, -3.2, 3.2)
        """Least and most of roll, pitch and yaw, as MAVLink means them."""
        self.controller = (0, 0)
        self.result = ACCEPTED
        self.answers_twice = False
        self.answers_after_s = 0.0
        self.ignored: set[int] = set()
        self.orders: list[tuple[int, tuple[float, ...]]] = []
        self.aims: list[Any] = []
        self.streamed: dict[int, float] = {}
        self.q = (1.0, 0.0, 0.0, 0.0)
        self.flags = mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
        self.failures = 0
        self.now_s = 0.0
        self._late: list[tuple[float, Message]] = []

    def heartbeat(self) -> None:
        self.say(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GIMBAL, 8, 0, 0, 0, 3))

    def say(self, message: Message) -> None:
        if self.is_there:
            self._send(self._source, message)

    def inform(self) -> None:
        self.say(mavlink.MAVLink_gimbal_manager_information_message(1, self.capabilities, self.device_id, *self.limits))

    def tick(self) -> None:
        """Sends its streams, each at any step, and what it answers late."""
        due = [message for due_s, message in self._late if due_s <= self.now_s]
        self._late = [each for each in self._late if each[0] > self.now_s]
        for message in due:
            self.say(message)
        if mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS in self.streamed:
            self.say(mavlink.MAVLink_gimbal_manager_status_message(1, 0, self.device_id, *self.controller, 0, 0))
        if mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS in self.streamed:
            self.say_attitude()

    def say_attitude(self) -> None:
        nan = math.nan
        self.say(
            mavlink.MAVLink_gimbal_device_attitude_status_message(
                0, 0, 1, self.flags, self.q, nan, nan, nan, self.failures, nan, nan, self.device_id
            )
        )

    def pointing(self, roll_deg: float, pitch_deg: float, yaw_deg: float, flags: int) -> None:
        """Looks somewhere, as MAVLink means angles and flags."""
        q = Quaternion.from_euler(*map(math.radians, (roll_deg, pitch_deg, yaw_deg)))
        self.q, self.flags = (q.w, q.x, q.y, q.z), flags

    def on_message(self, message: Any) -> None:
        """Takes what is sent to it."""
        if not self.is_there or message.target_component != self._source.component_id:
            return
        if message.get_type() == "PARAM_REQUEST_READ" and self.kind is not None:
            name = message.param_id.encode()
            is_px4 = name == b"MNT_DO_STAB"  # which sends the bytes of an integer in the place of the number
            value = struct.unpack("<f", struct.pack("<i", int(self.kind)))[0] if is_px4 else self.kind
            kind = mavlink.MAV_PARAM_TYPE_INT32 if is_px4 else mavlink.MAV_PARAM_TYPE_INT8
            self.say(mavlink.MAVLink_param_value_message(name, value, kind, 1, 65535))
        elif message.get_type() == "GIMBAL_MANAGER_SET_ATTITUDE":
            self.aims.append(message)
        elif message.get_type() == "COMMAND_LONG" and message.command not in self.ignored:
            self._on_command(message.command, tuple(getattr(message, f"param{i}") for i in range(1, 8)))

    def _on_command(self, command: int, params: tuple[float, ...]) -> None:
        if command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            self.inform()
        elif command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            self.streamed[round(params[0])] = params[1]
        else:
            self.orders.append((command, params))
            if command == mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE and self.result == ACCEPTED:
                self.controller = (0, 0) if params[0] == -3.0 else (round(params[0]), round(params[1]))
            ack = mavlink.MAVLink_command_ack_message(command, self.result)
            for _ in range(2 if self.answers_twice else 1):
                self._late.append((self.now_s + self.answers_after_s, ack))


class Bench:
    """The protocol with one manager. Messages pass with each step, unless they are lost."""

    def __init__(
        self, source: MessageSource = OWN, dialect: Dialect | None = None, *, loss: float = 0.0, seed: int = 1
    ) -> None:
        self.now_s = 1000.0
        self._random = random.Random(seed)
        self._loss = loss
        self._to_us: list[tuple[MessageSource, Message]] = []
        self._to_it: list[Any] = []
        self.requests: list[LongCommand] = []
        self.source = source
        self.manager = SimulatedManager(source, lambda who, message: self._to_us.append((who, message)))
        self.is_flying = False
        means = GimbalServices(
            self._to_it.append, self._to_it.append, self._submit, lambda: OURS, lambda: True, lambda: self.is_flying
        )
        self.gimbals = GimbalProtocol(means)
        self.gimbals.attach(AUTOPILOT, ArduCopter() if dialect is None else dialect)

    def _submit(self, command: LongCommand, now_s: float) -> None:
        """As the session: requests to the autopilot take their turn."""
        self.requests.append(command)
        self._to_it.append(command.request.encode(AUTOPILOT, 0))

    def step(self, duration_s: float = STEP_S) -> None:
        for _ in range(max(1, round(duration_s / STEP_S))):
            self.now_s += STEP_S
            self.manager.now_s = self.now_s
            if self.source != AUTOPILOT and round(self.now_s / STEP_S) % round(1.0 / STEP_S) == 0:
                self.manager.heartbeat()
            self.gimbals.tick(self.now_s)
            self.deliver()
            self.manager.tick()
            for who, message in self._passing(self._to_us):
                self.receive(who, message)

    def deliver(self) -> None:
        """Gives the manager what was sent to it."""
        for message in self._passing(self._to_it):
            self.manager.on_message(received(message))

    def receive(self, who: MessageSource, message: Message) -> None:
        """Gives us a message of a component, or of the autopilot."""
        if who != AUTOPILOT:
            self.gimbals.on_component(who, message, self.now_s)
        elif message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
            self.gimbals.on_ack(who.component_id, message, self.now_s)
        else:
            self.gimbals.handlers[message.get_msgId()](message, self.now_s)

    def _passing(self, waiting: list[Any]) -> list[Any]:
        passing = [each for each in waiting if self._random.random() >= self._loss]
        waiting.clear()
        return passing

    def found(self) -> GimbalLink:
        """The gimbal, once it is found and has said what is asked of it."""
        for _ in range(round(60.0 / STEP_S)):
            self.step()
            for link in self.gimbals.found:
                if link.identity and link.attitude and link.control[0]:
                    return link
        raise AssertionError("no gimbal was found")

    def ended(self, begin: Callable[[Future[T]], object], limit_s: float = 30.0) -> T:
        """Returns the result of a future that something begins."""
        future: Future[T] = Future()
        begin(future)
        for _ in range(round(limit_s / STEP_S)):
            if future.done():
                break
            self.step()
        return future.result(0)
