"""Reads routes from files: UAL's own waypoint files, QGroundControl's ``.plan``, and KML (Google Earth, QGIS, ...).

`Uav.follow_path` takes the waypoints of a route, with their speeds and holds. Whatever else a file contains (a
take-off, camera commands) is not flown; `Route.left_out` lists it.

Sources: QGroundControl's plan file format (https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html)
with MAVLink's MAV_CMD and MAV_FRAME; OGC KML 2.3 (OGC 12-007r2), sections 9.11 (LineString) and 9.20 (altitudeMode).
"""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ual.geometry import Pose, PoseStamped, wrap_angle
from ual.types import AltitudeReference, GeoWaypoint

_NAV_WAYPOINT, _NAV_SPLINE, _NAV_TAKEOFF, _DO_CHANGE_SPEED = 16, 82, 22, 178
_SPEEDS_ALONG = (0, 1)
"""Kinds of DO_CHANGE_SPEED (SPEED_TYPE) along the path: airspeed and ground speed. The others are climb and descent."""
_NAV_COMMANDS_BELOW = 96
"""MAV_CMD_NAV_LAST is 95: commands up to this number move the vehicle, those above do not (MAVLink common.xml)."""
_HARMLESS_NAV = {_NAV_TAKEOFF: "take-off", 20: "return to launch", 21: "landing", 93: "delay"}
_AMSL_FRAMES = (0, 5)
_HOME_FRAMES = (3, 6)
_AMSL, _HOME = AltitudeReference.AMSL, AltitudeReference.HOME
_MOST_BYTES = 50_000_000


class BareAngleError(ValueError):
    """An angle without a unit is so large that it cannot be meant in radians; the message says what to write."""


class RouteError(Exception):
    """A file contains no valid route; the message is one line that says where and why."""


@dataclass(frozen=True, slots=True)
class Route:
    """Waypoints, either all with frames or all geographic; `leg_speeds_m_s` is empty or has one for each waypoint (0:
    none given), and so has `holds_s` (how long to hold there, 0: no stop).

    `left_out` lists, as text for people, what else is in the file and is not flown.
    """

    waypoints: Sequence[PoseStamped] | Sequence[GeoWaypoint]
    leg_speeds_m_s: Sequence[float] = ()
    left_out: Sequence[str] = ()
    holds_s: Sequence[float] = ()


