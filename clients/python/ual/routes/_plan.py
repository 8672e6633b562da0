"""QGroundControl's plans (``.plan``), and the missions of its older versions, which have the same items.

Source: QGroundControl's plan file format
(https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html); MissionItem.cc for older versions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from ual.routes import _json
from ual.routes._mission import MOST_ITEMS, Firmware, RouteItem, at_most, fly
from ual.routes._route import FaultError, Route, naming
from ual.shared.numbers import shown

_KEYS = {"fileType", "mission", "firmwareType", "MAV_AUTOPILOT"}
_MISSION_KEYS = ("items", "firmwareType", "vehicleType", "plannedHomePosition", "complexItems")
_ITEM_KEYS = (
    *("type", "command", "frame", "params", "doJumpId", "autoContinue", "Altitude", "AltitudeMode"),
    *("AMSLAltAboveTerrain", "coordinate", "id", "param1", "param2", "param3", "param4"),
)
"""Keys of items that have an effect, of older versions, too."""
_FIRMWARES = {3: Firmware.ARDUPILOT, 12: Firmware.PX4}
_NOT_IN_THE_AIR = {10: "a rover", 11: "a boat", 12: "a submarine"}
_CALCULATED_ABOVE_TERRAIN, _ABOVE_TERRAIN = 3, 4
_FRAMES = {1: (3, 6), 2: (0, 5)}
"""The frames of the modes of an altitude: above the launch position, and above mean sea level."""
_SAME_ALTITUDE_M = 0.01
_TERRAIN_FRAME_CODE = 10
_MOST_NESTED_LEVELS = 10
_NO_FORMAT = "is not in QGroundControl's format"


def parse_plan(text: str, name: str) -> Route:
    """Parses the mission of a ``.plan`` file; surveys and corridors by the items that QGroundControl made of them.
    Raises `RouteError`.
    """
    with naming(name):
        try:
            document = _json.parsed(text)
        except _json.JsonError as error:
            raise FaultError(f"is not a plan of QGroundControl: line {error.line}: {error}") from None
        return read(document)


def is_plan(document: object) -> bool:
    """Returns whether a document is of QGroundControl."""
    return isinstance(document, Mapping) and bool(_KEYS & document.keys())


def read(document: object) -> Route:
    """Reads a plan. Raises `FaultError`."""
    items, firmware = items_of(document)
    route = fly(items, firmware)
    if not route.waypoints:
        raise FaultError("has no waypoints to fly to")
    about = other_parts(document)
    return replace(route, left_out=[*route.left_out, *about])


def other_parts(document: object) -> list[str]:
    """Returns what a plan has besides its mission."""
    parts = document if isinstance(document, Mapping) else {}
    fence, rally = parts.get("geoFence"), parts.get("rallyPoints")
    if any(_holds(fence, key) for key in ("polygons", "circles", "polygon")) or _holds(rally, "points"):
        return ["the geofence and rally points (`ual fence upload` uploads them)"]
    return []


def planned_home(document: object) -> tuple[float, float] | None:
    """Returns where a plan is to take off; None if it does not say."""
    home = _mission(document).get("plannedHomePosition")
    if not isinstance(home, list) or len(home) < 2:
        return None
    latitude_deg, longitude_deg = home[:2]
    if not (isinstance(latitude_deg, float) and isinstance(longitude_deg, float)):
        return None
    return latitude_deg, longitude_deg


def items_of(document: object, most: int = MOST_ITEMS) -> tuple[list[RouteItem], Firmware]:
    """Returns the items of a plan, and for whose autopilot it was made. Raises `FaultError`, also where there are more
    than `most` items.
    """
    mission = _mission(document)
    items = mission.get("items")
    if not isinstance(document, Mapping) or not isinstance(items, list):
        raise FaultError("is not a plan of QGroundControl (no mission with items)")
    if document.get("fileType") == "Plan":
        _json.require_spelled(document, _json.PLAN_KEYS)
    _json.require_spelled(mission, _MISSION_KEYS)
    if mission.get("complexItems"):
        raise FaultError("has a survey of an old QGroundControl: open the file in a current one, and save it")
    if (vehicle := _type(mission, "vehicleType")) in _NOT_IN_THE_AIR:
        raise FaultError(f"is a plan for {_NOT_IN_THE_AIR[vehicle]}")
    made_for = _type(mission, "firmwareType" if "firmwareType" in mission else "MAV_AUTOPILOT")
    firmware = _FIRMWARES.get(made_for, Firmware.OTHER)
    return list(at_most(most, _items(items, ""))), firmware


def _mission(document: object) -> Mapping[str, object]:
    """Returns the part that has the items. In files before plans (``.mission``) that is the whole document."""
    if not isinstance(document, Mapping):
        return {}
    if document.get("fileType") == "Plan":
        found = document.get("mission")
        return found if isinstance(found, Mapping) else {}
    return document if document.keys() & {"MAV_AUTOPILOT", "firmwareType"} else {}


def _type(values: Mapping[str, object], key: str, where: str = "") -> int:
    """Returns a number of MAV_AUTOPILOT, MAV_TYPE or an altitude's mode; 0 (generic) where there is none."""
    return 0 if values.get(key) is None else _json.whole(values[key], key, where)


