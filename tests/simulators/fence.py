"""The polygons and circles of a simulated autopilot's own fence: what it applies."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

from pymavlink.dialects.v20 import all as mavlink

from tests.simulators.mission_store import FENCE, MissionStore
from ual.geometry import Vector3
from ual_daemon.backends.firmwares.mission_items import MissionItem
from ual_daemon.geodesy import Projection

POLYGONS = {
    True: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
}
CIRCLES = {
    True: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    False: mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION,
}


class Item(NamedTuple):
    """An item as the autopilot keeps it: latitude and longitude in 1e-7 degrees."""

    command: int
    size: float
    latitude: int
    longitude: int


class Fence:
    """The zones of what a store of items has as its fence."""

    def __init__(self, store: MissionStore) -> None:
        self.store = store
        self.unites_inclusions = False

    @property
    def is_empty(self) -> bool:
        """Whether it has no zone."""
        return not self.store.lists[FENCE]

    @property
    def items(self) -> list[Item]:
        return [Item(each.command, each.param1, each.x, each.y) for each in self.store.lists[FENCE]]

    @items.setter
    def items(self, items: list[Item]) -> None:
        self.store.keep(FENCE, [MissionItem(0, command, size, x=x, y=y) for command, size, x, y in items])

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
