"""Between the items of a mission and those of an autopilot, and what an autopilot would ignore or read otherwise.

One table each for PX4 and ArduCopter. Sources: PX4 1.17 (mavlink_mission.cpp parse_mavlink_mission_item and
format_mavlink_mission_item, navigator/mission_block.cpp, FeasibilityChecker.cpp); ArduCopter 4.6.3
(AP_Mission.cpp mavlink_int_to_mission_cmd, mode_auto.cpp).
"""

from __future__ import annotations

import hashlib
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple

from typing_extensions import override

from ual.errors import WrongStateError
from ual.missions import checks, commands
from ual.missions.items import (
    CameraAction,
    CameraTrigger,
    Heading,
    HoldTime,
    Item,
    Jump,
    Land,
    RegionOfInterest,
    RegionOfInterestEnd,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
    name_of,
)
from ual.missions.plan import LinkLossAction
from ual.parameters.values import real32
from ual.types import AltitudeReference
from ual_daemon.backends.firmwares.mission_items import JUMP, MissionItem
from ual_daemon.backends.offers.missions import OnItsOwn

_MISSION_FRAME_CODE = 2
_FRAMES = {AltitudeReference.AMSL: 0, AltitudeReference.HOME: 3}
_SAME_FRAMES = {5: 0, 6: 3}
"""MAV_FRAME_GLOBAL_INT and its kin mean the same as those without; autopilots give either back."""
_WAYPOINT, _RETURN, _LAND, _TAKE_OFF, _DELAY = 16, 20, 21, 22, 93
_YAW, _JUMP, _SPEED, _ROI, _ROI_NONE, _TRIGGER = 115, JUMP, 178, 195, 197, 206
_START_CAPTURE, _STOP_CAPTURE = 2000, 2001
_NO_THROTTLE, _GROUND_SPEED, _NOT_USED = -1.0, 1.0, -1.0
_E7_PER_DEG = 1e7
_GLOBAL = ("frame", "x", "y", "z")
_YAW_TOLERANCE_DEG = 0.01
_LEAST_ALTITUDE_M = 0.01
"""ArduCopter keeps whole centimetres, so that less is 0."""

Fault = Callable[[Sequence[Item], int], str]
"""Why an autopilot would not execute an item as it stands; empty where it does."""


class GeoPosition(NamedTuple):
    """Position in degrees."""

    latitude_deg: float
    longitude_deg: float


