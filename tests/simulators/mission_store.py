"""The mission, the fence and the rally points of a simulated autopilot, and its side of the mission protocol."""

from __future__ import annotations

import math
import struct
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.channel import Channel, RawMessage
from ual_daemon.backends.firmwares.mission_items import MissionItem
from ual_daemon.backends.mavlink.wire.messages import Message

MISSION: int = mavlink.MAV_MISSION_TYPE_MISSION
FENCE: int = mavlink.MAV_MISSION_TYPE_FENCE
RALLY: int = mavlink.MAV_MISSION_TYPE_RALLY
ACCEPTED: int = mavlink.MAV_MISSION_ACCEPTED
ERROR: int = mavlink.MAV_MISSION_ERROR
DENIED: int = mavlink.MAV_MISSION_DENIED
UNSUPPORTED: int = mavlink.MAV_MISSION_UNSUPPORTED
UNSUPPORTED_FRAME: int = mavlink.MAV_MISSION_UNSUPPORTED_FRAME
INVALID_PARAM1: int = mavlink.MAV_MISSION_INVALID_PARAM1
_FENCE_COMMANDS = range(5000, 5005)
_POLYGONS = (5001, 5002)
_RALLY_POINT = 5100
_COPTERS_COMMANDS = frozenset(
    {
        16,
        17,
        18,
        19,
        20,
        21,
        22,
        82,
        92,
        93,
        112,
        115,
        177,
        178,
        179,
        183,
        195,
        197,
        201,
        203,
        205,
        206,
        211,
        2000,
        2001,
    }
)
"""Commands that ArduCopter takes into a mission (AP_Mission::mavlink_int_to_mission_cmd), as far as tests send them."""


@dataclass(frozen=True, slots=True)
class Sender:
    """The sender of a message, and the link that it came from."""

    channel: Channel
    system_id: int
    component_id: int

    @property
    def ids(self) -> tuple[int, int]:
        return self.system_id, self.component_id


def raw(kind: Any, *fields: tuple[str, int]) -> Message:
    """Returns a message with these fields as bytes, each with its code of `struct`: pymavlink lacks the last ones."""
    codes, values = zip(*fields, strict=True)
    return RawMessage(kind.id, struct.pack(f"<{''.join(codes)}", *values), kind.crc_extra)


