"""The messages of the mission protocol about one list of one autopilot."""

from __future__ import annotations

from collections.abc import Callable

from ual_daemon.backends.firmwares.mission_items import MissionItem, MissionType
from ual_daemon.backends.mavlink.wire.frames import MessageSource
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink


class MissionSender:
    """Sends messages about one list. `send` sends one; `is_up` says whether the link is up at a time."""

    def __init__(
        self,
        send: Callable[[Message], object],
        is_up: Callable[[float], bool],
        target: MessageSource,
        kind: MissionType,
    ) -> None:
        self.kind = kind
        self.is_up = is_up
        self._send = send
        self._target = target

    def request_list(self) -> None:
        """Asks for the number of its items."""
        self._send(mavlink.MAVLink_mission_request_list_message(*self._target, self.kind))

    def request(self, seq: int) -> None:
        """Asks for an item."""
        self._send(mavlink.MAVLink_mission_request_int_message(*self._target, seq, self.kind))

    def count(self, count: int) -> None:
        """Begins an upload."""
        self._send(mavlink.MAVLink_mission_count_message(*self._target, count, self.kind))

    def item(self, seq: int, item: MissionItem) -> None:
        """Sends an item. Also what requests one with coordinates as floats gets it with integers, which are exact."""
        flags = int(item.is_current), int(item.autocontinue)
        params = item.param1, item.param2, item.param3, item.param4
        position = item.x, item.y, item.z
        self._send(
            mavlink.MAVLink_mission_item_int_message(
                *self._target, seq, item.frame, item.command, *flags, *params, *position, self.kind
            )
        )

    def clear(self) -> None:
        """Has all items removed."""
        self._send(mavlink.MAVLink_mission_clear_all_message(*self._target, self.kind))

    def acknowledge(self, result: int) -> None:
        """Ends a transfer. PX4 lets no other station transfer anything for 5 s without it."""
        self._send(mavlink.MAVLink_mission_ack_message(*self._target, result, self.kind))


def item_of(message: Message) -> MissionItem:
    """Returns the item of a MISSION_ITEM_INT."""
    params = message.param1, message.param2, message.param3, message.param4
    position = message.x, message.y, message.z
    return MissionItem(
        message.frame, message.command, *params, *position, bool(message.autocontinue), bool(message.current)
    )