def _holds(part: object, key: str) -> bool:
    return isinstance(part, Mapping) and bool(part.get(key))


def _items(items: Sequence[object], prefix: str, depth: int = 0) -> Iterator[RouteItem]:
    """Yields the items in their order, those of surveys too: ``3.2`` is the second of item 3."""
    if depth > _MOST_NESTED_LEVELS:
        raise FaultError(_NO_FORMAT, f"item {prefix}")
    for index, item in enumerate(items, start=1):
        number = f"{prefix}{index}"
        if not isinstance(item, Mapping):
            raise FaultError(_NO_FORMAT, f"item {number}")
        if item.get("type") == "ComplexItem":
            yield from _items(_parts(item, number), f"{number}.", depth + 1)
        else:
            yield _simple(item, number)


def _parts(item: Mapping[str, object], number: str) -> Sequence[object]:
    """Returns the items that QGroundControl made of a survey or corridor."""
    transects = item.get("TransectStyleComplexItem")
    inner = transects.get("Items") if isinstance(transects, Mapping) else None
    if not isinstance(inner, list) or not inner:
        raise FaultError(f"UAL cannot fly a {shown(item.get('complexItemType'))} item: delete it", f"item {number}")
    return inner


def _simple(item: Mapping[str, object], number: str) -> RouteItem:
    where = f"item {number}"
    _json.require_spelled(item, _ITEM_KEYS, where)
    command, frame = (_json.whole(item.get(key), key, where) for key in ("command", "frame"))
    jump_id = item.get("doJumpId", item.get("id"))
    params = _params(item, where)
    goes_on = item.get("autoContinue", True)
    if not isinstance(goes_on, bool):
        raise FaultError(f"autoContinue is {shown(goes_on)}, neither true nor false", where)
    _require_one_altitude(item, frame, params[6], where)
    return RouteItem(
        number,
        command,
        _frame(item, frame, where),
        params,
        int(jump_id) if isinstance(jump_id, float) and jump_id.is_integer() else -1,
        waits=not goes_on,
    )


def _frame(item: Mapping[str, object], frame: int, where: str) -> int:
    """Returns the frame of an item; that above the terrain where only the mode of its altitude says so."""
    mode = item.get("AltitudeMode")
    if mode == _CALCULATED_ABOVE_TERRAIN and item.get("AMSLAltAboveTerrain") is None:
        raise FaultError("its altitude above the terrain was never turned into one above mean sea level", where)
    return _TERRAIN_FRAME_CODE if mode == _ABOVE_TERRAIN else frame


def _require_one_altitude(item: Mapping[str, object], frame: int, altitude: object, where: str) -> None:
    """Refuses an item that says in two ways what its altitude is: QGroundControl would upload another one."""
    mode, meant = _type(item, "AltitudeMode", where), item.get("Altitude")
    frames = _FRAMES.get(mode)
    if frames is None or frame not in (*_FRAMES[1], *_FRAMES[2]):
        return
    if frame not in frames:
        raise FaultError(f"its AltitudeMode is {mode}, but its frame {frame}", where)
    if isinstance(meant, float) and isinstance(altitude, float) and abs(meant - altitude) > _SAME_ALTITUDE_M:
        raise FaultError(f"its Altitude is {meant:g}, but its parameter 7 {altitude:g}", where)


def _params(item: Mapping[str, object], where: str) -> Sequence[object]:
    """Returns the seven parameters. Older versions have the position, and before that all of them, separately."""
    params = item.get("params")
    if params is None:
        params = [item.get(f"param{number}") for number in (1, 2, 3, 4)]
    coordinate = item.get("coordinate", [])
    if not isinstance(params, list) or not isinstance(coordinate, list):
        raise FaultError(_NO_FORMAT, where)
    params = [*params[:4], *coordinate] if coordinate else params
    if len(params) != 7:
        raise FaultError(_NO_FORMAT, where)
    return params
