"""Values as fields of messages: mappings of their names, which may be nested. It needs no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeAlias, TypeVar

import ual
from ual.gimbals import AngleRange
from ual_ros2.messages import Message
from ual_ros2.values import known

E = TypeVar("E", bound=Enum)
T = TypeVar("T")
MIB = 1024 * 1024

Fields: TypeAlias = Mapping[str, Any]
"""The fields of a message by their names. A nested message is such a mapping, too."""


@dataclass(frozen=True)
class Stamp:
    """A time of UTC, which becomes one of ROS' clock."""

    utc_s: float


NEVER = Stamp(0.0)


def named(kind: type[E], text: str, field: str, default: E | None = None) -> E:
    """Returns the member of an enumeration that a request names; the default where it names none.

    Raises:
        InvalidArgumentError: There is no such member; the message lists all.

    """
    if not text and default is not None:
        return default
    try:
        return kind[text]
    except KeyError:
        raise none_of(field, text, [each.name for each in kind]) from None


def none_of(field: str, text: str, names: Iterable[str]) -> ual.InvalidArgumentError:
    """Returns the error of a field that names none of what there is."""
    return ual.InvalidArgumentError(f"{field}: {text!r:.80} is none of {', '.join(names)}", {"field": field})


def read_all(read: Callable[[Message], T], messages: Iterable[Message], field: str) -> Iterator[T]:
    """Yields the values of an array.

    Raises:
        InvalidArgumentError: One is none; its place in the array is named.

    """
    for index, message in enumerate(messages):
        try:
            yield read(message)
        except ual.InvalidArgumentError as error:
            place = f"{field}[{index}]."
            inside = error.metadata.get("field", "")
            raise ual.InvalidArgumentError(f"{place}{error.message}", {"field": f"{place}{inside}"}) from None


def name_of(member: Enum | None) -> str:
    """Returns the name of a member; empty where it is not known, or stands for what is not named."""
    return "" if member is None or not member.value else member.name


def names_of(members: frozenset[E]) -> list[str]:
    """Returns the names of members, in the order of their numbers."""
    return [each.name for each in sorted(members, key=lambda each: each.value)]


def vector(value: ual.Vector3) -> Fields:
    """Returns a Vector3 or Point."""
    return {"x": value.x, "y": value.y, "z": value.z}


def quaternion(value: ual.Quaternion | None) -> Fields:
    """Returns a Quaternion; zeros where it is not known."""
    known = value or ual.Quaternion(0.0, 0.0, 0.0, 0.0)
    return {"x": known.x, "y": known.y, "z": known.z, "w": known.w}


def pose_stamped(value: ual.PoseStamped | None, stamp_s: float) -> Fields:
    """Returns a PoseStamped; one without a frame where it is not known."""
    if value is None:
        return {}
    pose = {"position": vector(value.pose.position), "orientation": quaternion(value.pose.orientation)}
    return {"header": {"frame_id": value.frame_id, "stamp": Stamp(stamp_s)}, "pose": pose}


def point_stamped(value: ual.PointStamped | None) -> Fields:
    """Returns a PointStamped; one without a frame where it is not known."""
    return {} if value is None else {"header": {"frame_id": value.frame_id}, "point": vector(value.point)}


def transform(value: ual.Transform | None) -> Fields:
    """Returns a Transform; the identity where it is not known."""
    if value is None:
        return {}
    return {"translation": vector(value.translation), "rotation": quaternion(value.rotation)}


def geo_point_fields(place: tuple[float | None, float | None]) -> Fields:
    """Returns a GeoPoint of latitude and longitude; zeros where they are not known."""
    latitude_deg, longitude_deg = place
    return {"latitude": latitude_deg or 0.0, "longitude": longitude_deg or 0.0}


def read_geo_point(message: Message) -> tuple[float, float]:
    """Reads a GeoPoint."""
    return message.latitude, message.longitude


def angle_range(value: AngleRange | None) -> list[float]:
    """Returns the least and the most of angles; NaN where they are not known."""
    return [math.nan, math.nan] if value is None else [value.least_rad, value.most_rad]


def stamp(utc_s: float | None) -> Stamp:
    """Returns a Time; zero where it is not known."""
    return NEVER if utc_s is None else Stamp(utc_s)


def key_values(metadata: Mapping[str, str]) -> list[Fields]:
    """Returns an array of KeyValue."""
    return [{"key": key, "value": value} for key, value in metadata.items()]


def in_bytes(mib: float | None) -> float:
    """Returns a number of bytes; NaN where it is not known."""
    return known(None if mib is None else mib * MIB)


def ratio(percent: float | None) -> float:
    """Returns a share of 1; NaN where it is not known."""
    return known(None if percent is None else percent / 100.0)
