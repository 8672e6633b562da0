"""Flies a mission of MAVLink on paper: its items in the order in which an autopilot would carry them out.

Sources: MAVLink's MAV_CMD and MAV_FRAME; what PX4 1.17 (mavlink_mission.cpp, mission_block.cpp, navigator_main.cpp)
and ArduCopter 4.6 (AP_Mission.cpp, mode_auto.cpp) make of an item's fields.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from ual.geometry import wrap_angle
from ual.routes import _commands as commands
from ual.routes import _json
from ual.routes._route import MOST_HOLD_S, MOST_WAYPOINTS, FaultError, Route, geo_waypoint, is_same_position, listed
from ual.types import AltitudeReference, GeoWaypoint

_ABOVE = {
    0: AltitudeReference.AMSL,
    5: AltitudeReference.AMSL,
    3: AltitudeReference.HOME,
    6: AltitudeReference.HOME,
}
"""References of altitudes, by MAV_FRAME."""
_FRAMES = {10: "above the terrain", 11: "above the terrain", 1: "local", 2: "no frame of a position", 4: "local"}
_SPEEDS_ALONG = (0, 1)
"""Kinds of DO_CHANGE_SPEED (SPEED_TYPE) along the path: airspeed and ground speed. The others are climb and descent."""
_ENDS = {commands.RETURN_TO_LAUNCH: "return to launch", commands.LAND: "landing"}
_UNCHANGED_SPEED_M_S = -1.0
MOST_ITEMS = 100_000
"""No file has more of them that fly `MOST_WAYPOINTS`."""
_MOST_STEPS = 100_000
"""A loop of jumps that meets no waypoint ends at this number of items."""


class Firmware(Enum):
    """Firmware for which a mission was made: it decides the meaning of the mission's fields."""

    PX4 = "PX4"
    ARDUPILOT = "ArduPilot"
    OTHER = "another autopilot, or any"


@dataclass(frozen=True, slots=True)
class RouteItem:
    """One item; `params` are the seven as the file has them: numbers, None, or what is no number."""

    number: str
    command: int
    frame: int
    params: Sequence[object]
    jump_id: int
    waits: bool = False
    """Whether the mission waits for an operator there (``autoContinue`` is false)."""
    line: str = ""

    @property
    def where(self) -> str:
        """The place in the file, for messages."""
        return f"{self.line}item {self.number}"

    def param(self, number: int) -> float | None:
        """Returns the parameter of this number (1 to 7), or None for null. Raises `FaultError`."""
        return _json.optional(self.params[number - 1], f"parameter {number}", self.where)

    def amount(self, number: int) -> float:
        """As `param`, with 0 for null."""
        return self.param(number) or 0.0


def at_most(most: int, items: Iterable[RouteItem]) -> Iterator[RouteItem]:
    """Yields items, and raises `FaultError` at once where there are more than `most`."""
    for count, item in enumerate(items):
        if count >= most:
            raise FaultError(f"has more than {most} items: fly it in parts")
        yield item


def fly(items: Sequence[RouteItem], firmware: Firmware) -> Route:
    """Returns the way of a mission. Raises `FaultError`, with the number of the item that cannot be flown."""
    return _Flight(items, firmware).route()


