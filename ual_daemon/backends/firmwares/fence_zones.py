"""From the items of a fence, as the mission protocol has them, to the zones that they mean."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from ual_daemon.backends.values import Zone

MAX_RADIUS_M = 1e6
"""A circle that is larger is none that anybody can mean."""


class FenceCommand(IntEnum):
    """MAV_CMD of the items of a fence."""

    RETURN_POINT = 5000
    POLYGON_INCLUSION = 5001
    POLYGON_EXCLUSION = 5002
    CIRCLE_INCLUSION = 5003
    CIRCLE_EXCLUSION = 5004


_POLYGONS = (FenceCommand.POLYGON_INCLUSION, FenceCommand.POLYGON_EXCLUSION)
_INCLUSIONS = (FenceCommand.POLYGON_INCLUSION, FenceCommand.CIRCLE_INCLUSION)
_NAMES = {
    FenceCommand.POLYGON_INCLUSION: "inclusion polygon",
    FenceCommand.POLYGON_EXCLUSION: "exclusion polygon",
    FenceCommand.CIRCLE_INCLUSION: "inclusion circle",
    FenceCommand.CIRCLE_EXCLUSION: "exclusion circle",
}
_GLOBAL_FRAMES = frozenset({0, 3, 5, 6, 10, 11})
"""MAV_FRAME whose x and y are latitude and longitude: those that ArduPilot takes
(MissionItemProtocol_Fence::convert_MISSION_ITEM_INT_to_AC_PolyFenceItem). PX4 takes four of them (geofence.cpp)."""


class FenceItem(NamedTuple):
    """An item of a fence: one corner of a polygon, a circle, or the point to return to.

    `size` is the number of the polygon's corners, or the radius of the circle in metres (param1).
    """

    command: int
    frame: int
    size: float
    latitude_deg: float
    longitude_deg: float


class FoundZones(NamedTuple):
    """The zones that were read; None while they were not. `why` says, human-readable, why they cannot be reported."""

    zones: tuple[Zone, ...] | None = None
    why: str = ""


UNREAD = FoundZones()


class MalformedFenceError(Exception):
    """The items make no fence. Says why, human-readable."""


def find_zones(items: Sequence[FenceItem]) -> FoundZones:
    """Returns the zones that the items mean."""
    try:
        return FoundZones(tuple(_zones(items)))
    except MalformedFenceError as error:
        return FoundZones(why=str(error))


def _zones(items: Sequence[FenceItem]) -> list[Zone]:
    found: list[tuple[FenceCommand, Sequence[FenceItem]]] = []
    at = 0
    while at < len(items):
        command = _command(items[at], at)
        count = _corners_count(items, at) if command in _POLYGONS else 1
        if command is not FenceCommand.RETURN_POINT:
            found.append((command, items[at : at + count]))
        at += count
    totals, numbers = Counter(command for command, _ in found), Counter[FenceCommand]()
    zones = []
    for command, parts in found:
        numbers[command] += 1
        name = f"{_NAMES[command]} {numbers[command]} of {totals[command]}"
        points = tuple((each.latitude_deg, each.longitude_deg) for each in parts)
        radius_m = None if command in _POLYGONS else _radius_m(parts[0], name)
        zones.append(Zone(name, command in _INCLUSIONS, points, radius_m))
    return zones


def _command(item: FenceItem, at: int) -> FenceCommand:
    try:
        command = FenceCommand(item.command)
    except ValueError:
        raise MalformedFenceError(f"item {at} is command {item.command}, which is none of a fence") from None
    is_on_earth = abs(item.latitude_deg) <= 90.0 and abs(item.longitude_deg) <= 180.0
    if item.frame not in _GLOBAL_FRAMES or not is_on_earth:
        raise MalformedFenceError(
            f"item {at} has no place on Earth (frame {item.frame}, {item.latitude_deg:.7f}, {item.longitude_deg:.7f})"
        )
    return command


def _corners_count(items: Sequence[FenceItem], at: int) -> int:
    """Returns how many corners the polygon has that begins with an item."""
    first = items[at]
    if not (math.isfinite(first.size) and first.size >= 3.0 and first.size == int(first.size)):
        raise MalformedFenceError(f"item {at} begins a polygon of {first.size:g} corners")
    count = int(first.size)
    corners = items[at : at + count]
    same_count = next((i for i, each in enumerate(corners) if each[:3] != first[:3]), len(corners))
    if same_count < count:
        raise MalformedFenceError(f"the polygon that begins with item {at} has {same_count} of its {count} corners")
    for i, corner in enumerate(corners):
        _command(corner, at + i)
    return count


def _radius_m(circle: FenceItem, name: str) -> float:
    if not 0.0 < circle.size <= MAX_RADIUS_M:  # NaN is neither
        raise MalformedFenceError(f"{name} has a radius of {circle.size:g} m")
    return circle.size
