"""Files of fences: QGroundControl's plans (``.plan``), and the fences and rally points of Mission Planner.

Source: QGroundControl's plan file format
(https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html). Mission Planner and MAVProxy save the
items of a fence and of rally points as ``QGC WPL 110``, each with its MAV_CMD.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ual.errors import InvalidArgumentError
from ual.fences.values import FencePlan, FenceZone, RallyPoint
from ual.types import AltitudeReference

MOST_BYTES = 4 << 20
"""A file that is larger is not read."""

_HEADER = "QGC WPL 110"
_COLUMNS = 12
_POLYGONS = {5001: True, 5002: False}
_CIRCLES = {5003: True, 5004: False}
_RALLY_POINT = 5100
_IGNORED = {16: "home", 5000: "the point to return to"}
_REFERENCES = {
    0: AltitudeReference.AMSL,
    3: AltitudeReference.HOME,
    5: AltitudeReference.AMSL,
    6: AltitudeReference.HOME,
}


def read(path: Path) -> FencePlan:
    """Returns the zones and the rally points in a file.

    Raises:
        InvalidArgumentError: It is none of these files, or has neither; names the place.
        OSError: It cannot be read.

    """
    if path.stat().st_size > MOST_BYTES:
        raise _too_large(str(path))
    return parse(path.read_text(encoding="utf-8", errors="replace"), str(path))


def parse(text: str, name: str) -> FencePlan:
    """Returns the zones and the rally points in the text of a file, as `read`; `name` stands in messages.

    Raises:
        InvalidArgumentError: As `read`.

    """
    if len(text) > MOST_BYTES:
        raise _too_large(name)
    try:
        return _filled(_of_items(text) if text.startswith("QGC WPL") else _of_plan(text))
    except ValueError as error:
        raise InvalidArgumentError(f"{name}: {error}", {"field": "file"}) from None


def _too_large(name: str) -> InvalidArgumentError:
    return InvalidArgumentError(f"{name}: a file of a fence has at most {MOST_BYTES} bytes", {"field": "file"})


def _filled(plan: FencePlan) -> FencePlan:
    if not plan.zones and not plan.rally_points:
        raise ValueError("it has no fence and no rally points")
    return plan


# --- Plans ------------------------------------------------------------------------------------------------------------


def _of_plan(text: str) -> FencePlan:
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise ValueError("it is neither a plan of QGroundControl nor begins with 'QGC WPL 110'") from None
    if not isinstance(document, Mapping) or document.get("fileType") != "Plan":
        raise ValueError("it is not a plan of QGroundControl (fileType)")
    fence, rally = _part(document, "geoFence"), _part(document, "rallyPoints")
    zones = [*_each(fence, "polygons", _polygon), *_each(fence, "circles", _circle)]
    return FencePlan(tuple(zones), tuple(_each(rally, "points", _rally_point)))


def _part(document: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    part = document.get(key, {})
    if isinstance(part, Mapping):
        return part
    raise ValueError(f"{key} is not in QGroundControl's format")


def _each(part: Mapping[str, Any], key: str, convert: Any) -> Iterator[Any]:  # noqa: ANN401  of JSON
    for number, each in enumerate(_list(part.get(key, []), key), 1):
        try:
            yield convert(each)
        except (KeyError, TypeError, IndexError, AttributeError, ValueError) as error:
            why = f"{error.args[0]} is not given" if isinstance(error, KeyError) else error
            raise ValueError(f"{key}, number {number}: {why}") from None


def _list(value: object, key: str) -> list[Any]:
    if isinstance(value, list):
        return value
    raise ValueError(f"{key} is not a list")


def _polygon(part: Mapping[str, Any]) -> FenceZone:
    points = tuple((_number(each[0]), _number(each[1])) for each in part["polygon"])
    return FenceZone(_flag(part["inclusion"]), points)


def _circle(part: Mapping[str, Any]) -> FenceZone:
    circle = part["circle"]
    latitude_deg, longitude_deg = map(_number, circle["center"][:2])
    return FenceZone(_flag(part["inclusion"]), ((latitude_deg, longitude_deg),), _number(circle["radius"]))


def _rally_point(point: Sequence[Any]) -> RallyPoint:
    """QGroundControl has their heights above home."""
    latitude_deg, longitude_deg, height_m = map(_number, point[:3])
    return RallyPoint(latitude_deg, longitude_deg, round(height_m))


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError("inclusion is neither true nor false")
    return value


def _number(value: object) -> float:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not math.isfinite(value):  # type: ignore[arg-type]  # it is a number
        raise ValueError(f"{value!r:.40} is not a number")
    return float(value)  # type: ignore[arg-type]  # as above


# --- Items ------------------------------------------------------------------------------------------------------------


def _of_items(text: str) -> FencePlan:
    header, *lines = text.splitlines()
    if header.strip() != _HEADER:
        raise ValueError(f"it begins with {header!r:.40}, not with {_HEADER!r}")
    items = [_item(line, number) for number, line in enumerate(lines, 2) if line.strip()]
    rally_points = tuple(_rally_item(each) for each in items if each.command == _RALLY_POINT)
    return FencePlan(tuple(_zones([each for each in items if each.command != _RALLY_POINT])), rally_points)


class _Item:
    """A line of a file."""

    def __init__(self, fields: Sequence[float], line: int) -> None:
        self.where = f"line {line}"
        self.frame, self.command = int(fields[2]), int(fields[3])
        self.size, self.latitude_deg, self.longitude_deg, self.height_m = fields[4], *fields[8:11]


def _item(line: str, number: int) -> _Item:
    fields = line.split()
    if len(fields) != _COLUMNS:
        raise ValueError(f"line {number}: it has {len(fields)} columns, not {_COLUMNS}")
    try:
        return _Item([_number(float(each)) for each in fields], number)
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None


def _rally_item(item: _Item) -> RallyPoint:
    reference = _REFERENCES.get(item.frame)
    if reference is None:
        raise ValueError(f"{item.where}: a rally point of frame {item.frame}, which is neither above home nor the sea")
    return RallyPoint(item.latitude_deg, item.longitude_deg, round(item.height_m), reference)


def _zones(items: Sequence[_Item]) -> Iterator[FenceZone]:
    at = 0
    while at < len(items):
        first = items[at]
        if first.command in _POLYGONS:
            count = int(first.size)
            corners = items[at : at + count]
            if count < 3 or len(corners) < count or any(each.command != first.command for each in corners):
                raise ValueError(f"{first.where}: a polygon of {first.size:g} corners begins here, and has others")
            points = tuple((each.latitude_deg, each.longitude_deg) for each in corners)
            yield FenceZone(_POLYGONS[first.command], points)
            at += count
            continue
        if first.command in _CIRCLES:
            yield FenceZone(_CIRCLES[first.command], ((first.latitude_deg, first.longitude_deg),), first.size)
        elif first.command not in _IGNORED:
            raise ValueError(f"{first.where}: command {first.command} is none of a fence or of rally points")
        at += 1
