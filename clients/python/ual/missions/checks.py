"""Requirements of a mission for every autopilot. Each refusal names the item."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ual.errors import InvalidArgumentError, ResourceExhaustedError
from ual.missions import order
from ual.missions.items import (
    ENDING,
    MOVING,
    PLACED,
    CameraAction,
    CameraTrigger,
    Heading,
    HoldTime,
    Item,
    Jump,
    Land,
    OtherItem,
    RegionOfInterest,
    RegionOfInterestEnd,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
    name_of,
)
from ual.types import AltitudeReference

MOST_ITEMS = 1000
"""ArduCopter keeps 700 on most boards, PX4 up to 2,000; the autopilot itself refuses what it cannot keep."""
MOST_HOLD_S = 3600.0
MOST_JUMPS = 1000
MOST_SPEED_M_S = 100.0
MOST_ALTITUDE_M = 10_000.0
MOST_DISTANCE_M = 10_000.0
_NOWHERE_DEG = 1e-6
"""Latitude and longitude within a decimetre of 0 are a position that was not set."""


def require(items: Sequence[Item]) -> None:
    """Checks a mission.

    Raises:
        InvalidArgumentError: An item is none, has a value that is none, or stands where it cannot.
        ResourceExhaustedError: There are too many.

    """
    if not items:
        raise InvalidArgumentError("items: the mission has none", {"field": "items"})
    require_count(items)
    for index, item in enumerate(items):
        if type(item) not in _FAULTS:
            raise InvalidArgumentError(f"items[{index}]: {item!r:.80} is no item of a mission", _metadata(items, index))
        fault = next(iter(_FAULTS[type(item)](item)), None) or _misplaced(items, index)
        if fault:
            raise refused(items, index, fault)
    if not any(isinstance(item, PLACED) for item in items):
        raise InvalidArgumentError("items: none of them leads to a place", {"field": "items"})
    order.executed(items)


def require_count(items: Sequence[object]) -> None:
    """Checks how many items there are. Raises `ResourceExhaustedError`: there are too many."""
    if len(items) > MOST_ITEMS:
        text = f"items: {len(items)} are more than the limit of {MOST_ITEMS}: fly the mission in parts"
        raise ResourceExhaustedError(text, {"field": "items", "limit": str(MOST_ITEMS)})


def refused(items: Sequence[Item], index: int, fault: str) -> InvalidArgumentError:
    """Returns the refusal of an item."""
    return InvalidArgumentError(f"{name_of(items, index)}: {fault}", _metadata(items, index))


def _metadata(items: Sequence[Item], index: int) -> dict[str, str]:
    number = items[index].number if isinstance(items[index], Item) else ""
    return {"field": f"items[{index}]", "item": number or str(index + 1)}


def _misplaced(items: Sequence[Item], index: int) -> str:
    item = items[index]
    if isinstance(item, ENDING) and index + 1 < len(items):
        return "it ends the mission, but more items follow"
    if isinstance(item, TakeOff) and any(isinstance(before, MOVING) for before in items[:index]):
        return "a take-off has to come before all that flies"
    if isinstance(item, Jump):
        return _jump_fault(items, index, item)
    return ""


def _jump_fault(items: Sequence[Item], index: int, jump: Jump) -> str:
    if not 1 <= jump.to <= len(items):
        return f"it jumps to item {jump.to}, which there is not"
    target = items[jump.to - 1]
    if isinstance(target, TakeOff):
        return "it jumps to the take-off"
    if not isinstance(target, MOVING):
        return f"it jumps to {name_of(items, jump.to - 1)}, which does not fly: jump to one that does"
    between = items[jump.to - 1 : index]
    if jump.to - 1 < index and not any(isinstance(each, Waypoint | HoldTime) for each in between):
        return "what it repeats does not fly"
    return ""


def _number(value: Any, name: str, least: float, most: float, *, above: bool = False) -> Iterator[str]:  # noqa: ANN401  whatever a caller gives
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        yield f"{name}: {value!r:.40} is not a finite number"
    elif not least <= value <= most or (above and value == least):
        yield f"{name}: {value:.12g} is out of range ({'above' if above else 'from'} {least:g} to {most:g})"


def _position(item: Any) -> Iterator[str]:  # noqa: ANN401  one that has a place
    yield from _number(item.latitude_deg, "latitude_deg", -90.0, 90.0)
    yield from _number(item.longitude_deg, "longitude_deg", -180.0, 180.0)
    if abs(item.latitude_deg) < _NOWHERE_DEG and abs(item.longitude_deg) < _NOWHERE_DEG:
        yield "latitude 0, longitude 0 is a position that was not set"


def _altitude(item: Any) -> Iterator[str]:  # noqa: ANN401  one that has an altitude
    yield from _number(item.altitude_m, "altitude_m", -MOST_ALTITUDE_M, MOST_ALTITUDE_M)
    if item.altitude_reference not in (AltitudeReference.HOME, AltitudeReference.AMSL):
        yield "its altitude has to be above home or above mean sea level"


def _take_off(item: TakeOff) -> Iterator[str]:
    yield from _altitude(item)
    if item.altitude_reference is AltitudeReference.HOME and item.altitude_m <= 0.0:
        yield "altitude_m: a take-off has to climb above home"
    if (item.latitude_deg is None) != (item.longitude_deg is None):
        yield "it has only one of latitude and longitude"
    if item.latitude_deg is not None:
        yield from _position(item)


def _waypoint(item: Waypoint) -> Iterator[str]:
    yield from _position(item)
    yield from _altitude(item)
    yield from _number(item.hold_s, "hold_s", 0.0, MOST_HOLD_S)
    if item.accept_radius_m is not None:
        yield from _number(item.accept_radius_m, "accept_radius_m", 0.0, MOST_DISTANCE_M, above=True)
    if item.yaw_rad is not None:
        yield from _yaw(item)


def _yaw(item: Any) -> Iterator[str]:  # noqa: ANN401  one that has a heading
    yield from _number(item.yaw_rad, "yaw_rad", -4.0 * math.pi, 4.0 * math.pi)


def _interest(item: RegionOfInterest) -> Iterator[str]:
    yield from _position(item)
    yield from _altitude(item)


def _camera(item: CameraTrigger) -> Iterator[str]:
    if not isinstance(item.action, CameraAction):
        yield f"action: {item.action!r:.40} is none"
    elif item.action in (CameraAction.BY_DISTANCE, CameraAction.BY_DISTANCE_LATER, CameraAction.BY_INTERVAL):
        yield from _number(item.value, "value", 0.0, MOST_DISTANCE_M, above=True)
    elif item.value != 0.0:
        yield "value: it has one, but needs none"


def _jump(item: Jump) -> Iterator[str]:
    for value, name in ((item.to, "to"), (item.times, "times")):
        if isinstance(value, bool) or not isinstance(value, int):
            yield f"{name}: {value!r:.40} is not a whole number"
    yield from _number(item.times, "times", 1, MOST_JUMPS)


def _nothing(_: Item) -> Iterator[str]:
    yield from ()


_FAULTS: dict[type[Any], Callable[[Any], Iterator[str]]] = {
    TakeOff: _take_off,
    Waypoint: _waypoint,
    HoldTime: lambda item: _number(item.seconds, "seconds", 0.0, MOST_HOLD_S, above=True),
    Speed: lambda item: _number(item.speed_m_s, "speed_m_s", 0.0, MOST_SPEED_M_S, above=True),
    Heading: _yaw,
    RegionOfInterest: _interest,
    CameraTrigger: _camera,
    RegionOfInterestEnd: _nothing,
    Land: _position,
    ReturnToLaunch: _nothing,
    Jump: _jump,
    OtherItem: lambda item: iter((item.text,)),
}
