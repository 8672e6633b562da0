"""Reads routes from files: UAL's own waypoint files, QGroundControl's ``.plan``, Mission Planner's ``.waypoints``, KML
and KMZ (Google Earth, QGIS, ...), GPX and GeoJSON.

`Uav.follow_path` takes the waypoints of a route, with their speeds and holds. Whatever else a file contains (a
take-off, camera commands) is not flown; `Route.left_out` lists it. What changes the flight and cannot be flown is
refused, with its number in the file.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ual.shared.late import late

if TYPE_CHECKING:
    from ual.routes._files import MOST_BYTES as MOST_BYTES
    from ual.routes._files import (
        BareAngleError,
        Route,
        RouteError,
        parse,
        parse_angle,
        parse_kml,
        parse_lines,
        parse_list,
        parse_plan,
        parse_waypoint,
        parse_waypoints,
        read,
    )

__all__ = [
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

if not TYPE_CHECKING:  # a type checker would take any name for one of ours
    # A daemon reads no files, though `ual.missions` uses the other modules.
    __getattr__ = late("ual.routes", "_files", "MOST_BYTES", *__all__)
