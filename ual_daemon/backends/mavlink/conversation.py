"""From datagrams to the one autopilot that we fly: meets it, hears nobody else. No threads, sockets or clock."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Protocol

from ual_daemon.backends.mavlink.autopilots import dialect_of
from ual_daemon.backends.mavlink.frames import Frame, split
from ual_daemon.backends.mavlink.link import Address
from ual_daemon.backends.mavlink.messages import Codec, CorruptFrameError, Message, mavlink
from ual_daemon.backends.mavlink.settings import MavlinkSettings
from ual_daemon.backends.mavlink.vehicle import HEARTBEAT_S, MavlinkVehicle, heartbeat

_log = logging.getLogger(__name__)

_CALLER_SYSTEM_ID = 245
"""Who we are until the autopilot is known, whose system we then join."""


class Link(Protocol):
    """What a conversation needs of a link."""

    @property
    def peer(self) -> Address | None: ...

    def answer_to(self, address: Address) -> None: ...

    def send(self, data: bytes) -> bool: ...


class Conversation:
    """Listens until it meets an autopilot. Not thread-safe: belongs to the thread that receives.

    `vehicle` is the autopilot that was met, None until then; `corrupt_count` counts bytes and frames that were no
    messages.
    """

    def __init__(self, settings: MavlinkSettings, link: Link, setpoints_s: Callable[[float], float]) -> None:
        self.vehicle: MavlinkVehicle | None = None
        self.corrupt_count = 0
        self._settings = settings
        self._link = link
        self._setpoints_s = setpoints_s
        self._codec = Codec(settings.component_id)
        self._codec.join(_CALLER_SYSTEM_ID)
        self._next_call_s: float | None = None

    def receive(self, datagram: bytes, address: Address, now_s: float, utc_now_s: float) -> None:
        """Takes what came from an address at `now_s` (backend clock), which is `utc_now_s`."""
        frames, garbage_count = split(datagram)
        self.corrupt_count += garbage_count
        for frame in frames:
            if frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1:
                self._take(frame, address, now_s, utc_now_s)

    def forget(self) -> None:
        """What was heard says no longer how the vehicle is."""
        if self.vehicle is not None:
            self.vehicle.forget()

    def tick(self, now_s: float) -> None:
        """Does what time asks for; to be called often."""
        if self.vehicle is not None:
            self.vehicle.tick(now_s)
        elif self._link.peer is not None and (self._next_call_s is None or now_s >= self._next_call_s):
            self._next_call_s = now_s + HEARTBEAT_S
            self.transmit(heartbeat())

    def transmit(self, message: Message) -> bool:
        """Sends a message; false when it could not leave. From any thread."""
        return self._link.send(self._codec.encode(message))

    def _take(self, frame: Frame, address: Address, now_s: float, utc_now_s: float) -> None:
        """Takes a frame of an autopilot, ours or another."""
        vehicle = self.vehicle
        try:
            if vehicle is None:
                vehicle = self._meet(frame, address)
            if vehicle is not None and frame.system_id == vehicle.system_id:
                self._listen(vehicle, frame, address, now_s, utc_now_s)
        except CorruptFrameError as error:
            self.corrupt_count += 1
            _log.debug("dropped a frame: %s", error)

    def _listen(self, vehicle: MavlinkVehicle, frame: Frame, address: Address, now_s: float, utc_now_s: float) -> None:
        if not vehicle.uses(frame.message_id):
            vehicle.notice(frame.message_id, now_s)
            return
        vehicle.update(self._codec.decode(frame), now_s, utc_now_s)
        if self._link.peer != address:  # only what was decoded, so checked, says where it is
            self._link.answer_to(address)

    def _meet(self, frame: Frame, address: Address) -> MavlinkVehicle | None:
        """The first autopilot whose heartbeat comes, if it is the one wanted, is ours from now on."""
        is_wanted = self._settings.system_id in (None, frame.system_id)
        if not is_wanted or frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return None
        heard = self._codec.decode(frame)
        if heard.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return None
        dialect = dialect_of(heard)
        self._codec.join(frame.system_id)
        own_ids = (frame.system_id, self._codec.component_id)
        self.vehicle = MavlinkVehicle(
            frame.system_id, dialect, self._settings.pose_rate_hz, own_ids, self.transmit, self._setpoints_s
        )
        _log.info("connected to %s, system %d, at %s:%d", dialect.name, frame.system_id, address[0], address[1])
        return self.vehicle