class MissionStore(ABC):
    """Keeps the lists, and answers. Calls `on_fence` after a change of the fence."""

    most: Mapping[int, int]
    """Most items of each list."""

    def __init__(self, on_fence: Callable[[], None]) -> None:
        self._on_fence = on_fence
        self.on_mission: Callable[[], None] = lambda: None
        """Called after a change of the mission."""
        self.lists: dict[int, list[MissionItem]] = {MISSION: [], FENCE: [], RALLY: []}
        self.refusal: int | None = None
        """The MAV_MISSION_RESULT with which every request is refused; None: it answers."""
        self.withheld: set[int] = set()
        """The numbers of items that are never sent."""
        self.downloads_count = 0
        """Reads of all items to the end."""
        self.uploads_count = 0
        """Changes of a list."""
        self.on_taken: Callable[[int, int], None] = lambda _kind, _seq: None
        """Called with the list and the number of each item that was taken from an upload."""

    def keep(self, kind: int, items: Sequence[MissionItem]) -> None:
        """Keeps another list."""
        self.lists[kind] = list(items)
        if kind == FENCE:
            self._on_fence()
        elif kind == MISSION:
            self.on_mission()

    def handlers(self) -> dict[int, Callable[[Message, Sender, float], None]]:
        """Returns what answers the messages of the mission protocol, each with the time."""
        return {
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: self._refusing(self._on_request_list),
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: self._refusing(self._on_request),
            mavlink.MAVLINK_MSG_ID_MISSION_COUNT: self._refusing(self._on_count),
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: self._refusing(self._on_item),
            mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: self._refusing(self._on_clear),
            mavlink.MAVLINK_MSG_ID_MISSION_ACK: self._on_ack,
        }

    def _refusing(self, act: Callable[[Message, Sender, float], None]) -> Callable[[Message, Sender, float], None]:
        def on_message(message: Message, sender: Sender, now_s: float) -> None:
            if self.refusal is None:
                act(message, sender, now_s)
            else:
                self._acknowledge(sender, self.refusal, message.mission_type, now_s)

        return on_message

    @abstractmethod
    def boot(self, now_s: float) -> None:
        """Forgets the transfer that is under way: it has rebooted. The lists are kept, as far as they were written."""

    @abstractmethod
    def tick(self, now_s: float) -> None:
        """Asks again, and ends what takes too long."""

    @abstractmethod
    def _on_request_list(self, message: Message, sender: Sender, now_s: float) -> None: ...

    @abstractmethod
    def _on_request(self, message: Message, sender: Sender, now_s: float) -> None: ...

    @abstractmethod
    def _on_count(self, message: Message, sender: Sender, now_s: float) -> None: ...

    @abstractmethod
    def _on_item(self, message: Message, sender: Sender, now_s: float) -> None: ...

    @abstractmethod
    def _on_clear(self, message: Message, sender: Sender, now_s: float) -> None: ...

    @abstractmethod
    def _on_ack(self, message: Message, sender: Sender, now_s: float) -> None: ...

    def _acknowledge(self, sender: Sender, result: int, kind: int, now_s: float, opaque_id: int = 0) -> None:
        fields = ("B", sender.system_id), ("B", sender.component_id), ("B", result), ("B", kind), ("I", opaque_id)
        sender.channel.send(raw(mavlink.MAVLink_mission_ack_message, *fields), now_s)

    def _send_item(self, seq: int, kind: int, sender: Sender, now_s: float) -> None:
        if seq in self.withheld:
            return
        item = self.lists[kind][seq]
        params = item.param1, item.param2, item.param3, item.param4
        place = item.x, item.y, item.z
        sender.channel.send(
            mavlink.MAVLink_mission_item_int_message(
                *sender.ids, seq, item.frame, item.command, int(item.is_current), int(item.autocontinue),
                *params, *place, kind,
            ),
            now_s,
        )  # fmt: skip


def _item(message: Message) -> MissionItem:
    params = message.param1, message.param2, message.param3, message.param4
    return MissionItem(message.frame, message.command, *params, message.x, message.y, message.z)


