"""Common part of the safety pilots of all simulators: a ground station's link, by which they see and command."""

from __future__ import annotations

import socket
import struct
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from tests.waiting import until
from ual_daemon.backends.mavlink.wire.frames import MavlinkFrame
from ual_daemon.backends.mavlink.wire.messages import Message

PATIENCE_S = 90.0
SEND_AGAIN_S = 1.5


@dataclass(frozen=True)
class Sticks:
    """Positions of the sticks, -1 to 1; 0 is the middle."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    turn_right: float = 0.0


class Transmitter(ABC):
    """A safety pilot. A thread holds the sticks, `sticks_s` apart, and listens to what the autopilot says.

    `link` is open already; it is closed with this.
    """

    autopilot: str
    sticks_s: float
    heard_messages: frozenset[int]
    home_items_count = 0
    """Items of its missions that stand for its home."""

    def __init__(self, link: socket.socket, system_id: int) -> None:
        self._link = link
        self._link.settimeout(self.sticks_s)
        self._codec = AutopilotCodec(mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._codec.join(system_id)
        self._changed = threading.Condition()
        self._system_id = 0
        self.sticks = Sticks()
        self.holds_sticks = True
        """Whether the transmitter is on."""
        self.is_ready = False
        self.is_armed = False
        self.mode = -1
        """The autopilot's custom mode; -1 until it has told."""
        self.said = ""
        self.severe: list[tuple[float, str]] = []
        """Texts of severity 0 to 2, and when each came."""
        self._listeners: dict[int, Callable[[Message], None]] = {}
        self._is_closing = False
        self._thread = threading.Thread(target=self._run, name=f"safety pilot of {self.autopilot}")

    @property
    def is_terminated(self) -> bool:
        """Whether the autopilot has terminated a flight, and refuses every other mode until it boots."""
        return False

    def close(self) -> None:
        self._is_closing = True
        self._thread.join()
        self._link.close()

    @abstractmethod
    def begin(self) -> None:
        """As before any day's first flight: the autopilot is there, and the mode switch is where the pilot wants it."""

    @abstractmethod
    def wait_until_ready(self) -> None:
        """Until the autopilot says that it may be armed, in a mode in which it may."""

    @abstractmethod
    def take_over(self) -> None:
        """Flips the mode switch to the pilot's mode, and returns at once."""

    def arm(self) -> None:
        self._order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,), lambda: self.is_armed, "armed")

    def disarm(self) -> None:
        self._order(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (0.0,), lambda: not self.is_armed, "disarmed")

    def order(self, command: int, params: tuple[float, ...]) -> None:
        """Sends a command once, as a ground station does."""
        self._command(command, params)

    def set_parameter(self, name: str, value: float) -> None:
        """Sets a parameter that is a number in floating point on the wire, as a ground station does."""
        self._set_parameter(name, value, mavlink.MAV_PARAM_TYPE_REAL32)

    def set_integer(self, name: str, value: int) -> None:
        """Sets a parameter that is an integer: PX4 takes its bytes in the place of the number."""
        (bytes_as_number,) = struct.unpack("<f", struct.pack("<i", value))
        self._set_parameter(name, bytes_as_number, mavlink.MAV_PARAM_TYPE_INT32)

    def _set_parameter(self, name: str, value: float, kind: int) -> None:
        for _ in range(2):  # it may be lost
            self._tell(mavlink.MAVLink_param_set_message(self._system_id, 1, name.encode(), value, kind))
            time.sleep(0.3)

    def upload_fence(self, items: Sequence[tuple[int, float, float, float]]) -> None:
        """Uploads a fence, as a ground station does; without items it is cleared.

        Each item is its command, its first parameter, and latitude and longitude in degrees.
        """
        kind, frame = mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_FRAME_GLOBAL
        result = self._upload(kind, frame, [(*item, 0.0) for item in items])
        assert result == mavlink.MAV_MISSION_ACCEPTED, result

    def upload_mission(self, places: Sequence[tuple[float, float, float]]) -> bool:
        """Uploads a mission, as a ground station does; without places it is cleared. Returns whether it was taken.

        Each place is latitude and longitude in degrees, and its height above home.
        """
        kind, frame = mavlink.MAV_MISSION_TYPE_MISSION, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        items = [(mavlink.MAV_CMD_NAV_WAYPOINT, 0.0, *place) for place in places]
        result = self._upload(kind, frame, items[: self.home_items_count] + items)
        return bool(result == mavlink.MAV_MISSION_ACCEPTED)

    def _upload(self, kind: int, frame: int, items: Sequence[tuple[int, float, float, float, float]]) -> int:
        results: list[int] = []

        def send(request: Message) -> None:
            command, size, latitude_deg, longitude_deg, height_m = items[request.seq]
            place = round(latitude_deg * 1e7), round(longitude_deg * 1e7), height_m
            self._tell(
                mavlink.MAVLink_mission_item_int_message(
                    self._system_id,
                    1,
                    request.seq,
                    frame,
                    command,
                    0,
                    1,
                    size,
                    0.0,
                    0.0,
                    0.0,
                    *place,
                    kind,
                )
            )

        self._listeners[mavlink.MAVLINK_MSG_ID_MISSION_REQUEST] = send
        self._listeners[mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT] = send
        self._listeners[mavlink.MAVLINK_MSG_ID_MISSION_ACK] = lambda message: results.append(message.type)
        if items or kind == mavlink.MAV_MISSION_TYPE_FENCE:
            self._tell(mavlink.MAVLink_mission_count_message(self._system_id, 1, len(items), kind))
        else:
            self._tell(mavlink.MAVLink_mission_clear_all_message(self._system_id, 1, kind))
        self._wait(lambda: bool(results), "given its items")
        return results[0]

    def set_mode(self, custom_mode: int, main: float, sub: float = 0.0) -> None:
        """Returns when the autopilot is in it. `main` and `sub` are the mode in the words of DO_SET_MODE."""
        params = (float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED), main, sub)
        self._order(mavlink.MAV_CMD_DO_SET_MODE, params, lambda: self.mode == custom_mode, f"in mode {custom_mode}")

    def listen(self, message_id: int, rate_hz: float, take: Callable[[Message], None]) -> None:
        """Asks for a message, and hands each one to `take`, on the thread that holds the sticks."""
        self._listeners[message_id] = take
        self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (float(message_id), 1e6 / rate_hz))

    @abstractmethod
    def lose_signal(self) -> None:
        """The autopilot hears the transmitter no more, until `find_signal`."""

    @abstractmethod
    def find_signal(self) -> None:
        """Ends `lose_signal`."""

    @abstractmethod
    def stand_by(self) -> None:
        """Moves the switch to its position before the next take-over, as a pilot does once control was recovered. Where
        programs fly by a position of the switch, that gives control back. Returns when the autopilot has surely seen
        it.
        """

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Sends to the autopilot."""

    @abstractmethod
    def _frames(self, data: bytes) -> Sequence[MavlinkFrame]:
        """The frames in what was received."""

    @abstractmethod
    def _hold_sticks(self, count: int) -> None:
        """Sends where the sticks are, for the `count`-th time."""

    def _wait(self, is_done: Callable[[], bool], what: str) -> None:
        with self._changed:
            assert self._changed.wait_for(is_done, timeout=PATIENCE_S), self._not(what)

    def _order(self, command: int, params: tuple[float, ...], is_done: Callable[[], bool], what: str) -> None:
        """Sends a command until it has shown its effect."""

        def send() -> None:
            self._command(command, params)
            with self._changed:
                self._changed.wait_for(is_done, timeout=SEND_AGAIN_S)

        until(is_done, what, seen=lambda: self._not(what), between=send, limit_s=PATIENCE_S)

    def _not(self, what: str) -> str:
        return f"{self.autopilot} {self._system_id} is not {what} (mode {self.mode:#x}); it said {self.said!r}"

    def _command(self, command: int, params: tuple[float, ...]) -> None:
        padded = (*params, *(0.0,) * (7 - len(params)))
        self._tell(mavlink.MAVLink_command_long_message(self._system_id, 1, command, 0, *padded))

    def _tell(self, message: Message) -> None:
        self._send(self._codec.encode(message))

    def _run(self) -> None:
        next_s, count = time.monotonic(), 0
        while not self._is_closing:
            if time.monotonic() >= next_s:
                next_s += self.sticks_s
                if self.holds_sticks:
                    self._hold_sticks(count)
                count += 1
            try:
                data = self._link.recv(4096)
            except TimeoutError:
                continue
            for frame in self._frames(data):
                if frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1 and self._hears(frame.message_id):
                    try:
                        message = self._codec.decode(frame)
                    except mavlink.MAVError:
                        continue
                    with self._changed:
                        self._system_id = frame.system_id
                        self._take(message)
                        self._changed.notify_all()

    def _hears(self, message_id: int) -> bool:
        return message_id in self.heard_messages or message_id in self._listeners

    def _take(self, message: Message) -> None:
        """Takes what the autopilot said, with the lock held."""
        if (take := self._listeners.get(message.get_msgId())) is not None:
            take(message)
        if isinstance(message, mavlink.MAVLink_heartbeat_message):
            self.is_armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self.mode = message.custom_mode
        elif isinstance(message, mavlink.MAVLink_sys_status_message):
            self.is_ready = bool(message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)
        elif isinstance(message, mavlink.MAVLink_statustext_message):
            self.said = message.text
            if message.severity <= mavlink.MAV_SEVERITY_CRITICAL:
                self.severe.append((time.monotonic(), message.text))
