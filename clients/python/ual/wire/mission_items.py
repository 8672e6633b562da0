"""Between the items of a mission and their messages, one kind of message for each kind of item."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from ual.errors import InvalidArgumentError
from ual.missions.items import (
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
from ual.types import AltitudeReference
from ual.v1 import mission_pb2 as pb
from ual.v1 import ual_pb2


def items_to_proto(items: Iterable[Item]) -> list[pb.MissionItem]:
    """Makes the messages of items."""
    return [item_to_proto(each, f"items[{index}]") for index, each in enumerate(items)]


def items_from_proto(messages: Sequence[pb.MissionItem]) -> list[Item]:
    """Reads items. Raises `InvalidArgumentError`, which names the one that is none."""
    return [item_from_proto(each, f"items[{index}]") for index, each in enumerate(messages)]


def item_to_proto(item: Item, field: str = "items") -> pb.MissionItem:
    """Makes the message of an item. Raises `InvalidArgumentError` for what is none."""
    known = _TO_PROTO.get(type(item))
    if known is None:
        raise InvalidArgumentError(f"{field}: {item!r:.80} is no item of a mission", {"field": field})
    kind, make = known
    return pb.MissionItem(number=item.number, **{kind: make(item)})


def item_from_proto(message: pb.MissionItem, field: str = "items") -> Item:
    """Reads an item. Raises `InvalidArgumentError` where it says no kind."""
    kind = message.WhichOneof("kind")
    if kind is None:
        raise InvalidArgumentError(f"{field}: it says no kind", {"field": field})
    return _FROM_PROTO[kind](getattr(message, kind), message.number)


def _position(latitude_deg: float, longitude_deg: float) -> pb.MissionPlace:
    return pb.MissionPlace(latitude_deg=latitude_deg, longitude_deg=longitude_deg)


def _above(reference: AltitudeReference) -> ual_pb2.AltitudeReference.ValueType:
    return ual_pb2.AltitudeReference.ValueType(reference.value)


def _reference(value: int) -> AltitudeReference:
    return AltitudeReference(value) if value in _REFERENCES else AltitudeReference.HOME


_REFERENCES = {each.value for each in AltitudeReference}


def _take_off_to_proto(item: TakeOff) -> pb.TakeOffItem:
    has_position = item.latitude_deg is not None and item.longitude_deg is not None
    position = _position(item.latitude_deg or 0.0, item.longitude_deg or 0.0) if has_position else None
    return pb.TakeOffItem(
        altitude_m=item.altitude_m, altitude_reference=_above(item.altitude_reference), place=position
    )


def _take_off_from_proto(message: pb.TakeOffItem, number: str) -> TakeOff:
    position = (message.place.latitude_deg, message.place.longitude_deg) if message.HasField("place") else (None, None)
    return TakeOff(message.altitude_m, _reference(message.altitude_reference), *position, number=number)


def _waypoint_to_proto(item: Waypoint) -> pb.WaypointItem:
    return pb.WaypointItem(
        place=_position(item.latitude_deg, item.longitude_deg),
        altitude_m=item.altitude_m,
        altitude_reference=_above(item.altitude_reference),
        hold_s=item.hold_s,
        accept_radius_m=item.accept_radius_m,
        yaw_rad=item.yaw_rad,
    )


def _waypoint_from_proto(message: pb.WaypointItem, number: str) -> Waypoint:
    return Waypoint(
        message.place.latitude_deg,
        message.place.longitude_deg,
        message.altitude_m,
        _reference(message.altitude_reference),
        message.hold_s,
        message.accept_radius_m if message.HasField("accept_radius_m") else None,
        message.yaw_rad if message.HasField("yaw_rad") else None,
        number=number,
    )


def _interest_to_proto(item: RegionOfInterest) -> pb.RegionOfInterestItem:
    return pb.RegionOfInterestItem(
        place=_position(item.latitude_deg, item.longitude_deg),
        altitude_m=item.altitude_m,
        altitude_reference=_above(item.altitude_reference),
    )


def _interest_from_proto(message: pb.RegionOfInterestItem, number: str) -> RegionOfInterest:
    position, above = message.place, _reference(message.altitude_reference)
    return RegionOfInterest(position.latitude_deg, position.longitude_deg, message.altitude_m, above, number=number)


def _camera_from_proto(message: pb.CameraTriggerItem, number: str) -> CameraTrigger:
    known = {each.value: each for each in CameraAction}
    if message.action not in known:
        raise InvalidArgumentError(f"action: {message.action} is none", {"field": "action"})
    return CameraTrigger(known[message.action], message.value, number=number)


def _camera_to_proto(item: CameraTrigger) -> pb.CameraTriggerItem:
    return pb.CameraTriggerItem(action=pb.CameraAction.ValueType(item.action.value), value=item.value)


_TO_PROTO: dict[type[Any], tuple[str, Callable[[Any], Any]]] = {
    TakeOff: ("take_off", _take_off_to_proto),
    Waypoint: ("waypoint", _waypoint_to_proto),
    HoldTime: ("hold", lambda item: pb.HoldItem(seconds=item.seconds)),
    Speed: ("speed", lambda item: pb.SpeedItem(speed_m_s=item.speed_m_s)),
    Heading: ("heading", lambda item: pb.HeadingItem(yaw_rad=item.yaw_rad)),
    RegionOfInterest: ("region_of_interest", _interest_to_proto),
    RegionOfInterestEnd: ("region_of_interest_end", lambda _: pb.RegionOfInterestEndItem()),
    CameraTrigger: ("camera_trigger", _camera_to_proto),
    Land: ("land", lambda item: pb.LandItem(place=_position(item.latitude_deg, item.longitude_deg))),
    ReturnToLaunch: ("return_to_launch", lambda _: pb.ReturnToLaunchItem()),
    Jump: ("jump", lambda item: pb.JumpItem(to=item.to, times=item.times)),
    OtherItem: ("other", lambda item: pb.OtherItem(command=item.command, text=item.text)),
}
_FROM_PROTO: dict[str, Callable[[Any, str], Item]] = {
    "take_off": _take_off_from_proto,
    "waypoint": _waypoint_from_proto,
    "hold": lambda message, number: HoldTime(message.seconds, number=number),
    "speed": lambda message, number: Speed(message.speed_m_s, number=number),
    "heading": lambda message, number: Heading(message.yaw_rad, number=number),
    "region_of_interest": _interest_from_proto,
    "region_of_interest_end": lambda _, number: RegionOfInterestEnd(number=number),
    "camera_trigger": _camera_from_proto,
    "land": lambda message, number: Land(message.place.latitude_deg, message.place.longitude_deg, number=number),
    "return_to_launch": lambda _, number: ReturnToLaunch(number=number),
    "jump": lambda message, number: Jump(message.to, message.times, number=number),
    "other": lambda message, number: OtherItem(message.command, message.text, number=number),
}