class Px4Store(MissionStore):
    """As PX4's mavlink_mission.cpp: one transfer at a time, in order, and ended by 5 s of silence."""

    most = MappingProxyType({MISSION: 500, FENCE: 64, RALLY: 32})
    retry_s, silence_s = 0.25, 5.0

    def __init__(self, on_fence: Callable[[], None]) -> None:
        super().__init__(on_fence)
        self.opaque_ids: dict[int, int] = dict.fromkeys(self.lists, 0)
        self._state = "idle"
        self._partner: Sender | None = None
        self._kind = MISSION
        self._seq = self._count = 0
        self._incoming: list[MissionItem] = []
        self._crc = 0
        self._sent_s = self._heard_s = -math.inf

    def keep(self, kind: int, items: Sequence[MissionItem]) -> None:
        crc = 0
        for item in items:
            crc = _checksum(item, crc)
        self.opaque_ids[kind] = crc
        super().keep(kind, items)

    @property
    def is_idle(self) -> bool:
        """Whether it has no transfer, so that any station may begin one."""
        return self._state == "idle"

    def current(self, seq: int = 0, state: int = 1) -> Message:
        """Returns the MISSION_CURRENT."""
        ids = [("I", self.opaque_ids[kind]) for kind in (MISSION, FENCE, RALLY)]
        total = len(self.lists[MISSION]) or 0xFFFF
        return raw(mavlink.MAVLink_mission_current_message, ("H", seq), ("H", total), ("B", state), ("B", 2), *ids)

    def boot(self, now_s: float) -> None:
        self._state, self._partner, self._seq = "idle", None, 0

    def tick(self, now_s: float) -> None:
        if self._state == "getting" and now_s - self._sent_s > self.retry_s:
            self._request(now_s)
        if self._state != "idle" and now_s - self._heard_s > self.silence_s:
            self._state = "idle"

    def _on_request_list(self, message: Message, sender: Sender, now_s: float) -> None:
        if self._seq == len(self.lists[self._kind]):
            self._state = "idle"
        is_same = self._is_partner(sender) and self._kind == message.mission_type
        if self._state != "idle" and not (self._state == "sending" and is_same):
            return  # busy: it says so only by a text
        self._state, self._kind, self._heard_s = "sending", message.mission_type, now_s
        self._seq, self._count, self._partner = 0, len(self.lists[self._kind]), sender
        ids = ("B", sender.system_id), ("B", sender.component_id), ("B", self._kind)
        fields = ("H", self._count), *ids, ("I", self.opaque_ids[self._kind])
        sender.channel.send(raw(mavlink.MAVLink_mission_count_message, *fields), now_s)

    def _on_request(self, message: Message, sender: Sender, now_s: float) -> None:
        if not self._is_partner(sender) or self._state != "sending" or message.mission_type != self._kind:
            return
        self._heard_s = now_s
        if message.seq == self._seq and self._seq < self._count:
            self._seq += 1
        elif message.seq != self._seq - 1:
            self._state = "idle"
            self._acknowledge(sender, ERROR, self._kind, now_s)
            return
        if message.seq < len(self.lists[self._kind]):
            self._send_item(message.seq, self._kind, sender, now_s)
        else:
            self._state = "idle"
            self._acknowledge(sender, ERROR, self._kind, now_s)

    def _on_count(self, message: Message, sender: Sender, now_s: float) -> None:
        if self._state == "sending" or (self._state == "getting" and not (self._is_partner(sender) and not self._seq)):
            self._acknowledge(sender, ERROR, self._kind, now_s)
            return
        self._heard_s = now_s
        if self._state == "idle":
            self._partner, self._kind, self._crc = sender, message.mission_type, 0
            if message.count > self.most[self._kind]:
                self._acknowledge(sender, mavlink.MAV_MISSION_NO_SPACE, self._kind, now_s)
                return
            if message.count == 0:
                self._change([])
                self._acknowledge(sender, ACCEPTED, self._kind, now_s)
                return
            self._state, self._seq, self._count, self._incoming = "getting", 0, message.count, []
        self._request(now_s)

    def _on_item(self, message: Message, sender: Sender, now_s: float) -> None:
        if not self._is_partner(sender):
            return
        if message.mission_type != self._kind or self._state == "sending":
            self._acknowledge(sender, ERROR, self._kind, now_s)
        elif self._state == "idle":
            is_again = self._seq == message.seq + 1
            self._acknowledge(sender, ACCEPTED if is_again else ERROR, self._kind, now_s, self._crc if is_again else 0)
        else:
            self._heard_s = now_s
            if message.seq == self._seq:
                self._take(_item(message), sender, now_s)

    def _take(self, item: MissionItem, sender: Sender, now_s: float) -> None:
        result = self._judge(item)
        if result != ACCEPTED:
            self._state = "idle"
            self._acknowledge(sender, result, self._kind, now_s)
            return
        self._crc = _checksum(item, self._crc)
        self._incoming.append(item)
        self._seq += 1
        self.on_taken(self._kind, self._seq - 1)
        if self._state == "idle":  # it has rebooted
            return
        if self._seq < self._count:
            self._request(now_s)
            return
        self._state = "idle"
        self._change([_as_px4_keeps(each, self._kind) for each in self._incoming])
        self.opaque_ids[self._kind] = self._crc
        self._acknowledge(sender, ACCEPTED, self._kind, now_s, self._crc)

    def _judge(self, item: MissionItem) -> int:
        """As parse_mavlink_mission_item, for what the tests send."""
        if item.frame not in (0, 2, 3, 5, 6):
            return UNSUPPORTED_FRAME
        is_of_fence = item.command in _FENCE_COMMANDS
        if self._kind == FENCE and not is_of_fence and item.command != 16:
            return UNSUPPORTED
        is_too_small = item.command in _POLYGONS and item.param1 < 3
        is_wrong = self._kind == MISSION and (is_of_fence or item.command == _RALLY_POINT)
        return ERROR if is_too_small or is_wrong else ACCEPTED

    def _on_clear(self, message: Message, sender: Sender, now_s: float) -> None:
        if self._state != "idle":
            return  # busy: it says so only by a text
        self._heard_s, self._kind = now_s, message.mission_type
        self._change([])
        self._acknowledge(sender, ACCEPTED, self._kind, now_s)

    def _on_ack(self, message: Message, sender: Sender, now_s: float) -> None:
        if not self._is_partner(sender):
            return
        if self._state == "sending" and message.mission_type == self._kind:
            self.downloads_count += message.type == ACCEPTED and self._seq == len(self.lists[self._kind])
            self._state = "idle"
        elif self._state == "getting" and message.type == mavlink.MAV_MISSION_OPERATION_CANCELLED:
            self._state = "idle"

    def _is_partner(self, sender: Sender) -> bool:
        return self._partner is not None and sender.ids == self._partner.ids

    def _request(self, now_s: float) -> None:
        assert self._partner is not None
        self._sent_s = now_s
        request = mavlink.MAVLink_mission_request_int_message(*self._partner.ids, self._seq, self._kind)
        self._partner.channel.send(request, now_s)

    def _change(self, items: Sequence[MissionItem]) -> None:
        self.uploads_count += 1
        self.keep(self._kind, items)


