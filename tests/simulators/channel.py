"""One link of an autopilot: which messages are streamed on it, how often, and the listeners."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.codec import AutopilotCodec
from tests.simulators.ports import Port
from ual_daemon.backends.mavlink.wire.frames import FrameReader, MavlinkFrame
from ual_daemon.backends.mavlink.wire.messages import Message

_GROUND_STATION_S = 5.0


class Channel:
    """`rates_hz` are the rates of messages that are sent unrequested, by id. With `forwards`, others' messages are
    forwarded. `most_hz` has the messages that are streamed less often than is asked for.
    """

    def __init__(
        self,
        port: Port,
        rates_hz: Mapping[int, float],
        *,
        forwards: bool = False,
        most_hz: Mapping[int, float] | None = None,
    ) -> None:
        self.port = port
        self.slowdown = 1.0
        """By how much all streams come less often than was asked for."""
        self.forwards = forwards
        self._rates_hz = dict(rates_hz)
        self._least_s = {message_id: 1.0 / rate_hz for message_id, rate_hz in (most_hz or {}).items()}
        self._session = port.sessions_count
        self.boot(1, 0.0)

    def boot(self, system_id: int, now_s: float, component_id: int = mavlink.MAV_COMP_ID_AUTOPILOT1) -> None:
        """Resets it to the state after booting."""
        self._codec = AutopilotCodec(component_id)
        self._codec.join(system_id)
        self._reader = FrameReader()
        self._ground_station_s = -math.inf
        self.intervals_s = {message_id: 1.0 / rate_hz for message_id, rate_hz in self._rates_hz.items()}
        self._due_s = dict.fromkeys(self.intervals_s, now_s)
        self._next_s = now_s
        self.is_active = False
        """Whether anybody has requested anything on this link."""

    def become(self, system_id: int) -> None:
        """Sends as another system from now on."""
        self._codec.join(system_id)

    def receive(self, now_s: float) -> list[tuple[MavlinkFrame, Message]]:
        """Returns the messages that have come, from any sender."""
        found = []
        for data in self.port.receive(now_s):
            if self.port.sessions_count != self._session:
                self._session = self.port.sessions_count
                self._reader = FrameReader()
            frames = self._reader.feed(data) if self.port.is_stream else self._reader.read(data)
            for frame in frames:
                try:
                    message = self._codec.decode(frame)
                except mavlink.MAVError:
                    continue
                if frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and message.type == mavlink.MAV_TYPE_GCS:
                    self._ground_station_s = now_s
                found.append((frame, message))
        return found

    def has_ground_station(self, now_s: float) -> bool:
        """Returns whether a ground station's heartbeat comes on this link."""
        return now_s - self._ground_station_s <= _GROUND_STATION_S

    def send(self, message: Message, now_s: float) -> None:
        """Sends a message of the autopilot."""
        self.port.send(self._codec.encode(message), now_s)

    def send_raw(self, message_id: int, payload: bytes, crc_extra: int, now_s: float) -> None:
        """Sends a message that pymavlink does not know."""
        self.port.send(self._codec.encode(RawMessage(message_id, payload, crc_extra)), now_s)

    def stream(self, message_id: int, interval_s: float | None, now_s: float) -> None:
        """Sets the interval of a message; None: stops it; 0: the default rate."""
        self.is_active = True
        if interval_s == 0.0:
            interval_s = 1.0 / self._rates_hz[message_id] if message_id in self._rates_hz else None
        if interval_s is None:
            self.intervals_s.pop(message_id, None)
            self._due_s.pop(message_id, None)
        else:
            self.intervals_s[message_id] = max(interval_s, self._least_s.get(message_id, 0.0))
            self._due_s[message_id] = now_s
            self._next_s = min(self._next_s, now_s)

    def due(self, now_s: float, step_s: float) -> list[int]:
        """Returns the ids of the messages that are due, one several times that comes more often than each `step_s`."""
        if now_s < self._next_s - 1e-9:
            return []
        found = [message_id for message_id, due_s in self._due_s.items() if now_s >= due_s - 1e-9]
        for message_id in found.copy():
            interval_s = self.intervals_s[message_id] * self.slowdown
            next_s = self._due_s[message_id] + interval_s
            while interval_s < step_s and next_s <= now_s + 1e-9:
                found.append(message_id)
                next_s += interval_s
            self._due_s[message_id] = max(next_s, now_s - interval_s)
        self._next_s = min(self._due_s.values(), default=math.inf)
        return found


class RawMessage(mavlink.MAVLink_message):  # type: ignore[misc]
    """A message as bytes: one that pymavlink does not know, or with fields that it does not know."""

    def __init__(self, message_id: int, payload: bytes, crc_extra: int) -> None:
        super().__init__(message_id, f"RAW_{message_id}")
        self._bytes, self._crc_extra = payload, crc_extra

    def pack(self, mav: object, force_mavlink1: bool = False) -> bytes:
        packed: bytes = self._pack(mav, self._crc_extra, self._bytes, force_mavlink1=force_mavlink1)
        return packed
