"""From received bytes to the checked and decoded messages of one autopilot."""

from __future__ import annotations

import logging
import math
from collections.abc import Set as AbstractSet
from typing import Protocol, TypeAlias

from ual_daemon.backends.mavlink.links import Address, MessageTransport
from ual_daemon.backends.mavlink.wire import checksum
from ual_daemon.backends.mavlink.wire.frames import HEADER_BYTES, FrameReader, MavlinkFrame, MessageSource
from ual_daemon.backends.mavlink.wire.kinds import MessageKind
from ual_daemon.backends.mavlink.wire.messages import Codec, Message, mavlink
from ual_daemon.backends.mavlink.wire.signing import KEY_MISSING, SignatureVerdict, Signer
from ual_daemon.backends.mavlink.wire.untaken import Untaken

_log = logging.getLogger(__name__)

PEER_SILENCE_S = 0.5
"""Another host takes our peer's place once that is silent for this long: before the link counts as lost."""
_MOST_LOGGED_TROUBLES = 32
"""Most different troubles that are logged, each once."""
_GARBAGE = "bytes that are no MAVLink (another baud rate or protocol?)"
INCOMPLETE_FRAME_S = 0.5
"""Seconds after which bytes that begin like a frame and are not completed count as no frame."""


_Route: TypeAlias = tuple[int, bytes, MessageKind | None, int, int]
"""Of the frames with one sender and one message: its id, its checksum's seed, its kind where it is decoded, the system
and the component."""


class MessageHandler(Protocol):
    """Takes the messages of the selected autopilot."""

    @property
    def decoded_ids(self) -> AbstractSet[int]:
        """Ids of the messages that are worth decoding. Where they change it is another set; each frame asks."""

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
        """Takes the content of a checked frame, its number, and where it came from."""

    def on_unused(self, message_id: int, sequence: int, address: Address | None, now_s: float, is_signed: bool) -> None:
        """Takes note of a checked frame whose content is not used: only its arrival counts."""


class Selector(Protocol):
    """Selects the autopilot whose messages are received."""

    def is_wanted(self, source: MessageSource, heartbeat: Message) -> bool:
        """Returns whether the sender of a heartbeat may be selected at all."""

    def on_heartbeat(
        self, source: MessageSource, heartbeat: Message, address: Address | None, now_s: float
    ) -> MessageHandler | None:
        """Takes a wanted heartbeat while none is selected. Returns the handler that selects its sender."""

    def is_stray(self, now_s: float) -> bool:
        """Returns whether the selected one was received once, and then no more: another one may be selected instead."""

    def on_other_heartbeat(
        self, source: MessageSource, heartbeat: Message, address: Address | None, now_s: float
    ) -> None:
        """Takes note of any other heartbeat."""

    def is_successor(self, source: MessageSource, now_s: float) -> bool:
        """Returns whether the sender of another heartbeat is the selected autopilot, with another system id."""

    def is_component_wanted(self, frame: MavlinkFrame) -> bool:
        """Returns whether a frame of another component of the selected autopilot's system is worth decoding."""

    def on_component(self, source: MessageSource, message: Message, now_s: float, utc_now_s: float) -> None:
        """Takes a wanted message of such a component."""