class _Flight:
    """Carries out items. A change of speed applies to all waypoints after it."""

    def __init__(self, items: Sequence[RouteItem], firmware: Firmware) -> None:
        self._items, self._firmware = items, firmware
        self._indices = _indices(items)
        self._jumps: Counter[int] = Counter()
        self._speed_m_s = 0.0
        self._condition: RouteItem | None = None
        self._first_yaw_rad: float | None = None
        self._waypoints: list[GeoWaypoint] = []
        self._speeds_m_s: list[float] = []
        self._holds_s: list[float] = []
        self._left_out: dict[str, dict[str, None]] = {}
        self._actions: Mapping[int, Callable[[RouteItem], None]] = {
            commands.WAYPOINT: self._waypoint,
            commands.LOITER_TIME: self._waypoint,
            commands.LOITER_UNLIMITED: self._waypoint,
            commands.RETURN_TO_LAUNCH: self._end,
            commands.LAND: self._end,
            commands.TAKEOFF: self._take_off,
            commands.DELAY: self._delay,
            commands.CHANGE_SPEED: self._change_speed,
            commands.CONDITION_YAW: self._turn,
            commands.CONDITION_DELAY: self._delay_others,
            commands.CONDITION_DISTANCE: self._delay_others,
        }

    def route(self) -> Route:
        index = steps = 0
        while index < len(self._items):
            item = self._items[index]
            steps += 1
            if steps > _MOST_STEPS or len(self._waypoints) > MOST_WAYPOINTS:
                raise FaultError(f"the plan flies more than {MOST_WAYPOINTS} waypoints: jump fewer times", item.where)
            if item.command == commands.JUMP:
                index = self._jump(item, index)
            else:
                self._carry_out(item, index)
                index += 1
        left_out = [f"{listed(list(numbers))}: {what}" for what, numbers in self._left_out.items()]
        speeds = self._speeds_m_s if any(self._speeds_m_s) else []
        return Route(self._waypoints, speeds, left_out, self._holds_s if any(self._holds_s) else ())

    def _carry_out(self, item: RouteItem, index: int) -> None:
        action = self._actions.get(item.command)
        if action is not None:
            action(item)
        elif item.command in commands.HARMLESS or _ends_interest(item):
            self._leave_out(item, commands.HARMLESS.get(item.command, commands.HARMLESS[commands.ROI_NONE]))
        else:
            raise _unsupported(item)
        if (end := self._end_of(item)) is not None:
            self._require_last(item, index, end)

    def _end_of(self, item: RouteItem) -> str | None:
        """Returns why nothing can be flown after an item; None where the mission goes on."""
        if item.command in _ENDS:
            return f"it is a {_ENDS[item.command]}, which ends a path"
        if item.command == commands.LOITER_UNLIMITED:
            return "the plan stays there without an end"
        if item.waits and self._firmware is not Firmware.ARDUPILOT:
            return "the plan waits there for an operator (autoContinue is false)"
        return None

    def _waypoint(self, item: RouteItem) -> None:
        self._condition = None
        waypoint = self._position(item)
        if not self._waypoints and waypoint.yaw_rad is None:
            waypoint = replace(waypoint, yaw_rad=self._first_yaw_rad)
        self._add(waypoint, 0.0 if item.command == commands.LOITER_UNLIMITED else max(0.0, item.amount(1)), item)
        if item.command == commands.WAYPOINT and (item.amount(2) or item.amount(3)):
            self._leave_out(item, "the radius within which it is passed (the corner radius says how corners are flown)")

    def _position(self, item: RouteItem) -> GeoWaypoint:
        reference = _ABOVE.get(item.frame)
        if reference is None:
            kind = _FRAMES.get(item.frame, "another one")
            raise FaultError(
                f"its position is in MAV_FRAME {item.frame} ({kind}); UAL needs altitudes above the launch position or "
                "mean sea level",
                item.where,
            )
        if item.params[4] is None or item.params[5] is None:
            raise FaultError("it has no position (null): give it one, or delete it", item.where)
        latitude_deg, longitude_deg = (_json.number(item.params[i], f"parameter {i + 1}", item.where) for i in (4, 5))
        altitude_m = _json.number(item.params[6], "its altitude", item.where)
        if altitude_m == 0.0 and self._firmware is Firmware.ARDUPILOT:
            raise FaultError("altitude 0 is for ArduPilot that of the waypoint before: give the altitude", item.where)
        return geo_waypoint(latitude_deg, longitude_deg, altitude_m, reference, item.where, self._yaw_rad(item))

    def _yaw_rad(self, item: RouteItem) -> float | None:
        """Returns the heading at a waypoint, which ArduCopter ignores; a loiter with a time has one for PX4 only."""
        yaw_deg = item.param(4)
        if yaw_deg is None or (item.command == commands.LOITER_TIME and self._firmware is not Firmware.PX4):
            return None
        if self._firmware is Firmware.ARDUPILOT:
            if yaw_deg:
                self._leave_out(item, "the heading (parameter 4), which ArduPilot ignores")
            return None
        return from_north(yaw_deg)

    def _add(self, waypoint: GeoWaypoint, hold_s: float, item: RouteItem) -> None:
        """Adds a waypoint. One at the place of the one before is only a longer stay there."""
        before = self._waypoints[-1] if self._waypoints else None
        if before and is_same_position(before, waypoint) and waypoint.yaw_rad in (None, before.yaw_rad):
            self._hold(hold_s, item)
            return
        self._waypoints.append(waypoint)
        self._speeds_m_s.append(self._speed_m_s)
        self._holds_s.append(0.0)
        self._hold(hold_s, item)

    def _hold(self, hold_s: float, item: RouteItem) -> None:
        self._holds_s[-1] += hold_s
        if self._holds_s[-1] > MOST_HOLD_S:
            raise FaultError(f"it holds for {self._holds_s[-1]:g} s; a path may hold for {MOST_HOLD_S:g} s", item.where)

    def _end(self, item: RouteItem) -> None:
        self._leave_out(item, _ENDS[item.command])

    def _require_last(self, item: RouteItem, index: int, why: str) -> None:
        for later in self._items[index + 1 :]:
            if commands.is_moving(later.command):
                raise FaultError(f"{why}, but item {later.number} flies on: fly the plan in parts", item.where)

    def _take_off(self, item: RouteItem) -> None:
        if self._waypoints:
            raise FaultError("it is a take-off amid the plan: fly the plan in parts", item.where)
        self._leave_out(item, "take-off")

    def _delay(self, item: RouteItem) -> None:
        seconds = item.amount(1)
        if seconds <= 0.0:
            if self._firmware is not Firmware.PX4:  # which reads the first parameter only
                raise FaultError(
                    "it waits until a time of the day: give seconds (parameter 1), or use --at", item.where
                )
        elif self._waypoints:
            self._hold(seconds, item)
        else:
            self._leave_out(item, f"a delay of {seconds:g} s before the first waypoint")

    def _delay_others(self, item: RouteItem) -> None:
        self._condition = item
        self._leave_out(item, "what its camera or payload waits for")

    def _change_speed(self, item: RouteItem) -> None:
        self._require_no_condition(item)
        if item.amount(1) not in _SPEEDS_ALONG:
            raise FaultError("it sets the speed of climbs or descents; a path has one speed for each leg", item.where)
        if item.amount(4):
            raise FaultError("it changes the speed by an amount (parameter 4); give the speed itself", item.where)
        speed_m_s = item.amount(2)
        if speed_m_s > 0.0:
            self._speed_m_s = speed_m_s
        elif self._firmware is Firmware.PX4 or (self._firmware is Firmware.OTHER and speed_m_s != _UNCHANGED_SPEED_M_S):
            self._speed_m_s = 0.0  # back to the vehicle's own; ArduPilot changes nothing

    def _turn(self, item: RouteItem) -> None:
        """Turns at the waypoint before; before the first one, on the way there."""
        self._require_no_condition(item)
        if item.amount(4):
            raise FaultError(
                "it turns by an angle relative to a heading that is not known: give the heading", item.where
            )
        yaw_rad = from_north(_json.number(item.params[0], "the heading (parameter 1)", item.where))
        if self._waypoints:
            self._add(replace(self._waypoints[-1], yaw_rad=yaw_rad), 0.0, item)
        else:
            self._first_yaw_rad = yaw_rad
        if item.amount(2) or item.amount(3):
            self._leave_out(item, "the rate and the side of the turn (flown by the smaller angle)")

    def _require_no_condition(self, item: RouteItem) -> None:
        if self._condition is not None:
            raise FaultError(
                f"it takes effect amid a leg (item {self._condition.number} delays it); UAL changes speed and heading "
                "at waypoints: delete one of them",
                item.where,
            )

    def _jump(self, item: RouteItem, index: int) -> int:
        target, times = (_json.whole(item.params[i], f"parameter {i + 1}", item.where) for i in (0, 1))
        if target not in self._indices:
            raise FaultError(f"it jumps to item {target}, which there is not", item.where)
        if times < 0:
            raise FaultError("it repeats without an end: give a number of times (parameter 2)", item.where)
        if self._jumps[index] == times:
            return index + 1
        self._jumps[index] += 1  # never set back: PX4 and ArduPilot count each jump over the whole mission
        return self._indices[target]

    def _leave_out(self, item: RouteItem, what: str) -> None:
        self._left_out.setdefault(what, {})[item.number] = None


def _indices(items: Sequence[RouteItem]) -> Mapping[int, int]:
    """Returns at which index the target of a jump is: by the items' numbers for jumps, else by their order from 1."""
    found = {item.jump_id: index for index, item in enumerate(items)}
    return found if len(found) == len(items) else {index + 1: index for index in range(len(items))}


def _ends_interest(item: RouteItem) -> bool:
    return item.command in (commands.SET_ROI, commands.NAV_ROI) and not any(map(_is_present, item.params))


def _is_present(value: object) -> bool:
    return value is not None and value != 0.0


def _unsupported(item: RouteItem) -> FaultError:
    what = commands.NOT_FLOWN.get(item.command)
    if what is None:
        return FaultError(
            f"MAVLink command {item.command} is not known to UAL, so it may change the flight: delete it", item.where
        )
    where = item.where
    return FaultError(f"UAL cannot fly {what} (MAVLink command {item.command}) in a path: replace or delete it", where)


def from_north(yaw_deg: float) -> float:
    """Turns a heading clockwise from north into one of REP 103."""
    return wrap_angle(math.pi / 2 - math.radians(math.fmod(yaw_deg, 360.0)))
