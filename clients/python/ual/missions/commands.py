"""From the commands of a file, or of an autopilot, to the items of a mission, and why a command is none.

Sources: MAVLink's MAV_CMD; what PX4 1.17 (mavlink_mission.cpp, mission_block.cpp) and ArduCopter 4.6 (AP_Mission.cpp,
mode_auto.cpp) make of an item's fields.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from ual.missions import items as neutral
from ual.missions.items import CameraAction, CameraTrigger
from ual.routes import _commands as commands
from ual.routes import _json
from ual.routes._mission import Firmware, from_north
from ual.routes._mission import RouteItem as FileItem
from ual.routes._route import FaultError, geo_waypoint
from ual.types import AltitudeReference

_NOT_GIVEN = (None, 0.0)
_TRIGGER_DISTANCE, _TRIGGER_INTERVAL, _DIGICAM = 206, 214, 203
_ROI_LOCATION_COMMAND = 195
_START_CAPTURE, _STOP_CAPTURE = 2000, 2001
_ABOVE = {
    0: AltitudeReference.AMSL,
    5: AltitudeReference.AMSL,
    3: AltitudeReference.HOME,
    6: AltitudeReference.HOME,
}
"""References of altitudes, by MAV_FRAME."""
_STAYING = (commands.WAYPOINT, commands.LOITER_TIME, commands.LAND)
"""For ArduPilot these stay where the item before has led, in what they do not give (loc_from_cmd, do_land)."""
_MOST_TIMES = 65_535
"""PX4 keeps how often a jump repeats with 16 bits, ArduPilot with 15."""
_SAME_POSITION_DEG = 3e-5
"""Three metres: a take-off there is one at the planned home, as satellites do not tell them apart."""

Place = tuple[float, float]


class Command(NamedTuple):
    """An item as an autopilot has it: a MAV_CMD, its frame (MAV_FRAME), and its seven numbers; None for none (NaN)."""

    command: int
    frame: int
    params: Sequence[float | None]


def items_on_autopilot(found: Sequence[Command], first_seq: int, *, is_ardupilot: bool) -> list[neutral.Item]:
    """Returns the items of a mission that an autopilot has. What a mission of UAL has not is an `OtherItem`."""
    firmware = Firmware.ARDUPILOT if is_ardupilot else Firmware.PX4
    read = [
        FileItem(str(index + 1), each.command, each.frame, each.params, index + first_seq)
        for index, each in enumerate(found)
    ]
    return _MissionReader(read, firmware, None).items_or_others()


def items_of_file(
    found: Sequence[FileItem], firmware: Firmware, home: Place | None
) -> tuple[list[neutral.Item], list[str]]:
    """Returns the items of a file, and what of them is left out, human-readable.

    `home` is where it plans to take off. Raises `FaultError` with the item's number.
    """
    if not found:
        raise FaultError("has no items")
    reader = _MissionReader(found, firmware, home)
    return reader.items(), reader.left_out


class _MissionReader:
    def __init__(self, found: Sequence[FileItem], firmware: Firmware, home: Place | None) -> None:
        self._found, self._firmware, self._home = found, firmware, home
        self._indices = {item.jump_id: index for index, item in enumerate(found)}
        if len(self._indices) != len(found):
            self._indices = {index + 1: index for index in range(len(found))}
        self._jumped_to = {found[index].number for index in self._targets()}
        self._before: neutral.TakeOff | neutral.Waypoint | None = None
        """Item that leads to the start of the next one; None where that position is not known."""
        self._is_begun_by_interval: list[bool] = []
        """Kind of each trigger of photos so far: whether it is one by time, else by distance."""
        self.left_out: list[str] = []
        self._makers: Mapping[int, Callable[[FileItem], neutral.Item]] = {
            commands.WAYPOINT: self._waypoint,
            commands.LOITER_TIME: self._loiter,
            commands.RETURN_TO_LAUNCH: lambda item: neutral.ReturnToLaunch(number=item.number),
            commands.LAND: self._land,
            commands.TAKEOFF: self._take_off,
            commands.DELAY: self._hold,
            commands.CHANGE_SPEED: self._speed,
            commands.CONDITION_YAW: self._heading,
            commands.JUMP: self._jump,
            _ROI_LOCATION_COMMAND: self._interest,
            commands.SET_ROI: self._old_interest,
            commands.ROI_NONE: lambda item: neutral.RegionOfInterestEnd(number=item.number),
            _TRIGGER_DISTANCE: self._by_distance,
            _START_CAPTURE: self._capture,
            _STOP_CAPTURE: lambda item: self._stop(item, by_interval=True),
        }

    def items(self) -> list[neutral.Item]:
        return [self._item_of_file(each) for each in self._found]

    def items_or_others(self) -> list[neutral.Item]:
        return [self._item_or_other(each) for each in self._found]

    def _targets(self) -> list[int]:
        targets = (each.params[0] for each in self._found if each.command == commands.JUMP)
        return [self._indices[int(each)] for each in targets if isinstance(each, float | int) and each in self._indices]

    def _item_or_other(self, item: FileItem) -> neutral.Item:
        self._before = None  # an autopilot may begin with any item, and then another one is flown before
        try:
            return self._item(item)
        except FaultError as fault:
            return neutral.OtherItem(item.command, fault.text, number=item.number)

    def _item_of_file(self, item: FileItem) -> neutral.Item:
        """Reads an item with all its parameters: none of a file has no effect without a word."""
        made = self._item(item)
        for number in range(1, 8):
            value = item.params[number - 1]
            if number in _READ[item.command] or value in _NOT_GIVEN or isinstance(value, _json.NotJson):
                continue
            ignored = _IGNORED.get((item.command, number))
            if ignored is None:
                value = _json.number(value, f"parameter {number}", item.where)
                self._require_none(item, number, f"has {value:g} as parameter {number}")
            elif ignored:
                self.left_out.append(f"item {item.number}: {ignored}, which multirotors ignore")
        return made

    def _item(self, item: FileItem) -> neutral.Item:
        make = self._makers.get(item.command)
        if make is None:
            raise FaultError(_not_in_missions(item.command), item.where)
        if item.waits:
            raise FaultError("it waits for an operator (autoContinue is false), which ArduPilot ignores", item.where)
        made = make(item)
        if isinstance(made, neutral.TakeOff | neutral.Waypoint):
            self._before = made
        return made

    def _waypoint(self, item: FileItem) -> neutral.Waypoint:
        latitude_deg, longitude_deg, altitude_m, above = self._position(item)
        self._require_none(item, 3, "passes the waypoint at a distance (parameter 3)")
        yaw_deg = item.param(4)
        if self._firmware is Firmware.ARDUPILOT and yaw_deg == 0.0:
            yaw_deg = None  # ArduPilot's files have 0 where nothing is given
        return neutral.Waypoint(
            latitude_deg,
            longitude_deg,
            altitude_m,
            above,
            item.amount(1),
            item.amount(2) or None,
            None if yaw_deg is None else from_north(yaw_deg),
            number=item.number,
        )

    def _loiter(self, item: FileItem) -> neutral.Waypoint:
        latitude_deg, longitude_deg, altitude_m, above = self._position(item)
        return neutral.Waypoint(latitude_deg, longitude_deg, altitude_m, above, item.amount(1), number=item.number)

    def _land(self, item: FileItem) -> neutral.Land:
        self._require_none(item, 2, "is a precision landing (parameter 2)")
        if item.param(7) not in _NOT_GIVEN and item.frame not in _ABOVE:
            raise FaultError(_frame(item), item.where)
        if not self._is_placed(item) and self._firmware is not Firmware.ARDUPILOT:
            raise FaultError("it has no position: give it one, or return to launch", item.where)
        latitude_deg, longitude_deg = self._item_position(item)
        return neutral.Land(latitude_deg, longitude_deg, number=item.number)

    def _take_off(self, item: FileItem) -> neutral.TakeOff:
        altitude_m = _json.number(item.params[6], "its altitude", item.where)
        above = _ABOVE.get(item.frame)
        if above is None:
            raise FaultError(_frame(item), item.where)
        if not self._is_placed(item):
            return neutral.TakeOff(altitude_m, above, number=item.number)
        position = self._item_position(item)
        if self._home is not None and _is_near(position, self._home):
            return neutral.TakeOff(altitude_m, above, number=item.number)
        if self._firmware is Firmware.ARDUPILOT:
            self.left_out.append(f"item {item.number}: the place of the take-off, which ArduPilot ignores")
            return neutral.TakeOff(altitude_m, above, number=item.number)
        return neutral.TakeOff(altitude_m, above, *position, number=item.number)

    def _hold(self, item: FileItem) -> neutral.HoldTime:
        seconds = item.amount(1)
        if seconds <= 0.0:
            raise FaultError("it waits until a time of the day: give seconds (parameter 1)", item.where)
        if any(item.amount(number) > 0.0 for number in (2, 3, 4)):
            raise FaultError("it waits for seconds (parameter 1) and until a time of the day", item.where)
        return neutral.HoldTime(seconds, number=item.number)

    def _speed(self, item: FileItem) -> neutral.Speed:
        if item.amount(1) not in (0.0, 1.0):
            raise FaultError("it sets the speed of climbs or descents, which PX4 takes for any speed", item.where)
        if item.amount(4):
            raise FaultError("it changes the speed by an amount (parameter 4); give the speed itself", item.where)
        if item.amount(2) <= 0.0:
            raise FaultError("it gives no speed, which PX4 and ArduPilot read in two ways: delete it", item.where)
        if item.amount(3) not in (0.0, -1.0):
            raise FaultError("it sets the throttle (parameter 3), which multirotors ignore", item.where)
        return neutral.Speed(item.amount(2), number=item.number)

    def _heading(self, item: FileItem) -> neutral.Heading:
        self._require_none(item, 4, "turns by an angle from a heading that is not known")
        self._require_none(item, 2, "turns at a rate (parameter 2)")
        self._require_none(item, 3, "turns to a side (parameter 3)")
        yaw_deg = _json.number(item.params[0], "the heading (parameter 1)", item.where)
        return neutral.Heading(from_north(yaw_deg), number=item.number)

    def _interest(self, item: FileItem) -> neutral.RegionOfInterest:
        return neutral.RegionOfInterest(*self._position(item), number=item.number)

    def _old_interest(self, item: FileItem) -> neutral.Item:
        """Reads DO_SET_ROI, which has two meanings of its first parameter."""
        if all(value in _NOT_GIVEN for value in item.params):
            return neutral.RegionOfInterestEnd(number=item.number)
        if item.amount(1) not in (0.0, 3.0) or item.params[4] in _NOT_GIVEN:
            raise FaultError("its region of interest is no place", item.where)
        return self._interest(item)

    def _by_distance(self, item: FileItem) -> CameraTrigger:
        """Reads DO_SET_CAM_TRIGG_DIST. Its third parameter is whether a photo is taken at once, also at the end."""
        distance_m, at_once = item.amount(1), item.amount(3)
        if distance_m < 0.0:
            raise FaultError("its distance is negative, which PX4 and ArduPilot read in two ways: 0 ends", item.where)
        if item.amount(2) > 0.0:
            raise FaultError("it sets the time of the shutter (parameter 2), which ArduPilot ignores", item.where)
        if at_once not in (0.0, 1.0):
            raise FaultError(f"its parameter 3 (a photo at once) is {at_once:g}, not 0 or 1", item.where)
        if distance_m == 0.0 and not at_once:
            return self._stop(item, by_interval=False)
        if distance_m == 0.0:
            return CameraTrigger(CameraAction.STOP_WITH_PHOTO, number=item.number)
        self._is_begun_by_interval.append(False)
        action = CameraAction.BY_DISTANCE if at_once else CameraAction.BY_DISTANCE_LATER
        return CameraTrigger(action, distance_m, number=item.number)

    def _stop(self, item: FileItem, *, by_interval: bool) -> CameraTrigger:
        """Reads the end of one kind of trigger. `CameraAction.STOP` ends the kind that has begun last.

        QGroundControl ends both kinds at once, by two items in a row.
        """
        begun = self._is_begun_by_interval
        is_other = bool(begun) and begun[-1] is not by_interval
        if is_other and (by_interval in begun or not self._is_next_to_stop(item, by_interval=not by_interval)):
            ended, lasts = ("time", "distance") if by_interval else ("distance", "time")
            raise FaultError(f"it ends a trigger by {ended}, but one by {lasts} was begun last", item.where)
        return CameraTrigger(CameraAction.STOP, number=item.number)

    def _is_next_to_stop(self, item: FileItem, *, by_interval: bool) -> bool:
        at = next(index for index, each in enumerate(self._found) if each is item)
        neighbours = self._found[max(0, at - 1) : at + 2]
        if by_interval:
            return any(each.command == _STOP_CAPTURE for each in neighbours)
        return any(each.command == _TRIGGER_DISTANCE and each.params[0] in _NOT_GIVEN for each in neighbours)

    def _capture(self, item: FileItem) -> CameraTrigger:
        self._require_none(item, 1, "chooses one of several cameras (parameter 1)")
        interval_s, count = item.amount(2), item.amount(3)
        if count == 1.0:
            return CameraTrigger(CameraAction.ONCE, number=item.number)
        if count or interval_s <= 0.0:
            raise FaultError("it takes a number of photos; a mission takes one, or one each interval", item.where)
        self._is_begun_by_interval.append(True)
        return CameraTrigger(CameraAction.BY_INTERVAL, interval_s, number=item.number)

    def _jump(self, item: FileItem) -> neutral.Jump:
        target, times = (_json.whole(item.params[i], f"parameter {i + 1}", item.where) for i in (0, 1))
        if target not in self._indices:
            raise FaultError(f"it jumps to item {target}, which there is not", item.where)
        if times < 1:
            raise FaultError("it repeats without an end, or never: give a number of times (parameter 2)", item.where)
        if times > _MOST_TIMES:
            raise FaultError(f"it repeats {times:g} times, more than an autopilot can count", item.where)
        return neutral.Jump(self._indices[target] + 1, times, number=item.number)

    def _position(self, item: FileItem) -> tuple[float, float, float, AltitudeReference]:
        above = _ABOVE.get(item.frame)
        if above is None:
            raise FaultError(_frame(item), item.where)
        altitude_m = _json.number(item.params[6], "its altitude", item.where)
        if altitude_m == 0.0 and self._firmware is Firmware.ARDUPILOT and item.command in _STAYING:
            altitude_m = self._altitude_before(item, above)
        return *self._item_position(item), altitude_m, above

    def _altitude_before(self, item: FileItem, above: AltitudeReference) -> float:
        """Returns the altitude of the item before, which is what ArduPilot reads in an altitude of 0."""
        before = self._item_before(item)
        if before is None or before.altitude_reference is not above:
            text = "altitude 0 is for ArduPilot that of the item flown before, which is not known: give the altitude"
            raise FaultError(text, item.where)
        return before.altitude_m

    def _position_before(self, item: FileItem) -> Place:
        """Returns where the item before leads, which is what ArduPilot reads in latitude 0, longitude 0."""
        before = self._item_before(item)
        if before is None or before.latitude_deg is None or before.longitude_deg is None:
            text = "no position is for ArduPilot that of the item flown before, which is not known: give the position"
            raise FaultError(text, item.where)
        return before.latitude_deg, before.longitude_deg

    def _item_before(self, item: FileItem) -> neutral.TakeOff | neutral.Waypoint | None:
        """Returns what leads to where an item begins; None where that depends on a jump."""
        return None if item.number in self._jumped_to else self._before

    def _is_placed(self, item: FileItem) -> bool:
        return item.params[4] not in _NOT_GIVEN or item.params[5] not in _NOT_GIVEN

    def _item_position(self, item: FileItem) -> Place:
        if self._firmware is Firmware.ARDUPILOT and item.command in _STAYING and not self._is_placed(item):
            return self._position_before(item)
        if item.params[4] is None or item.params[5] is None:
            raise FaultError("it has no position (null): give it one, or delete it", item.where)
        latitude_deg, longitude_deg = (_json.number(item.params[i], f"parameter {i + 1}", item.where) for i in (4, 5))
        geo_waypoint(latitude_deg, longitude_deg, 0.0, AltitudeReference.HOME, item.where)
        return latitude_deg, longitude_deg

    def _require_none(self, item: FileItem, number: int, what: str) -> None:
        if item.amount(number):
            raise FaultError(f"it {what}, which a mission of UAL has not: delete that", item.where)


def _is_near(one: Place, other: Place) -> bool:
    shrinks = math.cos(math.radians(one[0]))
    return math.hypot(one[0] - other[0], (one[1] - other[1]) * shrinks) < _SAME_POSITION_DEG


def _frame(item: FileItem) -> str:
    kind = "above the terrain" if item.frame in (10, 11) else "another one"
    return f"its position is in MAV_FRAME {item.frame} ({kind}); a mission needs altitudes above home or mean sea level"


def _not_in_missions(command: int) -> str:
    what = _REFUSED.get(command) or commands.NOT_FLOWN.get(command) or commands.HARMLESS.get(command)
    named = f"has {what}, which a mission of UAL has not" if what else "is not known to UAL"
    return f"it {named} (MAVLink command {command}): delete it"


_READ: Mapping[int, Sequence[int]] = {
    commands.WAYPOINT: range(1, 8),
    commands.LOITER_TIME: (1, 5, 6, 7),
    commands.RETURN_TO_LAUNCH: (),
    commands.LAND: (2, 5, 6),
    commands.TAKEOFF: (5, 6, 7),
    commands.DELAY: (1, 2, 3, 4),
    commands.CHANGE_SPEED: (1, 2, 3, 4),
    commands.CONDITION_YAW: (1, 2, 3, 4),
    commands.JUMP: (1, 2),
    _ROI_LOCATION_COMMAND: (5, 6, 7),
    commands.SET_ROI: (1, 5, 6, 7),
    commands.ROI_NONE: (),
    _TRIGGER_DISTANCE: (1, 2, 3),
    _START_CAPTURE: (1, 2, 3),
    _STOP_CAPTURE: (),
}
"""The parameters of each command that are read or assessed."""
_IGNORED = {
    (commands.TAKEOFF, 1): "the pitch of the take-off",
    (commands.LAND, 7): "the altitude of the landing",
    (commands.LOITER_TIME, 2): "the heading before it goes on",
    (commands.LOITER_TIME, 3): "the radius of the loiter",
    (_START_CAPTURE, 4): "",
}
"""Parameters without an effect on a multirotor; empty: not worth a word (the number of a photo)."""
_REFUSED = {
    commands.LOITER_UNLIMITED: "a stay without an end",
    commands.CONDITION_DELAY: "a condition (a delay), which PX4 and ArduPilot execute in two ways",
    commands.CONDITION_DISTANCE: "a condition (a distance), which PX4 and ArduPilot execute in two ways",
    _DIGICAM: "a photo by DO_DIGICAM_CONTROL (use IMAGE_START_CAPTURE, 2000)",
    _TRIGGER_INTERVAL: "a trigger by time, which ArduPilot refuses (use IMAGE_START_CAPTURE, 2000)",
}