def read(file: Path | str, *, frame_id: str = "", altitude_m: float | None = None) -> Route:
    """Reads a route; the file's ending says its format: ``.plan``, ``.kml``, else one waypoint a line.

    `frame_id` is the frame of waypoints (one a line) that name none. `altitude_m` (above home) is for a KML line that
    is clamped to the ground.

    Raises:
        RouteError: The file cannot be read or contains no valid route.
    """
    file = Path(file)
    try:
        if file.stat().st_size > _MOST_BYTES:
            raise RouteError(f"{file} is too large for a route ({file.stat().st_size} bytes)")
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise RouteError(f"cannot read {file}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise RouteError(f"{file} is not a text file") from None
    if file.suffix.lower() == ".plan":
        return parse_plan(text, str(file))
    if file.suffix.lower() == ".kml":
        return parse_kml(text, str(file), altitude_m)
    return parse_list(text, str(file), frame_id)


# --- One waypoint a line ----------------------------------------------------------------------------------------------


def parse_lines(text: str, name: str, frame_id: str = "") -> list[PoseStamped]:
    """Parses one waypoint a line: a JSON object as ``ual waypoints save`` writes it, or ``X,Y,Z[,YAW]``. ``#`` begins a
    comment. Raises `RouteError`.
    """
    return [pose for pose, _ in _lines(text.splitlines(), name, frame_id)]


def parse_list(text: str, name: str, frame_id: str = "") -> Route:
    """Parses one waypoint a line, as `parse_lines`, with the times to hold there. Raises `RouteError`."""
    found = list(_lines(text.splitlines(), name, frame_id))
    holds_s = [hold_s for _, hold_s in found]
    return Route([pose for pose, _ in found], holds_s=holds_s if any(holds_s) else ())


def _lines(lines: Iterable[str], name: str, frame_id: str) -> Iterator[tuple[PoseStamped, float]]:
    """Yields each waypoint, and how long to hold there."""
    for number, raw in enumerate(lines, start=1):
        line = raw.partition("#")[0].strip()
        if not line:
            continue
        try:
            is_json = line.startswith("{")
            yield _from_json(line, frame_id) if is_json else (PoseStamped(parse_waypoint(line), frame_id), 0.0)
        except BareAngleError as error:
            raise RouteError(f"{name}, line {number}: {error}") from None
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
            raise RouteError(
                f'{name}, line {number}: {line!r} is not a waypoint: write X,Y,Z[,YAW] or {{"x": .., "y": .., "z": ..}}'
            ) from None


def _from_json(line: str, frame_id: str) -> tuple[PoseStamped, float]:
    values = json.loads(line)
    yaw_rad = values.get("yaw_rad")
    pose = Pose.at(
        float(values["x"]), float(values["y"]), float(values["z"]), None if yaw_rad is None else float(yaw_rad)
    )
    return PoseStamped(pose, str(values.get("frame_id") or frame_id)), float(values.get("hold_s") or 0.0)


def parse_waypoint(text: str) -> Pose:
    """Parses ``X,Y,Z`` or ``X,Y,Z,YAW``. Raises `ValueError`."""
    x, y, z, *yaw = text.split(",")
    if len(yaw) > 1:
        raise ValueError("more than four numbers")
    return Pose.at(float(x), float(y), float(z), wrap_angle(parse_angle(yaw[0])) if yaw else None)


def parse_angle(text: str) -> float:
    """Parses ``90deg``, ``1.57rad`` or ``1.57``; returns radians.

    Raises:
        BareAngleError: A number without a unit is beyond a full turn: nobody means 90 radians.
        ValueError: It is not an angle.

    """
    text = text.strip()
    if text.endswith("deg"):
        return math.radians(float(text.removesuffix("deg")))
    angle_rad = float(text.removesuffix("rad"))
    if math.tau < abs(angle_rad) < math.inf and not text.endswith("rad"):
        raise BareAngleError(f"{text} radians are more than a full turn: {text}deg? (or {text}rad)")
    return angle_rad


# --- QGroundControl's plan --------------------------------------------------------------------------------------------


def parse_plan(text: str, name: str) -> Route:
    """Parses the mission of a ``.plan`` file; surveys and corridors by the items that QGroundControl made of them.
    Raises `RouteError`.
    """
    try:
        plan = json.loads(text)
        items = plan["mission"]["items"]
        is_plan = plan.get("fileType") == "Plan" and isinstance(items, list)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        is_plan = False
    if not is_plan:
        raise RouteError(f"{name} is not a plan of QGroundControl (no mission with items)")
    reader = _PlanReader(name)
    reader.read(items, "item")
    if not reader.waypoints:
        raise RouteError(f"{name} has no waypoints to fly to")
    speeds = reader.speeds_m_s if any(reader.speeds_m_s) else []
    if any(_holds(plan.get("geoFence"), key) for key in ("polygons", "circles")) or _holds(
        plan.get("rallyPoints"), "points"
    ):
        reader.left_out.append("the geofence and rally points (the daemon has a geofence of its own)")
    return Route(reader.waypoints, speeds, reader.left_out, reader.holds_s if any(reader.holds_s) else ())


def _holds(part: object, key: str) -> bool:
    return isinstance(part, Mapping) and bool(part.get(key))


class _PlanReader:
    """Reads mission items in their order. A change of speed applies to all following waypoints."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._speed_m_s = 0.0
        self.waypoints: list[GeoWaypoint] = []
        self.speeds_m_s: list[float] = []
        self.holds_s: list[float] = []
        self.left_out: list[str] = []

    def read(self, items: Sequence[Any], where: str) -> None:
        """Reads items; `where` names them in errors."""
        for number, item in enumerate(items, start=1):
            place = f"{where} {number}"
            try:
                self._read_item(item, place)
            except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, RecursionError):
                raise RouteError(f"{self._name}, {place}: is not in QGroundControl's format") from None

    def _read_item(self, item: Mapping[str, Any], place: str) -> None:
        if item["type"] == "ComplexItem":
            inner = (item.get("TransectStyleComplexItem") or {}).get("Items")
            if not inner:
                raise RouteError(f"{self._name}, {place}: UAL cannot fly a {item.get('complexItemType')} item")
            self.read(inner, f"{place}, part")
            return
        command, params = int(item["command"]), item["params"]
        if command in (_NAV_WAYPOINT, _NAV_SPLINE):
            self._add(item, params, place)
        elif command == _DO_CHANGE_SPEED and int(params[0]) in _SPEEDS_ALONG:
            self._speed_m_s = max(0.0, float(params[1]))  # negative: no change, or back to the default
        elif command in _HARMLESS_NAV:
            self.left_out.append(f"{place}: {_HARMLESS_NAV[command]}")
        elif command < _NAV_COMMANDS_BELOW:
            raise RouteError(f"{self._name}, {place}: UAL cannot fly the MAVLink command {command} in a path")
        else:
            self.left_out.append(f"{place}: MAVLink command {command}")

    def _add(self, item: Mapping[str, Any], params: Sequence[Any], place: str) -> None:
        hold_s, yaw_deg = float(params[0] or 0.0), params[3]
        frame = int(item["frame"])
        if frame not in (*_AMSL_FRAMES, *_HOME_FRAMES):
            raise RouteError(
                f"{self._name}, {place}: its altitude is in MAV_FRAME {frame} (above the terrain?); UAL needs "
                "altitudes above the launch position or mean sea level"
            )
        yaw_rad = None
        if yaw_deg is not None and math.isfinite(float(yaw_deg)):
            yaw_rad = wrap_angle(math.pi / 2 - math.radians(float(yaw_deg)))  # from clockwise from north to REP 103
        if int(item["command"]) == _NAV_SPLINE:
            self.left_out.append(f"{place}: the curve (flown straight)")
        reference = _AMSL if frame in _AMSL_FRAMES else _HOME
        self.waypoints.append(GeoWaypoint(float(params[4]), float(params[5]), float(params[6]), reference, yaw_rad))
        self.speeds_m_s.append(self._speed_m_s)
        self.holds_s.append(max(0.0, hold_s))


# --- KML --------------------------------------------------------------------------------------------------------------


def parse_kml(text: str, name: str, altitude_m: float | None = None) -> Route:
    """Parses the one line (LineString) of a KML file. Its altitudes are used if its ``altitudeMode`` is ``absolute``
    (mean sea level) or ``relativeToGround`` (taken as above home); else `altitude_m` above home. Raises `RouteError`.
    """
    if re.search(r"<!(DOCTYPE|ENTITY)", text):  # KML has neither, and entities can expand without a limit
        raise RouteError(f"{name} has a document type declaration, which KML does not have")
    try:
        root = ET.fromstring(text)  # noqa: S314  no declarations, see above
    except ET.ParseError as error:
        raise RouteError(f"{name} is not valid XML: {error}") from None
    lines = [element for element in root.iter() if _tag(element) == "LineString"]
    if len(lines) != 1:
        raise RouteError(f"{name} has {len(lines)} lines (LineString); a route needs exactly one")
    values = {_tag(child): (child.text or "").strip() for child in lines[0]}
    mode = values.get("altitudeMode", "clampToGround")
    reference = {"absolute": _AMSL, "relativeToGround": _HOME}.get(mode)
    if reference is None and altitude_m is None:
        raise RouteError(f"{name}: its line lies on the ground ({mode}); give an altitude above home (--altitude)")
    waypoints = []
    for number, place in enumerate(values.get("coordinates", "").split(), start=1):
        try:
            longitude_deg, latitude_deg, *rest = map(float, place.split(","))
            if reference is None:
                assert altitude_m is not None
                waypoints.append(GeoWaypoint(latitude_deg, longitude_deg, altitude_m, _HOME))
            else:
                (height_m,) = rest
                waypoints.append(GeoWaypoint(latitude_deg, longitude_deg, height_m, reference))
        except ValueError:
            raise RouteError(
                f"{name}, place {number}: {place!r} is not LONGITUDE,LATITUDE,ALTITUDE as numbers"
            ) from None
    if not waypoints:
        raise RouteError(f"{name}: its line has no coordinates")
    left_out = []
    if mode == "relativeToGround":
        left_out.append("the height of the ground: altitudes are taken as above home")
    return Route(waypoints, (), left_out)


def _tag(element: ET.Element) -> str:
    """Returns the name of an element without its namespace, which differs between KML 2.0 and 2.3."""
    return element.tag.rpartition("}")[2]
