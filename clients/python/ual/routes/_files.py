"""Reads a route from a file, or from its content."""

from __future__ import annotations

from pathlib import Path

from ual.routes import _geojson, _gpx, _json, _kml, _plan, _wpl, _xml
from ual.routes._kml import parse_kml
from ual.routes._plan import parse_plan
from ual.routes._points import Heights
from ual.routes._route import FaultError, Route, RouteError, naming
from ual.routes._text import BareAngleError, parse_angle, parse_list, parse_waypoint, parse_waypoints
from ual.shared.renamed import renamed
from ual.shared.text import decoded
from ual.types import AltitudeReference

__all__ = [
    "MOST_BYTES",
    "BareAngleError",
    "Route",
    "RouteError",
    "parse",
    "parse_angle",
    "parse_kml",
    "parse_lines",
    "parse_list",
    "parse_plan",
    "parse_waypoint",
    "parse_waypoints",
    "read",
]

parse_lines = renamed(parse_waypoints, "parse_lines")

MOST_BYTES = 20_000_000
"""Most bytes of a file, and of the KML in a KMZ."""
_ZIP = (b"PK\x03\x04", b"PK\x05\x06")
"""First bytes of zip files; the second one has no content."""
_PLANS = (".plan", ".mission")
_GEOJSON = (".geojson", ".json")
_ONE_DOCUMENT = {**dict.fromkeys(_PLANS, "a plan of QGroundControl"), ".geojson": "GeoJSON"}


def read(
    file: Path | str,
    *,
    frame_id: str = "",
    altitude_m: float | None = None,
    altitude_reference: AltitudeReference | None = None,
) -> Route:
    """Reads a route from a file, whose content says its format.

    `frame_id` is the frame of waypoints (one a line) that name none. `altitude_m` (above home) replaces the altitudes
    of KML, KMZ, GPX and GeoJSON; a file without altitudes needs it. `altitude_reference` says what the altitudes of GPX
    and GeoJSON count from, which those formats do not say well enough to fly by.

    Raises:
        RouteError: The file cannot be read or contains no valid route.
    """
    data = content(file)
    return parse(data, str(Path(file)), frame_id=frame_id, altitude_m=altitude_m, altitude_reference=altitude_reference)


def parse(
    data: bytes,
    name: str,
    *,
    frame_id: str = "",
    altitude_m: float | None = None,
    altitude_reference: AltitudeReference | None = None,
) -> Route:
    """Reads a route from the content of a file, as `read`; `name` stands in messages.

    Raises:
        RouteError: It contains no valid route.
    """
    heights = Heights(altitude_m, altitude_reference)
    with naming(name):
        if len(data) > MOST_BYTES:
            raise FaultError(f"is too large for a route (more than {MOST_BYTES} bytes)")
        text = _text(_kml.unpacked(data, MOST_BYTES) if data.startswith(_ZIP) else data)
        found = _route_of_points(text, Path(name).suffix.lower(), heights)
        if found is not None:
            return found
        if heights != Heights():
            raise FaultError("has altitudes of its own: leave out --altitude and --reference")
        found = _mission(text, Path(name).suffix.lower()) or parse_list(text, name, frame_id)
        if not found.waypoints:
            raise FaultError("has no waypoints to fly to")
    return found


def content(file: Path | str) -> bytes:
    """Returns the content of a file, at most one byte more than a file may have.

    Raises:
        RouteError: The file cannot be read.
    """
    file = Path(file)
    try:
        with file.open("rb") as opened:
            return opened.read(MOST_BYTES + 1)
    except OSError as error:
        raise RouteError(f"cannot read {file}: {error.strerror}") from None


def _text(data: bytes) -> str:
    try:
        return decoded(data)
    except ValueError as error:
        raise FaultError(str(error)) from None


def _route_of_points(text: str, ending: str, heights: Heights) -> Route | None:
    """Returns the route of a format that only draws lines; None if the text has another one."""
    if text.lstrip().startswith("<") or ending in (".kml", ".gpx"):
        root = _xml.parsed(text)
        return _gpx.read(root, heights) if root.name == "gpx" else _kml.read(root, heights)
    document = _document(text, ending)
    if _geojson.is_geojson(document) or ending == ".geojson" or (ending in _GEOJSON and document is None):
        return _geojson.read(document, heights)
    return None


def _mission(text: str, ending: str) -> Route | None:
    """Returns the route of a mission; None if the text is no mission."""
    if text.lstrip().startswith(_wpl.HEADER) or ending == ".waypoints":
        return _wpl.read(text)
    document = _document(text, ending)
    return _plan.read(document) if _plan.is_plan(document) or ending in _PLANS else None


def _document(text: str, ending: str) -> object:
    """Returns the JSON object that the whole text is; None if it is none."""
    if not text.lstrip().startswith("{"):
        return None
    try:
        return _json.parsed(text)
    except _json.AmbiguousJsonError as error:
        raise FaultError(str(error), f"line {error.line}") from None
    except _json.JsonError as error:
        if ending in _ONE_DOCUMENT:
            raise FaultError(f"is not {_ONE_DOCUMENT[ending]}: no JSON in line {error.line}: {error}") from None
        return None  # waypoints, one a line
