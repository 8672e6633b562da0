"""GPX 1.0 and 1.1 (GPS receivers, route planners, ``ual record export --gpx``).

Source: https://www.topografix.com/GPX/1/1/. Of an elevation it says only that it is in metres.
"""

from __future__ import annotations

from ual.routes import _xml
from ual.routes._places import Heights, Place, counted, number, route, the_one
from ual.routes._route import FaultError, Route


def read(root: _xml.Element, heights: Heights) -> Route:
    """Reads the one route or track of a document. Raises `FaultError`."""
    routes, tracks = root.own("rte"), root.own("trk")
    segments = [(track.value("name"), segment) for track in tracks for segment in track.own("trkseg")]
    lines = [(each.value("name"), each) for each in routes] + segments
    waypoints = counted([(len(root.own("wpt")), "waypoint")])
    has = f"{waypoints}, which have no order: join them to a route" if waypoints else ""
    line = the_one(lines, "routes (rte) and segments of tracks (trkseg)", has)
    places = [_place(point) for point in (*line.own("rtept"), *line.own("trkpt"))]
    if not places:
        raise FaultError("has a route without points")
    left_out = [waypoints] if waypoints else []
    if line.name == "trkseg":
        left_out.append("the times of the track")
    return route(places, None, heights, left_out)


def _place(point: _xml.Element) -> Place:
    where = f"line {point.line}"
    latitude_deg = number(point.attributes.get("lat"), "latitude (lat)", where)
    longitude_deg = number(point.attributes.get("lon"), "longitude (lon)", where)
    elevation = point.own("ele")
    altitude_m = number(elevation[0].text, "elevation (ele)", where) if elevation else None
    return Place(where, latitude_deg, longitude_deg, altitude_m)