class MissionCodec(ABC):
    """Encoding of missions by one kind of autopilot. Stateless."""

    name: str
    first_seq: int
    """The number that it gives to the first item of a mission."""
    restart_seq: int
    """The number that begins the mission again, with all jumps."""
    is_ardupilot: bool
    mode: str
    """The name of the mode in which it flies its mission."""
    return_mode: str
    """The name of the mode to which a return to launch leads; that of the mission where it stays in it."""
    pause_mode: str
    """The name of the mode in which it pauses."""
    done_mode: str
    """The name of the mode in which it holds its position after a mission; that of the mission where it stays."""
    parameters: Sequence[str]
    """Parameters of its own actions in a mission."""
    height_tolerance_m = 0.0
    """Metres by which a height may change because of its encoding."""
    faults: ClassVar[Mapping[type[Item], Fault]]
    """Of each kind of item."""
    kept: ClassVar[Mapping[int, Sequence[str]]]
    """The fields that it keeps of each command."""

    def require(self, items: Sequence[Item]) -> None:
        """Checks that it executes a mission as it stands.

        Raises:
            InvalidArgumentError: It would ignore something, or read it otherwise; the item is named.

        """
        for index, item in enumerate(items):
            fault = self.faults.get(type(item))
            if fault is not None and (text := fault(items, index)):
                raise checks.refused(items, index, f"{self.name} {text}")

    def encode(self, items: Sequence[Item], here: GeoPosition | None) -> list[MissionItem]:
        """Returns the items as they are uploaded. `here` is where the UAV stands; None while that is not known.

        Raises:
            WrongStateError: It is not known where the UAV is, which its take-off needs.

        """
        return [self._encoded(items, index, here) for index in range(len(items))]

    def decode(self, found: Sequence[MissionItem]) -> list[Item]:
        """Returns the items of a mission that it has."""
        read = [commands.Command(each.command, each.frame, _params(each)) for each in self.own(found)]
        return commands.items_on_autopilot(read, self.first_seq, is_ardupilot=self.is_ardupilot)

    def own(self, found: Sequence[MissionItem]) -> Sequence[MissionItem]:
        """Returns the items of the mission in a list that it has."""
        return found

    def difference(self, sent: Sequence[MissionItem], found: Sequence[MissionItem]) -> str:
        """Returns how what was read back differs from what was sent, human-readable; empty if it does not."""
        mine, theirs = self.own(sent), self.own(found)
        if len(mine) != len(theirs):
            return f"it has {len(theirs)} items instead of {len(mine)}"
        for number, pair in enumerate(zip(mine, theirs, strict=True), 1):
            if text := self._item_difference(*pair):
                return f"item {number} has {text}"
        return ""

    def digest(self, found: Sequence[MissionItem]) -> str:
        """Returns a text that is the same for the same mission, as it was read from the autopilot."""
        parts = [
            (each.command, *(_kept(each, field) for field in self.kept.get(each.command, _ALL)))
            for each in self.own(found)
        ]
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]

    @abstractmethod
    def on_its_own(self, values: Sequence[float]) -> OnItsOwn:
        """Returns what it does by itself in a mission, by the values of `parameters`."""

    def seq_of(self, index: int) -> int:
        """Returns the number that it gives to an item, counted from 0 here."""
        return index + self.first_seq

    def index_of(self, seq: int) -> int:
        """Returns the item of a number of its own, counted from 0."""
        return seq - self.first_seq

    def _item_difference(self, mine: MissionItem, theirs: MissionItem) -> str:
        if mine.command != theirs.command:
            return f"command {theirs.command} instead of {mine.command}"
        for field in self.kept[mine.command]:
            wanted, kept = _kept(mine, field), _kept(theirs, field)
            if not self._is_alike(mine.command, field, wanted, kept):
                return f"{field} {kept:.9g} instead of {wanted:.9g}"
        return ""

    def _is_alike(self, command: int, field: str, wanted: float, kept: float) -> bool:
        if math.isnan(wanted) or math.isnan(kept):
            return math.isnan(wanted) and math.isnan(kept)
        if field == "param4" and command == _WAYPOINT:
            return abs(math.remainder(wanted - kept, 360.0)) < _YAW_TOLERANCE_DEG
        return abs(wanted - kept) <= (self.height_tolerance_m if field == "z" else 0.0)

    def _encoded(self, items: Sequence[Item], index: int, here: GeoPosition | None) -> MissionItem:
        item = items[index]
        if isinstance(item, TakeOff):
            return self._take_off(items, index, item, here)
        if isinstance(item, Jump):
            return _do(_JUMP, float(self.seq_of(item.to - 1)), float(item.times))
        if isinstance(item, CameraTrigger):
            return _camera(items, index, item)
        return _ENCODERS[type(item)](self, item)

    def _take_off(self, items: Sequence[Item], index: int, item: TakeOff, here: GeoPosition | None) -> MissionItem:
        place = here
        if item.latitude_deg is not None and item.longitude_deg is not None:
            place = GeoPosition(item.latitude_deg, item.longitude_deg)
        if place is None:
            raise WrongStateError(
                f"{name_of(items, index)}: {self.name} needs a place for it, and it is not known where the UAV is: "
                "wait for its position, or give the place",
                {"needed": "position"},
            )
        return _at(_TAKE_OFF, place, item.altitude_m, item.altitude_reference, (0.0, 0.0, 0.0, math.nan))

    def yaw_deg(self, yaw_rad: float | None) -> float:
        """Returns the heading of a waypoint as it is uploaded."""
        return math.nan if yaw_rad is None else _from_north_deg(yaw_rad)


CONTINUE, RETURN, LAND = LinkLossAction.CONTINUE, LinkLossAction.RETURN, LinkLossAction.LAND
_PX4_LOSS = {0: CONTINUE, 2: RETURN, 3: LAND}
_PX4_IN_MISSION = 1
"""The bit of COM_DLL_EXCEPT for missions."""
_COPTER_LOSS = {0: CONTINUE, 1: RETURN, 3: RETURN, 4: RETURN, 5: LAND}
_COPTER_OLD_CONTINUE_ACTION = 2
_COPTER_CONTINUES = 1 << 1
"""The bit of FS_OPTIONS by which it goes on in AUTO when the ground station is lost."""


_LINK_LOSS_TEXTS = {CONTINUE: "goes on with the mission", RETURN: "returns", LAND: "lands", None: "does something else"}


def _on_its_own(action: LinkLossAction | None, why: str, begins_anew: str = "") -> OnItsOwn:
    text = f"once its ground station is lost, the autopilot {_LINK_LOSS_TEXTS[action]} ({why})"
    return OnItsOwn(action, text, begins_anew)


