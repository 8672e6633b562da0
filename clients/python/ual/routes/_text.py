"""UAL's own route files, and waypoints as text: one waypoint a line, in metres."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from ual.geometry import Pose, PoseStamped, wrap_angle
from ual.routes import _json
from ual.routes._route import FaultError, Route, naming
from ual.shared.numbers import are_commas_decimal, parse_number, shown, with_point
from ual.shared.text import rows_of

_COLUMNS = (("x", "y", "z"), ("x", "y", "z", "yaw"))
_KEYS = ("x", "y", "z", "yaw_rad", "frame_id", "hold_s")
_HOW = 'write X,Y,Z[,YAW] or {"x": .., "y": .., "z": ..}'
_AN_EARTH = "for latitudes and longitudes use KML, GPX, GeoJSON or a plan"


class BareAngleError(ValueError):
    """An angle without a unit is so large that it cannot be meant in radians; the message says what to write."""


def parse_waypoints(text: str, name: str, frame_id: str = "") -> list[PoseStamped]:
    """Parses one waypoint a line: a JSON object as ``ual waypoints save`` writes it, or ``X,Y,Z[,YAW]``. ``#`` begins a
    comment. Raises `RouteError`.
    """
    with naming(name):
        return [pose for pose, _ in _rows(rows_of(text), frame_id)]


def parse_list(text: str, name: str, frame_id: str = "") -> Route:
    """Parses one waypoint a line, as `parse_waypoints`, with the times to hold there. Raises `RouteError`."""
    with naming(name):
        found = list(_rows(rows_of(text), frame_id))
    holds_s = [hold_s for _, hold_s in found]
    return Route([pose for pose, _ in found], holds_s=holds_s if any(holds_s) else ())


def _rows(lines: Iterable[str], frame_id: str) -> Iterator[tuple[PoseStamped, float]]:
    """Yields each waypoint, and how long to hold there."""
    texts = [line.partition("#")[0].strip() for line in lines]
    is_decimal = are_commas_decimal(field for line in texts if not line.startswith("{") for field in _fields(line))
    is_first = True
    for number, line in enumerate(texts, start=1):
        if not line or (is_first and is_header(line, f"line {number}", _COLUMNS)):
            is_first = is_first and not line
            continue
        is_first = False
        if line.startswith("{"):
            yield _from_json(line, frame_id, f"line {number}")
        else:
            yield PoseStamped(_from_fields(line, f"line {number}", is_decimal=is_decimal), frame_id), 0.0


def is_header(line: str, where: str, known: Sequence[Sequence[str]]) -> bool:
    """Returns whether a line names the columns of a table. Raises `FaultError` if they are none of those that are
    known.
    """
    names = [name.strip(" \t\"'").lower().removesuffix("_m").removesuffix("_rad") for name in _fields(line)]
    if line.startswith("{") or len(names) == 1 or not all(name[:1].isalpha() for name in names):
        return False
    if tuple(names) not in known:
        wanted = " or ".join(",".join(columns) for columns in known)
        raise FaultError(f"the columns {shown(line)} are not {wanted} (metres, radians); {_AN_EARTH}", where)
    return True


def _from_fields(line: str, where: str, *, is_decimal: bool) -> Pose:
    try:
        fields = [with_point(field, is_decimal=is_decimal) for field in _fields(line)]
    except ValueError as error:
        raise FaultError(str(error), where) from None
    try:
        return _waypoint(fields)
    except BareAngleError as error:
        raise FaultError(str(error), where) from None
    except ValueError:
        raise FaultError(f"{shown(line)} is not a waypoint: {_HOW}", where) from None


def _fields(line: str) -> list[str]:
    """Splits a line at its commas, or at its semicolons or tabs: then a comma may be the decimal one."""
    return line.split(next((each for each in (";", "\t") if each in line), ","))


def _from_json(line: str, frame_id: str, where: str) -> tuple[PoseStamped, float]:
    try:
        values = _json.parsed(line)
    except _json.AmbiguousJsonError as error:
        raise FaultError(str(error), where) from None
    except ValueError:
        raise FaultError(f"{shown(line)} is not a waypoint: {_HOW}", where) from None
    if unknown := [key for key in values if key not in _KEYS]:
        raise FaultError(f"{shown(unknown[0])} is not known: a waypoint has {', '.join(_KEYS)}; {_AN_EARTH}", where)
    x, y, z = (_json.number(values.get(key), key, where) for key in ("x", "y", "z"))
    yaw_rad = _json.optional(values.get("yaw_rad"), "yaw_rad", where)
    if yaw_rad is not None and abs(yaw_rad) > math.tau:
        raise FaultError(f"yaw_rad is {yaw_rad:g}, more than a full turn: give it in radians", where)
    pose = Pose.at(x, y, z, yaw_rad)
    named = values.get("frame_id") or frame_id
    if not isinstance(named, str):
        raise FaultError(f"frame_id is {shown(named)}, not a text", where)
    hold_s = _json.optional(values.get("hold_s"), "hold_s", where) or 0.0
    return PoseStamped(pose, named), hold_s


def parse_waypoint(text: str) -> Pose:
    """Parses ``X,Y,Z`` or ``X,Y,Z,YAW``. Raises `ValueError`."""
    return _waypoint(text.split(","))


def _waypoint(fields: Sequence[str]) -> Pose:
    x, y, z, *yaw = fields
    if len(yaw) > 1:
        raise ValueError("more than four numbers")
    yaw_rad = wrap_angle(parse_angle(yaw[0])) if yaw else None
    return Pose.at(parse_number(x), parse_number(y), parse_number(z), yaw_rad)


def parse_angle(text: str) -> float:
    """Parses ``90deg``, ``1.57rad`` or ``1.57``; returns radians.

    Raises:
        BareAngleError: A number without a unit is beyond a full turn: 90 radians are not meant.
        ValueError: It is not an angle.

    """
    text = text.strip()
    if text.endswith("deg"):
        return math.radians(parse_number(text.removesuffix("deg")))
    angle_rad = parse_number(text.removesuffix("rad"))
    if abs(angle_rad) > math.tau and not text.endswith("rad"):
        raise BareAngleError(f"{text} radians are more than a full turn: {text}deg? (or {text}rad)")
    return angle_rad
