"""The items of missions as messages and back. It needs no ROS: messages are known by their fields."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import ual
from ual.missions import (
    CameraAction,
    CameraTrigger,
    Heading,
    HoldTime,
    Item,
    Jump,
    Land,
    OtherItem,
    RegionOfInterest,
    RegionOfInterestEnd,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
)
from ual_ros2 import values
from ual_ros2.beside.fields import Fields, named, place
from ual_ros2.messages import Message


def items(messages: list[Message]) -> list[Item]:
    """Reads the items of a request.

    Raises:
        InvalidArgumentError: One is none; it is named.

    """
    return [_item(index, each) for index, each in enumerate(messages)]


def item_fields(item: Item) -> Fields:
    """Returns a MissionItem."""
    kind, told = _TOLD[type(item)]
    return {"number": item.number, "kind": kind, **told(item)}


def _item(index: int, message: Message) -> Item:
    read = _READ.get(message.kind)
    if read is None:
        field = f"items[{index}].kind"
        text = f"{field}: {message.kind!r:.80} is none of {', '.join(_READ)}"
        raise ual.InvalidArgumentError(text, {"field": field})
    return read(message)


def _above(message: Message) -> dict[str, Any]:
    return {
        "altitude_m": message.altitude,
        "altitude_reference": values.altitude_reference(message.altitude_reference),
    }


def _at(message: Message) -> dict[str, Any]:
    return {"latitude_deg": message.place.latitude, "longitude_deg": message.place.longitude}


def _take_off(message: Message) -> TakeOff:
    return TakeOff(**_above(message), **(_at(message) if message.has_place else {}), number=message.number)


def _waypoint(message: Message) -> Waypoint:
    return Waypoint(
        **_at(message),
        **_above(message),
        hold_s=message.hold,
        accept_radius_m=None if message.accept_radius == 0.0 else message.accept_radius,
        yaw_rad=message.yaw if message.has_yaw else None,
        number=message.number,
    )


def _camera_trigger(message: Message) -> CameraTrigger:
    action = named(CameraAction, message.camera_action, "camera_action")
    return CameraTrigger(action, message.value, number=message.number)


_READ: Mapping[str, Callable[[Message], Item]] = {
    "TAKE_OFF": _take_off,
    "WAYPOINT": _waypoint,
    "HOLD": lambda message: HoldTime(message.hold, number=message.number),
    "SPEED": lambda message: Speed(message.speed, number=message.number),
    "HEADING": lambda message: Heading(message.yaw, number=message.number),
    "REGION_OF_INTEREST": lambda message: RegionOfInterest(**_at(message), **_above(message), number=message.number),
    "REGION_OF_INTEREST_END": lambda message: RegionOfInterestEnd(number=message.number),
    "CAMERA_TRIGGER": _camera_trigger,
    "LAND": lambda message: Land(**_at(message), number=message.number),
    "RETURN_TO_LAUNCH": lambda message: ReturnToLaunch(number=message.number),
    "JUMP": lambda message: Jump(message.to, message.times, number=message.number),
    "OTHER": lambda message: OtherItem(message.command, message.text, number=message.number),
}


def _altitude_fields(item: Any) -> Fields:  # noqa: ANN401 (one that has an altitude)
    return {"altitude": item.altitude_m, "altitude_reference": item.altitude_reference.value}


def _place_fields(item: Any) -> Fields:  # noqa: ANN401 (one that has a place)
    return {"place": place(item.latitude_deg, item.longitude_deg)}


def _take_off_fields(item: TakeOff) -> Fields:
    has_place = item.latitude_deg is not None
    return {"has_place": has_place, **_altitude_fields(item), **(_place_fields(item) if has_place else {})}


def _waypoint_fields(item: Waypoint) -> Fields:
    return {
        **_place_fields(item),
        **_altitude_fields(item),
        "hold": item.hold_s,
        "accept_radius": item.accept_radius_m or 0.0,
        "has_yaw": item.yaw_rad is not None,
        "yaw": item.yaw_rad or 0.0,
    }


def _nothing(_: Item) -> Fields:
    return {}


_TOLD: Mapping[type[Any], tuple[str, Callable[[Any], Fields]]] = {
    TakeOff: ("TAKE_OFF", _take_off_fields),
    Waypoint: ("WAYPOINT", _waypoint_fields),
    HoldTime: ("HOLD", lambda item: {"hold": item.seconds}),
    Speed: ("SPEED", lambda item: {"speed": item.speed_m_s}),
    Heading: ("HEADING", lambda item: {"yaw": item.yaw_rad}),
    RegionOfInterest: ("REGION_OF_INTEREST", lambda item: {**_place_fields(item), **_altitude_fields(item)}),
    RegionOfInterestEnd: ("REGION_OF_INTEREST_END", _nothing),
    CameraTrigger: ("CAMERA_TRIGGER", lambda item: {"camera_action": item.action.name, "value": item.value}),
    Land: ("LAND", _place_fields),
    ReturnToLaunch: ("RETURN_TO_LAUNCH", _nothing),
    Jump: ("JUMP", lambda item: {"to": item.to, "times": item.times}),
    OtherItem: ("OTHER", lambda item: {"command": item.command, "text": item.text}),
}