class Px4Missions(MissionCodec):
    """PX4, from 1.13."""

    name = "PX4"
    first_seq = restart_seq = 0
    is_ardupilot = False
    mode, return_mode = "AUTO.MISSION", "AUTO.RTL"
    pause_mode = done_mode = "AUTO.LOITER"
    parameters = ("NAV_DLL_ACT", "COM_DLL_EXCEPT")
    kept: ClassVar = {
        _TAKE_OFF: _GLOBAL,
        _WAYPOINT: (*_GLOBAL, "param1", "param2", "param4"),
        _LAND: _GLOBAL,
        _RETURN: (),
        _DELAY: ("param1",),
        _SPEED: ("param1", "param2", "param3"),
        _ROI: _GLOBAL,
        _ROI_NONE: (),
        _TRIGGER: ("param1", "param3"),
        _START_CAPTURE: ("param2", "param3"),
        _STOP_CAPTURE: (),
        _JUMP: ("param1", "param2"),
    }
    faults: ClassVar = {Heading: lambda *_: "has no turn of its own: give the heading to the waypoint (yaw_rad)"}

    @override
    def on_its_own(self, values: Sequence[float]) -> OnItsOwn:
        action, excepted = map(int, values)
        why = f"NAV_DLL_ACT is {action}, COM_DLL_EXCEPT {excepted}"
        return _on_its_own(CONTINUE if excepted & _PX4_IN_MISSION else _PX4_LOSS.get(action), why)


def _copter_take_off(item: Any) -> str:  # noqa: ANN401  a TakeOff, by the table
    if item.latitude_deg is not None:
        return "ignores the place of a take-off: leave it out, and add a waypoint"
    if item.altitude_reference is AltitudeReference.HOME and item.altitude_m < 1.0:
        return "climbs 1 m at least"
    return ""


def _copter_waypoint(item: Any) -> str:  # noqa: ANN401  a Waypoint, by the table
    if item.yaw_rad is not None:
        return "ignores the heading of a waypoint: put a heading and a hold after it"
    if item.accept_radius_m is not None:
        return "ignores the radius of a waypoint: its parameter WPNAV_RADIUS is for all of them"
    if not float(item.hold_s).is_integer():
        return "holds for whole seconds"
    is_zero = abs(item.altitude_m) < _LEAST_ALTITUDE_M
    return "reads altitude 0 as that of the item before: give another one" if is_zero else ""


def _copter_heading(items: Sequence[Item], index: int) -> str:
    following = next((each for each in items[index + 1 :] if not isinstance(each, Speed | CameraTrigger)), None)
    if isinstance(following, HoldTime):
        return ""
    return "turns back to its own heading with the next waypoint: put a hold after the heading"


class ArduCopterMissions(MissionCodec):
    """ArduCopter, 4.6. Its first item is home, which no mission has."""

    name = "ArduCopter"
    first_seq, restart_seq = 1, 0
    is_ardupilot = True
    mode = return_mode = done_mode = "AUTO"
    pause_mode = "BRAKE"
    parameters = ("FS_GCS_ENABLE", "FS_OPTIONS", "MIS_RESTART")
    height_tolerance_m = 0.0101  # it keeps centimetres, and cuts off what is beyond
    kept: ClassVar = {
        _TAKE_OFF: ("frame", "z"),
        _WAYPOINT: (*_GLOBAL, "param1"),
        _LAND: ("x", "y"),
        _RETURN: (),
        _DELAY: ("param1",),
        _SPEED: ("param1", "param2"),
        _YAW: ("param1",),
        _ROI: _GLOBAL,
        _ROI_NONE: (),
        _TRIGGER: ("param1", "param3"),
        _START_CAPTURE: ("param2", "param3"),
        _STOP_CAPTURE: (),
        _JUMP: ("param1", "param2"),
    }

    @override
    def on_its_own(self, values: Sequence[float]) -> OnItsOwn:
        action, options, restart = map(int, values)
        why = f"FS_GCS_ENABLE is {action}, FS_OPTIONS {options}"
        is_continued = options & _COPTER_CONTINUES or action == _COPTER_OLD_CONTINUE_ACTION
        anew = f"MIS_RESTART is {restart}" if restart else ""
        return _on_its_own(CONTINUE if is_continued else _COPTER_LOSS.get(action), why, anew)

    @override
    def encode(self, items: Sequence[Item], here: GeoPosition | None) -> list[MissionItem]:
        place = here or GeoPosition(0.0, 0.0)
        return [_at(_WAYPOINT, place, 0.0, AltitudeReference.AMSL), *super().encode(items, here)]

    @override
    def own(self, found: Sequence[MissionItem]) -> Sequence[MissionItem]:
        return found[1:]

    @override
    def _take_off(self, items: Sequence[Item], index: int, item: TakeOff, here: GeoPosition | None) -> MissionItem:
        return MissionItem(_FRAMES[item.altitude_reference], _TAKE_OFF, z=item.altitude_m)

    @override
    def yaw_deg(self, yaw_rad: float | None) -> float:
        return 0.0  # it ignores the heading of a waypoint, and refuses no number

    faults: ClassVar = {
        TakeOff: lambda items, index: _copter_take_off(items[index]),
        Waypoint: lambda items, index: _copter_waypoint(items[index]),
        Heading: _copter_heading,
    }


