"""KML and KMZ (Google Earth, QGIS, ...).

Source: OGC KML 2.3 (OGC 12-007r2), sections 9.11 (LineString) and 9.20 (altitudeMode); Google's KML reference for
gx:Track and KMZ.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterator, Sequence

from ual.routes import _xml
from ual.routes._points import HOW, Heights, RoutePoint, counted, number, route, the_one
from ual.routes._route import FaultError, Route, naming
from ual.shared.numbers import shown
from ual.types import AltitudeReference

_AMSL, _HOME = AltitudeReference.AMSL, AltitudeReference.HOME
_ABOVE = {"absolute": _AMSL, "relativeToGround": _HOME}
_OTHERS = (("Point", "point"), ("Polygon", "polygon"), ("NetworkLink", "link to another file"))


def parse_kml(text: str, name: str, altitude_m: float | None = None) -> Route:
    """Parses the one line (LineString or gx:Track) of a KML file. Its altitudes are used if its ``altitudeMode`` is
    ``absolute`` (mean sea level) or ``relativeToGround`` (taken as above home); `altitude_m` above home is flown
    instead. Raises `RouteError`.
    """
    with naming(name):
        return read(_xml.parsed(text), Heights(altitude_m))


def read(root: _xml.Element, heights: Heights) -> Route:
    """Reads a document. Raises `FaultError`."""
    lines = list(_tracks(root))
    others = counted([(sum(1 for _ in root.all(tag)), name) for tag, name in _OTHERS])
    line = the_one(lines, "lines (LineString)", others)
    mode = _one(line, "altitudeMode") or "clampToGround"
    if (offset := _one(line, "altitudeOffset")) and number(offset, "altitudeOffset", f"line {line.line}"):
        raise FaultError(f"has a line with an altitudeOffset of {shown(offset)}: add it to its altitudes instead")
    reference = _ABOVE.get(mode)
    if reference is None and heights.altitude_m is None:
        raise FaultError(f"has a line with altitudeMode {shown(mode)}, which is no height to fly at: {HOW}")
    points = list(_track_points(line))
    if not points:
        raise FaultError("has a line without coordinates")
    left_out = [others] if others else []
    if line.name == "Track":
        left_out.append("the times of the track")
    if mode == "relativeToGround" and heights.altitude_m is None:
        left_out.append("the height of the ground: altitudes are taken as above home")
    return route(points, reference, heights, left_out)


def _tracks(root: _xml.Element) -> Iterator[tuple[str, _xml.Element]]:
    """Yields each line with the name of its placemark."""
    named = list(root.all("Placemark"))
    within = {id(line): mark.value("name") for mark in named for line in mark.all("LineString", "Track")}
    for line in root.all("LineString", "Track"):
        yield within.get(id(line), ""), line


def _one(line: _xml.Element, name: str) -> str:
    """Returns the text of the only child of this name, or empty where there is none. Raises `FaultError`."""
    texts = {child.text for child in line.own(name)}
    if len(texts) > 1:
        raise FaultError(f"has a line with {len(texts)} different {name}: keep one of them", f"line {line.line}")
    return texts.pop() if texts else ""


def _track_points(line: _xml.Element) -> Iterator[RoutePoint]:
    if line.name == "Track":
        points = [(each.text.split(), each.text) for each in line.own("coord")]
    else:
        points = [(parts, ",".join(parts)) for parts in _tuples(_one(line, "coordinates"))]
    for index, (parts, text) in enumerate(points, start=1):
        where = f"place {index}"
        if len(parts) not in (2, 3):
            raise FaultError(f"{shown(text)} is not LONGITUDE,LATITUDE,ALTITUDE", where)
        longitude_deg, latitude_deg, *altitude_m = (number(part, f"{shown(text)}:", where) for part in parts)
        yield RoutePoint(where, latitude_deg, longitude_deg, altitude_m[0] if altitude_m else None)


def _tuples(text: str) -> list[list[str]]:
    """Splits coordinates into places. Spaces end a place, but not those beside a comma, which many programs write."""
    found: list[list[str]] = []
    is_joined = False
    for part in text.replace(",", " , ").split():
        if part == ",":
            if is_joined or not found:
                raise FaultError("has coordinates with a comma too many")
            is_joined = True
        elif is_joined:
            found[-1].append(part)
            is_joined = False
        else:
            found.append([part])
    return found


# --- KMZ --------------------------------------------------------------------------------------------------------------


def unpacked(data: bytes, most_bytes: int) -> bytes:
    """Returns the KML of a KMZ (a zip file): ``doc.kml``, or the only one. Raises `FaultError`."""
    import zipfile

    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            name = _main(archive.namelist())
            with archive.open(name) as file:
                found = file.read(most_bytes + 1)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
        raise FaultError(f"is not a KMZ that can be unpacked: {error}") from None
    if len(found) > most_bytes:
        raise FaultError(f"is too large for a route (more than {most_bytes} bytes when unpacked)")
    return found


def _main(names: Sequence[str]) -> str:
    if any(name.endswith(".wpml") for name in names):
        raise FaultError("is a mission of DJI (WPML), which UAL does not read: export the route as KML")
    found = [name for name in names if name.lower().endswith(".kml")]
    if "doc.kml" in found:
        return "doc.kml"
    if len(found) != 1:
        raise FaultError(f"has {len(found)} KML files and no doc.kml; a route needs exactly one")
    return found[0]
