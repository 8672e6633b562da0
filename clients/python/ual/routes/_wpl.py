"""Waypoint files of Mission Planner, MAVProxy and APM Planner (``QGC WPL 110``), and of old QGroundControls (120).

Source: MAVLink's file formats (https://mavlink.io/en/file_formats/#mission_plain_text_file).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace

from ual.routes import _commands as commands
from ual.routes._mission import MOST_ITEMS, Firmware, RouteItem, at_most, fly
from ual.routes._route import FaultError, Route
from ual.shared.numbers import are_commas_decimal, parse_number, shown, with_point
from ual.shared.text import rows_of

HEADER = "QGC WPL"
HOME = "item 0: home"
_FIRMWARES = {"110": Firmware.ARDUPILOT, "120": Firmware.OTHER}
_COLUMNS_COUNT = 12


def read(text: str) -> Route:
    """Reads a file of waypoints. Raises `FaultError`."""
    items, firmware, has_home = items_of(text)
    route = fly(items, firmware)
    return replace(route, left_out=[HOME, *route.left_out]) if has_home else route


def items_of(text: str, most: int = MOST_ITEMS) -> tuple[list[RouteItem], Firmware, bool]:
    """Returns the items of a file without its home, for whose autopilot it was made, and whether it has a home.
    Raises `FaultError`, also where there are more than `most` items.
    """
    lines = [(number, line.strip()) for number, line in enumerate(rows_of(text), start=1) if line.strip()]
    header = lines[0][1] if lines else ""
    version = header.removeprefix(HEADER).strip()
    if not header.startswith(HEADER) or version not in _FIRMWARES:
        raise FaultError(f"begins with {shown(header)}, not with 'QGC WPL 110'")
    items = list(at_most(most, _items(lines[1:])))
    firmware = _FIRMWARES[version]
    if any(None in item.params for item in items):
        firmware = Firmware.PX4  # which tells a heading that is not given from 0, north
    for before, item in itertools.pairwise(items):
        if item.jump_id <= before.jump_id:
            raise FaultError(f"its number comes after {before.jump_id}", item.where)
    has_home = bool(items) and _is_home(items[0], version)
    return items[1:] if has_home else items, firmware, has_home


def _is_home(item: RouteItem, version: str) -> bool:
    """Returns whether it is the item 0 in which ArduPilot keeps its home, and by which QGroundControl reads version
    110.
    """
    return version == "110" and item.jump_id == 0 and item.command == commands.WAYPOINT


def _items(lines: list[tuple[int, str]]) -> Iterator[RouteItem]:
    is_decimal = are_commas_decimal(field for _, line in lines if not line.startswith("#") for field in line.split())
    for number, line in lines:
        if not line.startswith("#"):
            yield _item(line, f"line {number}", is_decimal=is_decimal)


def _optional(field: str) -> float | None:
    """Parses one of the first four parameters, of which PX4's files have ``nan`` where it is not given."""
    return None if field.lower().lstrip("-") == "nan" else parse_number(field)


def _item(line: str, where: str, *, is_decimal: bool) -> RouteItem:
    fields = line.split()
    if len(fields) != _COLUMNS_COUNT:
        raise FaultError(f"{shown(line)} has {len(fields)} columns, not {_COLUMNS_COUNT}", where)
    try:
        if "." not in line:  # the decimal comma of the computer's language
            fields = [with_point(field, is_decimal=is_decimal) for field in fields]
        index, current, frame, command = map(parse_number, fields[:4])
        params = [*map(_optional, fields[4:8]), *map(parse_number, fields[8:11])]
        goes_on = parse_number(fields[11])
    except ValueError as error:
        raise FaultError(str(error), where) from None
    if not (index.is_integer() and frame.is_integer() and command.is_integer()):
        raise FaultError(f"{shown(line)} has fractions in its number, frame or command", where)
    if {current, goes_on} - {0.0, 1.0}:
        raise FaultError(f"{shown(line)} has neither 0 nor 1 in its second or last column", where)
    return RouteItem(
        str(int(index)), int(command), int(frame), params, int(index), waits=not goes_on, line=f"{where}, "
    )
