"""From datagrams to the one autopilot that we fly: meets it, hears nobody else. No threads, sockets or clock."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Protocol

from ual_daemon.backends.mavlink.autopilots.detection import dialect_of
from ual_daemon.backends.mavlink.links import Address
from ual_daemon.backends.mavlink.session.supervision import Supervision
from ual_daemon.backends.mavlink.session.vehicle import HEARTBEAT_S, MavlinkVehicle, heartbeat
from ual_daemon.backends.mavlink.settings import SECTION, MavlinkSettings
from ual_daemon.backends.mavlink.wire.frames import Frame, FrameReader
from ual_daemon.backends.mavlink.wire.messages import Codec, CorruptFrameError, Message, mavlink
from ual_daemon.backends.mavlink.wire.signing import Signer, Verdict

_log = logging.getLogger(__name__)

_CALLER_SYSTEM_ID = 245
"""Who we are until the autopilot is known, whose system we then join."""
PIECE_S = 0.5
"""What looks like the beginning of a frame and is not completed within this is none."""


class Link(Protocol):
    """What a conversation needs of a link."""

    @property
    def is_stream(self) -> bool: ...

    @property
    def peer(self) -> Address | None: ...

    def answer_to(self, address: Address | None) -> None: ...

    def send(self, data: bytes, *, is_perishable: bool = False) -> bool: ...


class Conversation:
    """Listens until it meets an autopilot. Not thread-safe: belongs to the thread that receives.

    `vehicle` is the autopilot that was met, None until then. With a `signer` only what is signed is believed.
    """

    def __init__(
        self,
        settings: MavlinkSettings,
        link: Link,
        setpoints_s: Callable[[float], float],
        supervision: Supervision,
        signer: Signer | None = None,
    ) -> None:
        self.vehicle: MavlinkVehicle | None = None
        self.supervision = supervision
        self._settings = settings
        self._link = link
        self._setpoints_s = setpoints_s
        self._signer = signer
        self._codec = Codec(settings.component_id, signer)
        self._codec.join(_CALLER_SYSTEM_ID)
        self._sending = threading.Lock()
        self._reader = FrameReader()
        self._waiting_since_s: float | None = None
        self._utc_ahead_s = 0.0
        self._undecodable_count = 0
        self._next_call_s: float | None = None
        self._others: set[int] = set()
        self._told: set[str] = set()

    @property
    def corrupt_count(self) -> int:
        """How often there was something between frames that was none, or a frame that was no message."""
        return self._reader.corrupt_count + self._undecodable_count

    def receive(self, data: bytes, address: Address | None, now_s: float, utc_now_s: float) -> None:
        """Takes what came from an address at `now_s` (backend clock), which is `utc_now_s`.

        It is a datagram, or on a stream any piece of it.
        """
        self._utc_ahead_s = utc_now_s - now_s
        if self._link.is_stream:
            frames = self._reader.feed(data)
            self._waiting_since_s = now_s if self._reader.is_waiting else None
        else:
            frames = self._reader.read(data)
        self._take_all(frames, address, now_s, utc_now_s)

    def reconnected(self) -> None:
        """There is a new other end: what came of the old one is not continued, and what it was asked is forgotten."""
        self._reader.finish()
        if self.vehicle is not None:
            self.vehicle.ask_anew()

    def forget(self) -> None:
        """What was heard says no longer how the vehicle is."""
        if self.vehicle is not None:
            self.vehicle.forget()

    def tick(self, now_s: float) -> None:
        """Does what time asks for; to be called often."""
        if self._waiting_since_s is not None and now_s - self._waiting_since_s > PIECE_S:
            self._waiting_since_s = None
            self._take_all(self._reader.finish(), self._link.peer, now_s, now_s + self._utc_ahead_s)
        self.supervision.tick(now_s)
        if self.vehicle is not None:
            self.vehicle.tick(now_s)
        elif self._link.peer is not None and (self._next_call_s is None or now_s >= self._next_call_s):
            self._next_call_s = now_s + HEARTBEAT_S
            self.transmit(heartbeat())

    def transmit(self, message: Message, *, is_perishable: bool = False) -> bool:
        """Sends a message; false when it could not leave. From any thread."""
        with self._sending:  # what is numbered and signed first must leave first; sending never blocks
            return self._link.send(self._codec.encode(message), is_perishable=is_perishable)

    def _take_all(self, frames: list[Frame], address: Address | None, now_s: float, utc_now_s: float) -> None:
        for frame in frames:
            if frame.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1:
                try:
                    self._take(frame, address, now_s, utc_now_s)
                except CorruptFrameError as error:
                    self._undecodable_count += 1
                    _log.debug("dropped a frame: %s", error)
                except Exception:  # noqa: BLE001 - what the others say is to be heard all the same
                    defect = f"message {frame.message_id} could not be used; this is a defect of UAL, please report it"
                    self._tell_once(defect, logging.ERROR, has_traceback=True)

    def _take(self, frame: Frame, address: Address | None, now_s: float, utc_now_s: float) -> None:
        """Takes a frame of an autopilot, ours or another."""
        vehicle = self.vehicle
        if vehicle is None:
            if self._is_wanted(frame) and self._is_believed(frame, address):
                vehicle = self._meet(frame, address)
            if vehicle is None:
                return
        elif frame.system_id != vehicle.system_id:
            self._note_other(frame)
            return
        elif not self._is_believed(frame, address):
            return
        message = self._codec.decode(frame) if frame.message_id in vehicle.used_ids else None
        self.supervision.heard(frame.sequence, now_s)
        if self._link.peer != address:
            self._link.answer_to(address)
        if message is None:
            vehicle.notice(frame, now_s)
        else:
            vehicle.update(message, now_s, utc_now_s)

    def _is_wanted(self, frame: Frame) -> bool:
        return self._settings.system_id in (None, frame.system_id)

    def _is_believed(self, frame: Frame, address: Address | None) -> bool:
        """Whether its signature is right, where one is needed."""
        if self._signer is None:
            if frame.is_signed:
                self._tell_once(
                    f"system {frame.system_id} signs its messages and may not listen to ours: "
                    f"set {SECTION}.signing_key_file"
                )
            return True
        verdict = self._signer.check(frame)
        if verdict is Verdict.GOOD:
            return True
        self.supervision.unsigned_count += 1
        if verdict is Verdict.OLD and self._link.peer is None:
            # Its clock is behind ours. It goes by the newest timestamp that it hears, so it must hear us.
            self._link.answer_to(address)
        if verdict is not Verdict.REPEATED:  # that is what a message that comes twice, or late, looks like
            self._tell_once(f"messages of system {frame.system_id} are dropped: {verdict.value}")
        return False

    def _note_other(self, frame: Frame) -> None:
        """Says, once for each, that there are more autopilots than ours."""
        vehicle = self.vehicle
        if frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT or vehicle is None or frame.system_id in self._others:
            return
        if self._codec.decode(frame).autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return
        self._others.add(frame.system_id)
        if self._settings.system_id is None:
            _log.warning(
                "more than one autopilot is heard: systems %s; this one flies system %d, the first heard; "
                "choose with %s.system_id",
                ", ".join(map(str, sorted({vehicle.system_id, *self._others}))),
                vehicle.system_id,
                SECTION,
            )

    def _tell_once(self, text: str, level: int = logging.WARNING, *, has_traceback: bool = False) -> None:
        if text not in self._told:
            self._told.add(text)
            _log.log(level, "%s", text, exc_info=has_traceback)

    def _meet(self, frame: Frame, address: Address | None) -> MavlinkVehicle | None:
        """The first autopilot whose heartbeat comes, if it is the one wanted, is ours from now on."""
        if frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return None
        heard = self._codec.decode(frame)
        if heard.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return None
        dialect = dialect_of(heard)
        self._codec.join(frame.system_id)
        own_ids = (frame.system_id, self._codec.component_id)
        self.vehicle = MavlinkVehicle(
            frame.system_id,
            dialect,
            self._settings.pose_rate_hz,
            own_ids,
            self.transmit,
            self._setpoints_s,
            self.supervision,
            learns_feed_forward=self._settings.learns_feed_forward,
        )
        self.supervision.lost_s = dialect.freshness.link_s
        where = "" if address is None else f", at {address[0]}:{address[1]}"
        _log.info("connected to %s, system %d%s", dialect.name, frame.system_id, where)
        return self.vehicle