def _from_north_deg(yaw_rad: float) -> float:
    return math.fmod(450.0 - math.degrees(math.remainder(yaw_rad, 2.0 * math.pi)), 360.0)


def _at(
    command: int,
    place: GeoPosition,
    altitude_m: float,
    above: AltitudeReference,
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
) -> MissionItem:
    x, y = round(place.latitude_deg * _E7_PER_DEG), round(place.longitude_deg * _E7_PER_DEG)
    return MissionItem(_FRAMES[above], command, *params, x, y, altitude_m)


def _do(
    command: int, param1: float = 0.0, param2: float = 0.0, param3: float = 0.0, param4: float = 0.0
) -> MissionItem:
    return MissionItem(_MISSION_FRAME_CODE, command, param1, param2, param3, param4)


def _camera(items: Sequence[Item], index: int, item: CameraTrigger) -> MissionItem:
    if item.action in _TRIGGERS:
        return _do(_TRIGGER, item.value, 0.0, _TRIGGERS[item.action])
    if item.action is CameraAction.BY_INTERVAL:
        return _do(_START_CAPTURE, 0.0, item.value, 0.0)
    if item.action is CameraAction.ONCE:
        return _do(_START_CAPTURE, 0.0, 0.0, 1.0)
    begun = [each for each in items[:index] if isinstance(each, CameraTrigger) and each.action in _LASTING]
    is_interval = bool(begun) and begun[-1].action is CameraAction.BY_INTERVAL
    return _do(_STOP_CAPTURE) if is_interval else _do(_TRIGGER)


_TRIGGERS = {
    CameraAction.BY_DISTANCE: 1.0,
    CameraAction.BY_DISTANCE_LATER: 0.0,
    CameraAction.STOP_WITH_PHOTO: 1.0,
}
"""The third parameter of DO_SET_CAM_TRIGG_DIST: whether a photo is taken at once, also where the distance is 0."""
_LASTING = (CameraAction.BY_DISTANCE, CameraAction.BY_DISTANCE_LATER, CameraAction.BY_INTERVAL)
_ENCODERS: Mapping[type[Item], Callable[[Any, Any], MissionItem]] = {
    Waypoint: lambda codec, item: _at(
        _WAYPOINT,
        GeoPosition(item.latitude_deg, item.longitude_deg),
        item.altitude_m,
        item.altitude_reference,
        (float(item.hold_s), float(item.accept_radius_m or 0.0), 0.0, codec.yaw_deg(item.yaw_rad)),
    ),
    HoldTime: lambda _, item: _do(_DELAY, float(item.seconds), _NOT_USED, _NOT_USED, _NOT_USED),
    Speed: lambda _, item: _do(_SPEED, _GROUND_SPEED, float(item.speed_m_s), _NO_THROTTLE),
    Heading: lambda _, item: _do(_YAW, _from_north_deg(item.yaw_rad)),
    RegionOfInterest: lambda _, item: _at(
        _ROI, GeoPosition(item.latitude_deg, item.longitude_deg), item.altitude_m, item.altitude_reference
    ),
    RegionOfInterestEnd: lambda *_: _do(_ROI_NONE),
    Land: lambda codec, item: _at(
        _LAND,
        GeoPosition(item.latitude_deg, item.longitude_deg),
        0.0,
        AltitudeReference.HOME,
        (0.0, 0.0, 0.0, codec.yaw_deg(None)),
    ),
    ReturnToLaunch: lambda *_: _do(_RETURN),
}
_ALL = ("frame", "param1", "param2", "param3", "param4", "x", "y", "z")


def _kept(item: MissionItem, field: str) -> float:
    """Returns a field as an autopilot can keep it."""
    value = getattr(item, field)
    if field == "frame":
        return float(_SAME_FRAMES.get(value, value))
    return real32(value) if isinstance(value, float) else float(value)


def _params(item: MissionItem) -> list[float | None]:
    """Returns the seven numbers as files have them: degrees, and None for NaN."""
    is_global = item.frame != _MISSION_FRAME_CODE
    x, y = (item.x / _E7_PER_DEG, item.y / _E7_PER_DEG) if is_global else (float(item.x), float(item.y))
    params = (item.param1, item.param2, item.param3, item.param4, x, y, item.z)
    return [None if math.isnan(each) else each for each in params]