def _checksum(item: MissionItem, before: int) -> int:
    packed = struct.pack("<BH4fiif", *item[:2], *item[2:6], *item[6:9])
    return zlib.crc32(packed, before)


def _as_px4_keeps(item: MissionItem, kind: int) -> MissionItem:
    """Returns what PX4 gives back: the frame with integers, no parameters but those that it has taken."""
    if kind == FENCE:
        return MissionItem(5, item.command, item.param1, x=item.x, y=item.y, z=item.z, autocontinue=False)
    return item._replace(frame={0: 5, 3: 6}.get(item.frame, item.frame))


class ArduPilotStore(MissionStore):
    """As ArduPilot's MissionItemProtocol: no order of a download, an upload ended by 8 s of silence."""

    most = MappingProxyType({MISSION: 700, FENCE: 84, RALLY: 5})
    retry_s, silence_s = 1.0, 8.0
    opens_s = 3.5
    """After a boot it has room for nothing for so long, as its storage is not open yet."""

    def __init__(self, on_fence: Callable[[], None]) -> None:
        super().__init__(on_fence)
        self._partner: Sender | None = None
        """Sender from which it receives a list; None while it receives none."""
        self._kind = MISSION
        self._seq = self._count = 0
        self._incoming: list[MissionItem] = []
        self._sent_s = self._heard_s = self._opened_s = -math.inf

    def boot(self, now_s: float) -> None:
        self._partner, self._opened_s = None, now_s + self.opens_s

    def tick(self, now_s: float) -> None:
        partner = self._partner
        if partner is None:
            return
        if now_s - self._heard_s > self.silence_s:
            self._partner = None
            self._acknowledge(partner, mavlink.MAV_MISSION_OPERATION_CANCELLED, self._kind, now_s)
        elif now_s - self._sent_s > self.retry_s:
            self._request(partner, now_s)

    def _on_request_list(self, message: Message, sender: Sender, now_s: float) -> None:
        kind = message.mission_type
        if self._is_receiving(kind):
            self._acknowledge(sender, DENIED, kind, now_s)
            return
        count = mavlink.MAVLink_mission_count_message(*sender.ids, len(self.lists[kind]), kind)
        sender.channel.send(count, now_s)

    def _on_request(self, message: Message, sender: Sender, now_s: float) -> None:
        kind = message.mission_type
        if self._is_receiving(kind):
            self._acknowledge(sender, DENIED, kind, now_s)
        elif message.seq < len(self.lists[kind]):
            self._send_item(message.seq, kind, sender, now_s)
        else:
            self._acknowledge(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind, now_s)

    def _on_count(self, message: Message, sender: Sender, now_s: float) -> None:
        kind = message.mission_type
        if not self._cancel(kind, sender, now_s):
            return
        if message.count > self.most[kind] or now_s < self._opened_s:
            self._acknowledge(sender, mavlink.MAV_MISSION_NO_SPACE, kind, now_s)
            return
        if kind != FENCE:
            del self.lists[kind][message.count :]
        if message.count == 0:
            self._change(kind, [])
            self._acknowledge(sender, ACCEPTED, kind, now_s)
            return
        self._partner, self._kind, self._seq, self._count = sender, kind, 0, message.count
        self._incoming, self._heard_s = [], now_s
        self._request(sender, now_s)

    def _on_item(self, message: Message, sender: Sender, now_s: float) -> None:
        kind = message.mission_type
        if not self._is_receiving(kind):
            self._acknowledge(sender, ERROR, kind, now_s)
            return
        if message.seq != self._seq:
            self._acknowledge(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind, now_s)
            return
        if self._partner is None or self._partner.ids != sender.ids:
            self._acknowledge(sender, DENIED, kind, now_s)
            return
        item = _item(message)
        result = self._judge(item)
        if result != ACCEPTED:
            self._partner = None
            self._acknowledge(sender, result, kind, now_s)
            return
        self._keep_one(item)
        self._heard_s = now_s
        self._seq += 1
        self.on_taken(kind, self._seq - 1)
        if not self._is_receiving(kind):  # it has rebooted
            return
        if self._seq < self._count:
            self._request(sender, now_s)
            return
        self._partner = None
        self._acknowledge(sender, self._complete(kind), kind, now_s)

    def _keep_one(self, item: MissionItem) -> None:
        """A fence is kept once it is whole, each other item at once."""
        if self._kind == FENCE:
            self._incoming.append(item._replace(frame=0, z=0.0))
        else:
            kept = item._replace(frame={5: 0, 6: 3}.get(item.frame, item.frame))
            if self._kind == RALLY:
                kept = kept._replace(z=float(int(kept.z)))
            self.lists[self._kind][self._seq : self._seq + 1] = [kept]

    def _complete(self, kind: int) -> int:
        if kind != FENCE:
            self.uploads_count += 1
            if kind == MISSION:
                self.on_mission()
            return ACCEPTED
        if not _is_whole(self._incoming):
            return ERROR
        self._change(kind, self._incoming)
        return ACCEPTED

    def _judge(self, item: MissionItem) -> int:
        if self._kind == MISSION:
            return ACCEPTED if item.command in _COPTERS_COMMANDS else UNSUPPORTED
        if item.frame not in (0, 3, 5, 6, 10, 11):
            return UNSUPPORTED_FRAME
        known = _FENCE_COMMANDS if self._kind == FENCE else (_RALLY_POINT,)
        if item.command not in known:
            return UNSUPPORTED
        if item.command in _POLYGONS and item.param1 > 255:
            return INVALID_PARAM1
        return ACCEPTED

    def _on_clear(self, message: Message, sender: Sender, now_s: float) -> None:
        kind = message.mission_type
        if self._cancel(kind, sender, now_s):
            self._change(kind, [])
            self._acknowledge(sender, ACCEPTED, kind, now_s)

    def _on_ack(self, message: Message, sender: Sender, now_s: float) -> None:
        self.downloads_count += message.type == ACCEPTED

    def _is_receiving(self, kind: int) -> bool:
        return self._partner is not None and self._kind == kind

    def _cancel(self, kind: int, sender: Sender, now_s: float) -> bool:
        """Ends an upload of the same sender. Returns whether there is none of another one."""
        if self._is_receiving(kind):
            assert self._partner is not None
            if self._partner.ids != sender.ids:
                self._acknowledge(sender, DENIED, kind, now_s)
                return False
            self._partner = None
        return True

    def _request(self, sender: Sender, now_s: float) -> None:
        self._sent_s = now_s
        sender.channel.send(mavlink.MAVLink_mission_request_message(*sender.ids, self._seq, self._kind), now_s)

    def _change(self, kind: int, items: Sequence[MissionItem]) -> None:
        self.uploads_count += 1
        self.keep(kind, items)


def _is_whole(items: Sequence[MissionItem]) -> bool:
    """Returns whether each polygon has its corners."""
    at = 0
    while at < len(items):
        count = int(items[at].param1) if items[at].command in _POLYGONS else 1
        corners = items[at : at + count]
        if not 1 <= count == len(corners) or any(each.command != items[at].command for each in corners):
            return False
        at += count
    return True
