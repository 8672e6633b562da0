"""Between the zones and rally points of the contract and the items that an autopilot keeps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ual.errors import RejectedByAutopilotError
from ual.fences.values import FenceZone, RallyPoint
from ual.types import AltitudeReference
from ual_daemon.backends.firmwares.fence_zones import FenceCommand, FenceItem, FoundZones, find_zones
from ual_daemon.backends.firmwares.mission_items import MissionItem

_POLYGONS = {True: FenceCommand.POLYGON_INCLUSION, False: FenceCommand.POLYGON_EXCLUSION}
_CIRCLES = {True: FenceCommand.CIRCLE_INCLUSION, False: FenceCommand.CIRCLE_EXCLUSION}
_RALLY_POINT_COMMAND = 5100
_FRAMES = {AltitudeReference.AMSL: 0, AltitudeReference.HOME: 3}
"""MAV_FRAME_GLOBAL and MAV_FRAME_GLOBAL_RELATIVE_ALT."""
_REFERENCES = {
    0: AltitudeReference.AMSL,
    5: AltitudeReference.AMSL,
    3: AltitudeReference.HOME,
    6: AltitudeReference.HOME,
}
_E7_PER_DEG = 1e7
MOST_HEIGHT_M = 32_767.0
"""ArduPilot keeps heights of rally points with 16 bits."""


def items_of_zones(zones: Sequence[FenceZone]) -> list[MissionItem]:
    """Returns the items that mean the zones. Their places are kept to 1e-7 degrees, about 1 cm."""
    return [item for zone in zones for item in _items(zone)]


def _items(zone: FenceZone) -> Iterator[MissionItem]:
    is_polygon = zone.radius_m is None
    command = (_POLYGONS if is_polygon else _CIRCLES)[zone.is_inclusion]
    size = float(len(zone.points)) if zone.radius_m is None else zone.radius_m
    for latitude_deg, longitude_deg in zone.points:
        yield MissionItem(0, command, size, x=round(latitude_deg * _E7_PER_DEG), y=round(longitude_deg * _E7_PER_DEG))


def found_zones(items: Sequence[MissionItem]) -> FoundZones:
    """Returns what the items mean, or why they make no fence."""
    return find_zones(
        [FenceItem(each.command, each.frame, each.param1, each.x / _E7_PER_DEG, each.y / _E7_PER_DEG) for each in items]
    )


def item_of_return_point(position: tuple[float, float]) -> MissionItem:
    """Returns the item of the point to return to."""
    return MissionItem(
        0, FenceCommand.RETURN_POINT, x=round(position[0] * _E7_PER_DEG), y=round(position[1] * _E7_PER_DEG)
    )


def return_point_of_items(items: Sequence[MissionItem]) -> tuple[float, float] | None:
    """Returns the point to return to; None where there is none."""
    found = next((each for each in items if each.command == FenceCommand.RETURN_POINT), None)
    return None if found is None else (found.x / _E7_PER_DEG, found.y / _E7_PER_DEG)


def zones_of_items(items: Sequence[MissionItem]) -> tuple[FenceZone, ...]:
    """Returns the zones that the items mean, without the point to return to.

    Raises:
        RejectedByAutopilotError: They make no fence.

    """
    found = found_zones(items)
    if found.zones is None:
        raise RejectedByAutopilotError(f"fence: what the autopilot has is no fence: {found.why}", {"list": "fence"})
    return tuple(FenceZone(zone.is_inclusion, zone.points, zone.radius_m) for zone in found.zones)


def items_of_rally(points: Sequence[RallyPoint]) -> list[MissionItem]:
    """Returns the items of rally points."""
    return [
        MissionItem(
            _FRAMES[each.reference],
            _RALLY_POINT_COMMAND,
            x=round(each.latitude_deg * _E7_PER_DEG),
            y=round(each.longitude_deg * _E7_PER_DEG),
            z=float(each.height_m),
        )
        for each in points
    ]


def _is_on_earth(item: MissionItem) -> bool:
    """Returns whether an item has a place, at a height that UAL can tell (NaN is none)."""
    return abs(item.x) <= 90.0 * _E7_PER_DEG and abs(item.y) <= 180.0 * _E7_PER_DEG and abs(item.z) <= MOST_HEIGHT_M


def rally_of_items(items: Sequence[MissionItem]) -> tuple[RallyPoint, ...]:
    """Returns the rally points that the items mean.

    Raises:
        RejectedByAutopilotError: One is none that UAL can tell.

    """
    found = []
    for number, item in enumerate(items, 1):
        reference = _REFERENCES.get(item.frame)
        if item.command != _RALLY_POINT_COMMAND or reference is None:
            text = f"rally points: number {number} is none that UAL knows (command {item.command}, frame {item.frame})"
            raise RejectedByAutopilotError(text, {"list": "rally points"})
        if not _is_on_earth(item):
            position = f"{item.x / _E7_PER_DEG:.7f}, {item.y / _E7_PER_DEG:.7f}, {item.z:g} m"
            text = f"rally points: number {number} has no place on Earth ({position})"
            raise RejectedByAutopilotError(text, {"list": "rally points"})
        found.append(RallyPoint(item.x / _E7_PER_DEG, item.y / _E7_PER_DEG, round(item.z), reference))
    return tuple(found)
