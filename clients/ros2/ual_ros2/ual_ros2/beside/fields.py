"""What is told, as fields of messages: mappings of their names, which may be nested. It needs no ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from types import SimpleNamespace
from typing import Any, TypeAlias, TypeVar

import ual
from ual_ros2 import values

E = TypeVar("E", bound=Enum)

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
        known = ", ".join(each.name for each in kind)
        raise ual.InvalidArgumentError(f"{field}: {text!r:.80} is none of {known}", {"field": field}) from None


def name_of(member: Enum | None) -> str:
    """Returns the name of a member; empty where it is not known."""
    return "" if member is None else member.name


def names_of(members: frozenset[E]) -> list[str]:
    """Returns the names of members, in the order of their numbers."""
    return [each.name for each in sorted(members, key=lambda each: each.value)]


def made(fill: Callable[..., None], *arguments: object) -> Fields:
    """Returns what a function puts into a message."""
    message = SimpleNamespace()
    fill(message, *arguments)
    return vars(message)


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


def place(latitude_deg: float, longitude_deg: float) -> Fields:
    """Returns a GeoPoint."""
    return {"latitude": latitude_deg, "longitude": longitude_deg}


def ratio(percent: float | None) -> float:
    """Returns a share of 1; NaN where it is not known."""
    return values.known(None if percent is None else percent / 100.0)
