"""GPX 1.0 and 1.1 (GPS receivers, route planners, ``ual record export --gpx``).

Source: https://www.topografix.com/GPX/1/1/. Of an elevation it says only that it is in metres.
"""

from __future__ import annotations

from ual.routes import _xml
from ual.routes._points import Heights, RoutePoint, counted, number, route, the_one
from ual.routes._route import FaultError, Route


def read(root: _xml.Element, heights: Heights) -> Route:
    """Reads the one route or track of a document. Raises `FaultError`."""
    parts = [(of_route.value("name"), of_route) for of_route in root.own("rte")]
    parts += [(track.value("name"), segment) for track in root.own("trk") for segment in track.own("trkseg")]
    lines = [(name, line) for name, line in parts if line.own("rtept") or line.own("trkpt")]
    waypoints = counted([(len(root.own("wpt")), "waypoint")])
    has = f"{waypoints}, which have no order" if waypoints else ""
    line = the_one(lines, "routes (rte) and segments of tracks (trkseg)", has)
    points = [_point(point) for point in (*line.own("rtept"), *line.own("trkpt"))]
    left_out = [waypoints] if waypoints else []
    if line.name == "trkseg":
        left_out.append("the times of the track")
    if any(line.all("rpt")):
        left_out.append("the points between those of the route (Garmin's rpt)")
    return route(points, None, heights, left_out)


def _point(point: _xml.Element) -> RoutePoint:
    where = f"line {point.line}"
    latitude_deg = number(point.attributes.get("lat"), "latitude (lat)", where)
    longitude_deg = number(point.attributes.get("lon"), "longitude (lon)", where)
    elevation = point.own("ele")
    if len(elevation) > 1:
        raise FaultError("it has more than one elevation (ele)", where)
    altitude_m = number(elevation[0].text, "elevation (ele)", where) if elevation else None
    return RoutePoint(where, latitude_deg, longitude_deg, altitude_m)
