"""The polygons and circles of a simulated autopilot's own fence: what it keeps, sends and applies."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from ual.geometry import Vector3
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.geodesy import Projection

if TYPE_CHECKING:
    from tests.simulators.autopilot import Sender

POLYGONS = {
    True: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
}
CIRCLES = {
    True: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
}
_FENCE = mavlink.MAV_MISSION_TYPE_FENCE
_IDLE_S = 5.0


class Item(NamedTuple):
    """An item as the autopilot keeps it: latitude and longitude in 1e-7 degrees."""

    command: int
    size: float
    latitude: int
    longitude: int


class FenceStore:
    """Answers to requests for the items. `is_strict`: only one program at a time may read, in order, as with PX4."""

    def __init__(self, *, is_strict: bool) -> None:
        self.items: list[Item] = []
        self.refusal: int | None = None
        """The MAV_MISSION_RESULT with which every request is refused; None: it answers."""
        self.withheld: set[int] = set()
        """The numbers of items that are never sent."""
        self.unites_inclusions = False
        self.downloads_count = 0
        """How often all items were read to the end."""
        self.results: list[int] = []
        """The acknowledgements that came."""
        self._is_strict = is_strict
        self._partner: tuple[int, int] | None = None
        self._next = 0
        self._heard_s = -math.inf

    def handlers(self) -> dict[int, Callable[[Message, Sender, float], Message | None]]:
        """Returns what answers the messages of the mission protocol, each with the time."""
        return {
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: self._on_request_list,
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: self._on_request_int,
            mavlink.MAVLINK_MSG_ID_MISSION_ACK: self._on_ack,
        }

    def _on_request_list(self, message: Message, sender: Sender, now_s: float) -> Message | None:
        partner = sender.system_id, sender.component_id
        if message.mission_type != _FENCE:
            return None
        if self.refusal is not None:
            return mavlink.MAVLink_mission_ack_message(*partner, self.refusal, _FENCE)
        if self._is_strict and self._partner not in (None, partner) and now_s - self._heard_s < _IDLE_S:
            return None  # busy
        self._partner, self._next, self._heard_s = partner, 0, now_s
        return mavlink.MAVLink_mission_count_message(*partner, len(self.items), _FENCE)

    def _on_request_int(self, message: Message, sender: Sender, now_s: float) -> Message | None:
        partner = sender.system_id, sender.component_id
        if message.mission_type != _FENCE:
            return None
        if self._is_strict:
            if self._partner != partner or now_s - self._heard_s > _IDLE_S:
                return None
            if message.seq not in (self._next, self._next - 1):
                self._partner = None
                return mavlink.MAVLink_mission_ack_message(*partner, mavlink.MAV_MISSION_ERROR, _FENCE)
            self._next, self._heard_s = message.seq + 1, now_s
        if message.seq >= len(self.items):
            return mavlink.MAVLink_mission_ack_message(*partner, mavlink.MAV_MISSION_INVALID_SEQUENCE, _FENCE)
        if message.seq in self.withheld:
            return None
        item = self.items[message.seq]
        return mavlink.MAVLink_mission_item_int_message(
            *partner,
            message.seq,
            mavlink.MAV_FRAME_GLOBAL,
            item.command,
            0,
            1,
            item.size,
            0.0,
            0.0,
            0.0,
            item.latitude,
            item.longitude,
            0.0,
            _FENCE,
        )

    def _on_ack(self, message: Message, sender: Sender, now_s: float) -> Message | None:
        if message.mission_type == _FENCE:
            self.results.append(message.type)
            self.downloads_count += message.type == mavlink.MAV_MISSION_ACCEPTED
            self._partner = None
        return None

    def is_beyond(self, latitude: int, longitude: int, projection: Projection) -> bool:
        """Returns whether a place (1e-7 degrees) is outside an inclusion, or in an exclusion."""
        inclusions: list[bool] = []
        exclusions: list[bool] = []
        at = 0
        while at < len(self.items):
            item = self.items[at]
            if item.command in CIRCLES.values():
                is_in, count = _is_in_circle(item, latitude, longitude, projection), 1
            else:
                count = int(item.size)
                is_in = _is_in_polygon(self.items[at : at + count], latitude, longitude)
            is_inclusion = item.command in (POLYGONS[True], CIRCLES[True])
            (inclusions if is_inclusion else exclusions).append(is_in)
            at += count
        is_let_in = (any(inclusions) or not inclusions) if self.unites_inclusions else all(inclusions)
        return any(exclusions) or not is_let_in


def _is_in_polygon(corners: list[Item], latitude: int, longitude: int) -> bool:
    """Counts the sides to the north, as PX4's Geofence::insidePolygon."""
    is_in = False
    for a, b in zip(corners, [*corners[-1:], *corners[:-1]], strict=True):
        if (a.longitude >= longitude) != (b.longitude >= longitude):
            share = (longitude - a.longitude) / (b.longitude - a.longitude)
            if latitude <= a.latitude + (b.latitude - a.latitude) * share:
                is_in = not is_in
    return is_in


def _is_in_circle(circle: Item, latitude: int, longitude: int, projection: Projection) -> bool:
    around = dataclasses.replace(
        projection, latitude_deg=circle.latitude / 1e7, longitude_deg=circle.longitude / 1e7, altitude_amsl_m=0.0
    )
    away: Vector3 = around.to_local(latitude / 1e7, longitude / 1e7, 0.0)
    return away.norm() < circle.size
