"""GeoJSON (RFC 7946; web maps, QGIS, ...), whose order is longitude, latitude, altitude."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from ual.routes import _json
from ual.routes._points import Heights, RoutePoint, counted, route, the_one
from ual.routes._route import FaultError, Route
from ual.shared.numbers import shown

_SHAPES = ("Point", "MultiPoint", "LineString", "MultiLineString", "Polygon", "MultiPolygon", "GeometryCollection")
_TYPES = (*_SHAPES, "Feature", "FeatureCollection")
_MOST_NESTED_LEVELS = 20
_DEGREES = ("CRS84", "4326", "4979")
"""Last parts of the names of coordinate systems that are latitudes and longitudes of WGS 84 (GeoJSON before RFC
7946).
"""


def is_geojson(document: object) -> bool:
    """Returns whether a document is GeoJSON."""
    return isinstance(document, Mapping) and document.get("type") in _TYPES


def read(document: object, heights: Heights) -> Route:
    """Reads the one line of a document. Raises `FaultError`."""
    if not is_geojson(document):
        raise FaultError("is not GeoJSON (no FeatureCollection, Feature or LineString)")
    finder = _Finder()
    finder.find(document, "", 0)
    others = counted([(count, name) for name, count in finder.others.items()])
    line = the_one(finder.lines, "lines (LineString)", others)
    if not isinstance(line, Sequence) or not line:
        raise FaultError("has a line without coordinates")
    points = [_point(position, f"position {index}") for index, position in enumerate(line, start=1)]
    left_out = [others] if others else []
    if any(isinstance(position, list) and len(position) > 3 for position in line):
        left_out.append("what follows the altitude in a position")
    return route(points, None, heights, left_out)


class _Finder:
    """Finds the lines of a document, with the names of their features."""

    def __init__(self) -> None:
        self.lines: list[tuple[str, object]] = []
        self.others: Counter[str] = Counter()

    def find(self, shape: object, name: str, depth: int) -> None:
        if depth > _MOST_NESTED_LEVELS:
            raise FaultError("is nested too deeply")
        if shape is None:  # a feature without a geometry
            return
        if not isinstance(shape, Mapping):
            raise FaultError(f"has {shown(shape)}, which is no GeoJSON")
        _require_degrees(shape)
        kind = shape.get("type")
        if kind == "Feature":
            self.find(shape.get("geometry"), _name(shape.get("properties")), depth + 1)
        elif kind in ("FeatureCollection", "GeometryCollection"):
            for each in _list(shape.get("features" if kind == "FeatureCollection" else "geometries")):
                self.find(each, name, depth + 1)
        elif kind == "LineString":
            self.lines.append((name, shape.get("coordinates")))
        elif kind == "MultiLineString":
            self.lines += [(name, each) for each in _list(shape.get("coordinates"))]
        elif kind in _SHAPES:
            self.others[str(kind).lower().removeprefix("multi")] += 1
        else:
            raise FaultError(f"has a shape of the type {shown(kind)}, which is none of GeoJSON")


def _list(value: object) -> list[object]:
    if isinstance(value, list):
        return value
    raise FaultError(f"has {shown(value)} instead of a list")


def _name(properties: object) -> str:
    return str(properties.get("name") or "") if isinstance(properties, Mapping) else ""


def _require_degrees(shape: Mapping[str, object]) -> None:
    system = shape.get("crs")
    if system is None:
        return
    properties = system.get("properties") if isinstance(system, Mapping) else None
    name = _name(properties)
    if not name.endswith(_DEGREES):
        raise FaultError(f"is in the coordinate system {shown(name)}: export it in WGS 84 (EPSG:4326)")


def _point(position: object, where: str) -> RoutePoint:
    if not isinstance(position, list) or len(position) < 2:
        raise FaultError(f"{shown(position)} is not [LONGITUDE, LATITUDE, ALTITUDE]", where)
    longitude_deg, latitude_deg = (_json.number(each, "a coordinate", where) for each in position[:2])
    altitude_m = _json.number(position[2], "its altitude", where) if len(position) > 2 else None
    return RoutePoint(where, latitude_deg, longitude_deg, altitude_m)
