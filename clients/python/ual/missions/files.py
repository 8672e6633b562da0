"""Reads missions from files: QGroundControl's ``.plan``, ``.waypoints`` (QGC WPL 110), and the lines of KML, KMZ, GPX
and GeoJSON, along which a mission flies.

What is not an item of `ual.missions.items`, or has values that those do not have, is refused with its number in the
file. So nothing of a file is left out in silence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ual.missions import checks, commands
from ual.missions.items import Item, Waypoint
from ual.routes import _plan, _wpl
from ual.routes._files import MOST_BYTES, _document, _text, content
from ual.routes._files import parse as parse_route
from ual.routes._route import FaultError, Route, naming
from ual.types import AltitudeReference, GeoWaypoint

_MOST_READ_ITEMS = 2 * checks.MOST_ITEMS
"""Items of a file are read up to this number: some become none of the mission."""
_PLANS = (".plan", ".mission")


@dataclass(frozen=True, slots=True)
class Mission:
    """The items of a mission, and what else is in its file, as human-readable text."""

    items: Sequence[Item]
    left_out: Sequence[str] = ()


def read(
    file: Path | str, *, altitude_m: float | None = None, altitude_reference: AltitudeReference | None = None
) -> Mission:
    """Reads a mission from a file, whose content says its format.

    `altitude_m` (above home) and `altitude_reference` are for KML, KMZ, GPX and GeoJSON; see `ual.routes.read`.

    Raises:
        RouteError: The file cannot be read, or has what a mission cannot have; the item is named.

    """
    return parse(content(file), str(Path(file)), altitude_m=altitude_m, altitude_reference=altitude_reference)


def parse(
    data: bytes,
    name: str,
    *,
    altitude_m: float | None = None,
    altitude_reference: AltitudeReference | None = None,
) -> Mission:
    """Reads a mission from the content of a file, as `read`; `name` stands in messages.

    Raises:
        RouteError: As `read`.

    """
    with naming(name):
        found = _of_commands(data, Path(name).suffix.lower())
    if found is not None:
        return found
    route = parse_route(data, name, altitude_m=altitude_m, altitude_reference=altitude_reference)
    with naming(name):
        return _along(route)


def _of_commands(data: bytes, ending: str) -> Mission | None:
    """Returns the mission of a file that has commands; None if it has none."""
    if len(data) > MOST_BYTES or data.startswith(b"PK"):
        return None  # the routes refuse or unpack it
    text = _text(data)
    if text.lstrip().startswith(_wpl.HEADER) or ending == ".waypoints":
        items, firmware, has_home = _wpl.items_of(text, _MOST_READ_ITEMS)
        found, left_out = commands.items_of_file(items, firmware, None)
        return Mission(found, [_wpl.HOME, *left_out] if has_home else left_out)
    document = _document(text, ending)
    if not (_plan.is_plan(document) or ending in _PLANS):
        return None
    items, firmware = _plan.items_of(document, _MOST_READ_ITEMS)
    found, left_out = commands.items_of_file(items, firmware, _plan.planned_home(document))
    return Mission(found, [*left_out, *_plan.other_parts(document)])


def _along(route: Route) -> Mission:
    """Returns the mission that flies through the places of a line."""
    items = [_waypoint(each, number) for number, each in enumerate(route.waypoints, start=1)]
    return Mission(items, route.left_out)


def _waypoint(position: object, number: int) -> Waypoint:
    where = f"place {number}"
    if not isinstance(position, GeoWaypoint):
        raise FaultError("has poses in frames; a mission needs positions on Earth")
    if position.altitude_reference is AltitudeReference.ELLIPSOID:
        raise FaultError("has altitudes above the ellipsoid; a mission needs them above home or mean sea level", where)
    return Waypoint(
        position.latitude_deg,
        position.longitude_deg,
        position.altitude_m,
        position.altitude_reference,
        number=str(number),
    )