class Receiver:
    """Finds frames, checks their senders and signatures, decodes them, and passes them to the handler.

    Not thread-safe: belongs to the thread that receives. Of all senders, only heartbeats count until the `selector`
    has selected one; then only that one's messages do. With a `signer` only signed messages are accepted. What comes
    and is not taken is noted in `untaken`.

    Without signatures anyone can send as our autopilot. So while the peer is received, frames from another host are
    dropped. A new port of its host is followed at once: its router may have bound it again.
    """

    def __init__(
        self,
        link: MessageTransport,
        codec: Codec,
        selector: Selector,
        signer: Signer | None = None,
    ) -> None:
        self.untaken = Untaken()
        self.unsigned_count = 0
        """Frames dropped for their signature."""
        self.stranger_count = 0
        """Frames of our autopilot's system dropped because another host sent them."""
        self._link = link
        self._is_stream = link.is_stream
        self._codec = codec
        self._selector = selector
        self._source: MessageSource | None = None
        self._signer = signer
        self._is_plain = signer is None and not link.is_stream
        self._handler: MessageHandler | None = None
        self._reader = FrameReader()
        self._routes: dict[bytes, _Route] = {}
        """Routes of the selected autopilot's messages, by the sender and the id in a frame's header."""
        self._routed_ids: AbstractSet[int] = frozenset()
        """Decoded ids by which the routes were made."""
        self._peer_received_s = -math.inf
        self._utc_offset_s = 0.0
        self._logged: set[str] = set()

    @property
    def corrupt_count(self) -> int:
        """Times that bytes between frames belonged to none."""
        return self._reader.corrupt_count

    def receive(self, data: bytes, address: Address | None, now_s: float, utc_now_s: float) -> None:
        """Takes a datagram, or on a stream any piece of it, received from an address.

        `now_s` is the backend's clock, `utc_now_s` the same moment as UTC.
        """
        reader, peer, handler = self._reader, self._link.peer, self._handler
        if handler is not None and self._is_plain and peer is not None and peer == address:
            if handler.decoded_ids is not self._routed_ids:
                self._routes, self._routed_ids = {}, handler.decoded_ids
            route = self._routes.get(data[5:10]) or self._new_route(data)
            if route is not None and reader.is_plain(data, route[1]):  # nearly always
                message_id, _, kind, system_id, component_id = route
                sequence, self._peer_received_s = data[4], now_s
                try:  # as `_on_frame`
                    if kind is None:
                        handler.on_unused(message_id, sequence, address, now_s, False)
                    else:
                        message = kind.read(data[10:-2], (message_id, sequence, system_id, component_id))
                        handler.on_message(message_id, sequence, message, address, now_s, utc_now_s, False)
                except Exception:  # noqa: BLE001 - as in `_on_frames`
                    self._log_defect(message_id)
                return
        self._utc_offset_s = utc_now_s - now_s
        reader.refill(now_s)
        garbage_count = reader.garbage_count
        if self._is_stream:
            frames = reader.feed(data)
        elif peer is None or peer == address or now_s - self._peer_received_s > PEER_SILENCE_S:
            frames = reader.read(data, address)
        else:
            frames = reader.read_beginning(data)
        if frames:
            self._on_frames(frames, address, now_s, utc_now_s, is_from_peer=peer == address)
        elif reader.garbage_count > garbage_count:
            self.untaken.note("garbage", _GARBAGE, now_s)

    def tick(self, now_s: float) -> None:
        """Gives up frames that were begun and not completed in time; to be called often."""
        for source, frames in self._reader.give_up(now_s - INCOMPLETE_FRAME_S):
            address = self._link.peer if source is None else source
            self._on_frames(frames, address, now_s, now_s + self._utc_offset_s)

    def replace_handler(self, handler: MessageHandler) -> None:
        """Passes the messages of the selected autopilot to another handler from now on."""
        self._handler = handler

    def reconnected(self) -> None:
        """Drops the incomplete frame of the old connection, which the new one does not continue."""
        self._reader.forget()

    def _new_route(self, data: bytes) -> _Route | None:
        """Returns how the selected autopilot's frames of the message of this one are taken; None for other frames."""
        message_id, source = int.from_bytes(data[7:10], "little"), self._source
        seed = checksum.seed_of(message_id)
        if len(data) < HEADER_BYTES or source is None or data[5:7] != bytes(source) or seed is None:
            return None
        kind = mavlink.mavlink_map.get(message_id) if message_id in self._routed_ids else None
        route = self._routes[data[5:10]] = (message_id, seed, kind, *source)
        return route

    def _on_frames(
        self,
        frames: list[MavlinkFrame],
        address: Address | None,
        now_s: float,
        utc_now_s: float,
        *,
        is_from_peer: bool = False,
    ) -> None:
        for frame in frames:
            try:
                self._on_frame(frame, address, now_s, utc_now_s, is_from_peer)
            except Exception:  # noqa: BLE001 - a defect that one message triggers must not cost the others
                self._log_defect(frame.message_id)

    def _on_frame(
        self,
        frame: MavlinkFrame,
        address: Address | None,
        now_s: float,
        utc_now_s: float,
        is_from_peer: bool,
    ) -> None:
        handler, source = self._handler, self._source
        if handler is None or source is None:
            handler = self._select(frame, address, now_s)
            if handler is None:
                return
        elif frame.system_id != source.system_id or frame.component_id != source.component_id:
            handler = self._on_other(frame, address, now_s, utc_now_s)
            if handler is None:
                return
        else:
            is_plain = self._signer is None and not frame.is_signed  # nearly always: no call
            if not (is_plain or self._is_accepted(frame, address, now_s)):
                return
            if not is_from_peer and self._is_stranger(frame, address, now_s):
                return
        message_id, _, _, sequence, is_signed, _, _ = frame
        message = self._codec.decode(frame) if message_id in handler.decoded_ids else None
        if not is_from_peer:
            self._link.answer_to(address)
        self._peer_received_s = now_s
        if message is None:
            handler.on_unused(message_id, sequence, address, now_s, is_signed)
        else:
            handler.on_message(message_id, sequence, message, address, now_s, utc_now_s, is_signed)

    def _on_other(
        self, frame: MavlinkFrame, address: Address | None, now_s: float, utc_now_s: float
    ) -> MessageHandler | None:
        """Takes a frame of another than the selected one. Returns its handler where it is selected now."""
        if frame.message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            if self._selector.is_stray(now_s) or self._selector.is_successor(frame.source, now_s):
                return self._select(frame, address, now_s)
            self._selector.on_other_heartbeat(frame.source, self._codec.decode(frame), address, now_s)
        is_of_system = self._source is not None and frame.system_id == self._source.system_id
        if is_of_system and self._selector.is_component_wanted(frame):
            self._on_component(frame, address, now_s, utc_now_s)
        return None

    def _on_component(self, frame: MavlinkFrame, address: Address | None, now_s: float, utc_now_s: float) -> None:
        """Takes a frame of another component of our autopilot's system, once its signature is right."""
        if self._is_accepted(frame, address, now_s):
            self._selector.on_component(frame.source, self._codec.decode(frame), now_s, utc_now_s)

    def _is_stranger(self, frame: MavlinkFrame, address: Address | None, now_s: float) -> bool:
        """Returns whether a frame of our autopilot comes from a host that is not our peer's, while messages of that
        arrive.
        """
        peer = self._link.peer
        if address is None or peer is None or address[0] == peer[0] or self._signer is not None:
            return False
        if now_s - self._peer_received_s > PEER_SILENCE_S:
            return False
        self.stranger_count += 1
        self._log_once(f"frames of system {frame.system_id} from another host than {peer[0]} are dropped")
        return True

    def _select(self, frame: MavlinkFrame, address: Address | None, now_s: float) -> MessageHandler | None:
        """Offers the sender of a heartbeat to the selector, once its signature is right."""
        source = frame.source
        if frame.message_id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            if source not in self.untaken:
                self.untaken.note(source, f"messages of {source_text(source)}, but no heartbeat", now_s, is_minor=True)
            return None
        heartbeat = self._codec.decode(frame)
        if not self._selector.is_wanted(source, heartbeat):
            self._selector.on_other_heartbeat(source, heartbeat, address, now_s)
            return None
        if not self._is_accepted(frame, address, now_s):
            return None
        handler = self._selector.on_heartbeat(source, heartbeat, address, now_s)
        if handler is not None:
            self._handler, self._source, self._routes = handler, source, {}
            self.untaken.forget(source)
        return handler

    def _is_accepted(self, frame: MavlinkFrame, address: Address | None, now_s: float) -> bool:
        """Returns whether its signature is right, where one is required."""
        if self._signer is None:
            if frame.is_signed:
                self._log_once(f"system {frame.system_id} {KEY_MISSING}")
            return True
        verdict = self._signer.check(frame)
        if verdict is SignatureVerdict.GOOD:
            return True
        self.unsigned_count += 1
        if verdict is SignatureVerdict.OLD and self._link.peer is None:
            # Its clock is behind ours. It follows the newest timestamp that it receives, so it must receive ours.
            self._link.answer_to(address)
        if verdict is not SignatureVerdict.REPEATED:  # a message that comes twice, or late, is no reason for a warning
            text = f"messages of system {frame.system_id} are dropped: {verdict.value}"
            self._log_once(text)
            self.untaken.note(("signature", frame.system_id), text, now_s)
        return False

    def _log_defect(self, message_id: int) -> None:
        defect = f"message {message_id} could not be used; this is a defect of UAL, please report it"
        self._log_once(defect, logging.ERROR, has_traceback=True)

    def _log_once(self, text: str, level: int = logging.WARNING, *, has_traceback: bool = False) -> None:
        if text not in self._logged and len(self._logged) < _MOST_LOGGED_TROUBLES:
            self._logged.add(text)
            _log.log(level, "%s", text, exc_info=has_traceback)


def source_text(source: MessageSource) -> str:
    """Returns the sender, human-readable; component 1 is the autopilot's own, and goes without saying."""
    component = "" if source.component_id == mavlink.MAV_COMP_ID_AUTOPILOT1 else f", component {source.component_id}"
    return f"system {source.system_id}{component}"
