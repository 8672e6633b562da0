"""Files of fences: QGroundControl's plans (``.plan``), and the fences and rally points of Mission Planner and MAVProxy.

Plans: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html. In version 1 of their fences a
fence was one polygon to stay inside.

Mission Planner and MAVProxy save the items of a fence and of rally points as ``QGC WPL 110``, each with its MAV_CMD.
Older ones save a fence as ``.fen``: the point to return to, then the corners, one ``LATITUDE LONGITUDE`` a line. They
save rally points as ``.ral``: ``RALLY``, latitude, longitude, height above home, three numbers for planes. (Source:
pymavlink's mavwp.py.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from ual.errors import InvalidArgumentError
from ual.fences.values import FencePlan, FenceZone, RallyPoint
from ual.shared import strict_json
from ual.shared.numbers import parse_number, shown
from ual.shared.text import read_text, rows_of
from ual.types import AltitudeReference

T = TypeVar("T")

MOST_BYTES = 4 << 20
"""A file that is larger is not read."""

_HEADER = ["QGC", "WPL", "110"]
_COLUMNS_COUNT = 12
_POLYGONS = {5001: True, 5002: False}
_CIRCLES = {5003: True, 5004: False}
_RALLY_POINT_COMMAND = 5100
_LEFT_OUT = {16: "home", 5000: "the point to return to"}
_REFERENCES = {
    0: AltitudeReference.AMSL,
    3: AltitudeReference.HOME,
    5: AltitudeReference.AMSL,
    6: AltitudeReference.HOME,
}
_VERSIONS = (1.0, 2.0)
_RALLY_WORD = "rally"
_RALLY_FIELDS = 7
_NO_FORMAT = (
    "it is neither a plan of QGroundControl (.plan), nor begins with 'QGC WPL 110', nor has the lines of a fence "
    "(.fen: LATITUDE LONGITUDE) or of rally points (.ral: RALLY LATITUDE LONGITUDE HEIGHT 0 0 0)"
)


def read(path: Path) -> FencePlan:
    """Returns the zones and the rally points in a file.

    Raises:
        InvalidArgumentError: It is none of these files, or has neither; names the place.
        OSError: It cannot be read.

    """
    try:
        text = read_text(path, MOST_BYTES)
    except ValueError as error:
        raise InvalidArgumentError(f"{path}: {error}", {"field": "file"}) from None
    return parse(text, str(path))


def parse(text: str, name: str) -> FencePlan:
    """Returns the zones and the rally points in the text of a file, as `read`; `name` stands in messages.

    Raises:
        InvalidArgumentError: As `read`.

    """
    if len(text) > MOST_BYTES:
        raise InvalidArgumentError(f"{name}: it may have at most {MOST_BYTES} bytes", {"field": "file"})
    try:
        return _filled(_parsed(text.removeprefix("\ufeff"), Path(name).suffix.lower()))
    except ValueError as error:
        raise InvalidArgumentError(f"{name}: {error}", {"field": "file"}) from None


def _parsed(text: str, ending: str) -> FencePlan:
    if text.lstrip().startswith("{"):
        return _of_plan(text)
    lines = [(number, line.split()) for number, line in enumerate(rows_of(text), 1) if _has_content(line)]
    first = lines[0][1] if lines else []
    if first[:2] == _HEADER[:2]:
        return _of_items(first, lines[1:])
    if ending == ".ral" or (first[:1] and first[0].lower() == _RALLY_WORD):
        return _of_rally_points(lines)
    if ending == ".fen" or (len(first) == 2 and all(map(_is_number, first))):
        return _of_corners(lines)
    raise ValueError(_NO_FORMAT)


def _has_content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _is_number(text: str) -> bool:
    try:
        parse_number(text)
    except ValueError:
        return False
    return True


def _filled(plan: FencePlan) -> FencePlan:
    if not plan.zones and not plan.rally_points:
        raise ValueError("it has no fence and no rally points")
    return plan


def _corner(latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
    if abs(latitude_deg) > 90.0 or abs(longitude_deg) > 180.0:
        raise ValueError(f"latitude {latitude_deg:.12g}, longitude {longitude_deg:.12g} is not on Earth")
    return latitude_deg, longitude_deg


# --- Plans ------------------------------------------------------------------------------------------------------------


def _of_plan(text: str) -> FencePlan:
    try:
        document = strict_json.parsed(text, float)
    except strict_json.JsonError as error:
        raise ValueError(f"line {error.line}: it is no plan of QGroundControl: {error}") from None
    if not isinstance(document, Mapping) or document.get("fileType") != "Plan":
        raise ValueError("it is not a plan of QGroundControl (fileType)")
    strict_json.require_spelled(document, strict_json.PLAN_KEYS)
    fence = _part(document, "geoFence", ("polygons", "circles", "polygon", "breachReturn"))
    rally = _part(document, "rallyPoints", ("points",))
    zones = [*_each(fence, "polygons", _polygon), *_each(fence, "circles", _circle)]
    if old := tuple(_each(fence, "polygon", _pair)):
        zones.insert(0, FenceZone(True, old))
    heights = list(_each(rally, "points", _rally_point))
    return FencePlan(tuple(zones), tuple(map(_rounded, heights)), tuple(_left_out(document, fence, heights)))


def _left_out(
    document: Mapping[str, Any], fence: Mapping[str, Any], points: Sequence[tuple[float, float, float]]
) -> Iterator[str]:
    mission = document.get("mission")
    if isinstance(mission, Mapping) and mission.get("items"):
        yield "the mission (`ual mission upload` uploads it)"
    if fence.get("breachReturn"):
        yield _LEFT_OUT[5000]
    for number, (_, _, height_m) in enumerate(points, 1):
        yield from _about_rounding(f"rally point {number}", height_m)


def _part(document: Mapping[str, Any], key: str, known: Sequence[str]) -> Mapping[str, Any]:
    part = document.get(key, {})
    if not isinstance(part, Mapping):
        raise ValueError(f"{key} is not in QGroundControl's format")  # noqa: TRY004  of a file
    version = part.get("version", 1.0)
    if version not in _VERSIONS:
        raise ValueError(f"{key} is of version {shown(version)}, which UAL does not know")
    _require_known(part, known, key)
    return part


def _require_known(part: Mapping[str, Any], known: Sequence[str], what: str) -> None:
    for key, value in part.items():
        if key not in (*known, "version") and value not in (None, [], {}, ""):
            raise ValueError(
                f"{what} has {shown(key)}, which UAL does not know: delete it, if the zones do not need it"
            )


def _each(part: Mapping[str, Any], key: str, convert: Callable[[Any], T]) -> Iterator[T]:
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
    is_inclusion, points = _flag(part["inclusion"]), tuple(map(_pair, _list(part["polygon"], "polygon")))
    _require_known(part, ("inclusion", "polygon"), "it")
    return FenceZone(is_inclusion, points)


def _circle(part: Mapping[str, Any]) -> FenceZone:
    circle = part["circle"]
    zone = FenceZone(_flag(part["inclusion"]), (_pair(circle["center"]),), _number(circle["radius"]))
    _require_known(part, ("inclusion", "circle"), "it")
    _require_known(circle, ("center", "radius"), "its circle")
    return zone


def _pair(position: Sequence[Any]) -> tuple[float, float]:
    return _corner(*_numbers(position, 2, "[LATITUDE, LONGITUDE]"))


def _rally_point(point: Sequence[Any]) -> tuple[float, float, float]:
    """Returns latitude, longitude and height; QGroundControl has the heights above home."""
    latitude_deg, longitude_deg, height_m = _numbers(point, 3, "[LATITUDE, LONGITUDE, HEIGHT]")
    return *_corner(latitude_deg, longitude_deg), height_m


def _numbers(values: object, count: int, form: str) -> list[float]:
    if not isinstance(values, list) or len(values) != count:
        raise ValueError(f"{shown(values)} is not {form}")
    return [_number(each) for each in values]


def _rounded(point: tuple[float, float, float]) -> RallyPoint:
    latitude_deg, longitude_deg, height_m = point
    return RallyPoint(latitude_deg, longitude_deg, round(height_m))


def _about_rounding(what: str, height_m: float) -> Iterator[str]:
    if height_m != round(height_m):
        yield f"{what}: its height of {height_m:g} m is kept as {round(height_m)} m"


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError("inclusion is neither true nor false")
    return value


def _number(value: object) -> float:
    if not isinstance(value, float) or not math.isfinite(value):
        raise ValueError(f"{value!r:.40} is not a number")
    return value


# --- Items ------------------------------------------------------------------------------------------------------------


def _of_items(header: list[str], lines: Sequence[tuple[int, list[str]]]) -> FencePlan:
    if header != _HEADER:
        raise ValueError(f"it begins with {shown(' '.join(header))}, not with {' '.join(_HEADER)!r}")
    items = [_item(fields, number) for number, fields in lines]
    rally_points = [each for each in items if each.command == _RALLY_POINT_COMMAND]
    others = [each for each in items if each.command != _RALLY_POINT_COMMAND]
    left_out = [f"{each.where}: {_LEFT_OUT[each.command]}" for each in others if each.command in _LEFT_OUT]
    for each in rally_points:
        left_out += _about_rounding(each.where, each.height_m)
    return FencePlan(tuple(_zones(others)), tuple(map(_rally_item, rally_points)), tuple(left_out))


class _Item:
    """A line of a file."""

    def __init__(self, fields: Sequence[float], line: int) -> None:
        self.where = f"line {line}"
        _, current, frame, command, self.size, *unused, latitude_deg, longitude_deg, self.height_m, goes_on = fields
        if not (frame.is_integer() and command.is_integer()) or {current, goes_on} - {0.0, 1.0}:
            raise ValueError("its frame and command are whole numbers, its columns 2 and 12 are 0 or 1")
        self.frame, self.command = int(frame), int(command)
        self.latitude_deg, self.longitude_deg = _corner(latitude_deg, longitude_deg)
        if self.command != 16 and (any(unused) or (self.size and self.command in (5000, _RALLY_POINT_COMMAND))):
            raise ValueError("it has a parameter (columns 5 to 8) that UAL does not know for its command: set it to 0")
        if self.command in (*_POLYGONS, *_CIRCLES) and self.frame not in _REFERENCES:
            raise ValueError(f"a zone of frame {self.frame}, which is not on Earth")


def _item(fields: list[str], number: int) -> _Item:
    if len(fields) != _COLUMNS_COUNT:
        raise ValueError(f"line {number}: it has {len(fields)} columns, not {_COLUMNS_COUNT}")
    return _converted(number, fields, lambda each: _Item([parse_number(field) for field in each], number))


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
            corners = items[at : at + max(1, int(first.size))]
            is_alike = all((each.command, each.size) == (first.command, first.size) for each in corners)
            if first.size != len(corners) or len(corners) < 3 or not is_alike:
                raise ValueError(f"{first.where}: a polygon of {first.size:g} corners begins here, and has others")
            points = tuple((each.latitude_deg, each.longitude_deg) for each in corners)
            yield FenceZone(_POLYGONS[first.command], points)
            at += len(corners)
            continue
        if first.command in _CIRCLES:
            yield FenceZone(_CIRCLES[first.command], ((first.latitude_deg, first.longitude_deg),), first.size)
        elif first.command not in _LEFT_OUT:
            raise ValueError(f"{first.where}: command {first.command} is none of a fence or of rally points")
        at += 1


# --- Lines ------------------------------------------------------------------------------------------------------------


def _of_corners(lines: Sequence[tuple[int, list[str]]]) -> FencePlan:
    """Reads a ``.fen``: the point to return to, then the corners, of which the last may be the first one again."""
    vertices = [_converted(number, fields, _corner_fields) for number, fields in lines]
    if not vertices:
        return FencePlan(())
    back, *corners = vertices
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    if len(corners) < 3:
        raise ValueError(f"it has {len(corners)} corners after the point to return to (its first line), not 3 at least")
    zone = FenceZone(True, tuple(corners))
    if back not in corners and not zone.encloses(*back):
        raise ValueError(
            f"line {lines[0][0]}: the point to return to, which comes before the corners in a .fen, is outside of them"
        )
    return FencePlan((zone,), (), (f"line {lines[0][0]}: {_LEFT_OUT[5000]}",))


def _of_rally_points(lines: Sequence[tuple[int, list[str]]]) -> FencePlan:
    points = [(number, _converted(number, fields, _rally_fields)) for number, fields in lines]
    left_out = [each for number, position in points for each in _about_rounding(f"line {number}", position[2])]
    return FencePlan((), tuple(_rounded(position) for _, position in points), tuple(left_out))


def _converted(number: int, fields: list[str], convert: Callable[[list[str]], T]) -> T:
    try:
        return convert(fields)
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None


def _corner_fields(fields: list[str]) -> tuple[float, float]:
    if len(fields) != 2:
        raise ValueError(f"{shown(' '.join(fields))} is not LATITUDE LONGITUDE")
    return _corner(*map(parse_number, fields))


def _rally_fields(fields: list[str]) -> tuple[float, float, float]:
    """Returns latitude, longitude and height above home."""
    if len(fields) != _RALLY_FIELDS or fields[0].lower() != _RALLY_WORD:
        raise ValueError(f"{shown(' '.join(fields))} is not RALLY LATITUDE LONGITUDE HEIGHT 0 0 0")
    latitude_deg, longitude_deg, height_m, *for_planes = map(parse_number, fields[1:])
    if any(for_planes):
        raise ValueError(
            "its last three numbers (break altitude, landing direction, flags) are for planes: set them to 0"
        )
    return *_corner(latitude_deg, longitude_deg), height_m
