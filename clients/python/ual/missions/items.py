"""The items of a mission, in the form that PX4 and ArduPilot both execute. The manual is docs/how-to/missions.md.

Altitudes count from home, or from mean sea level; above the terrain and the ellipsoid is not executed alike by both.
Headings are those of REP 103: counter-clockwise from east.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

from ual.types import AltitudeReference


class CameraAction(Enum):
    """Action of a `CameraTrigger`."""

    BY_DISTANCE = 1
    """One photo now, and one after each `value` metres on the way."""
    BY_INTERVAL = 2
    """One photo each `value` seconds."""
    ONCE = 3
    STOP = 4
    """Ends what a trigger by distance or by interval has begun. Takes no photo."""
    BY_DISTANCE_LATER = 5
    """One photo after each `value` metres on the way, none now. (PX4 takes its first one now all the same.)"""
    STOP_WITH_PHOTO = 6
    """One photo now. Ends what a trigger by distance has begun, as surveys of QGroundControl do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One item of a mission. `number` is that in its file, for messages. It does not count for `==`."""

    number: str = field(default="", compare=False)


@dataclass(frozen=True, slots=True)
class TakeOff(Item):
    """Climbs where the UAV stands. With a place, it then flies there at that altitude."""

    altitude_m: float
    altitude_reference: AltitudeReference = AltitudeReference.HOME
    latitude_deg: float | None = None
    longitude_deg: float | None = None


@dataclass(frozen=True, slots=True)
class Waypoint(Item):
    """Flies straight to a place.

    Args:
        latitude_deg: North of the equator.
        longitude_deg: East of Greenwich.
        altitude_m: Above the reference.
        altitude_reference: What the altitude counts from.
        hold_s: How long it stays there.
        accept_radius_m: Within this distance it counts as reached. None: by the autopilot's parameters.
        yaw_rad: The heading on the way and there. None: by the autopilot's parameters.
        number: As in `Item`.

    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    altitude_reference: AltitudeReference = AltitudeReference.HOME
    hold_s: float = 0.0
    accept_radius_m: float | None = None
    yaw_rad: float | None = None


@dataclass(frozen=True, slots=True)
class HoldTime(Item):
    """Stays where it is for some time."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Speed(Item):
    """Sets the horizontal speed of what follows."""

    speed_m_s: float


@dataclass(frozen=True, slots=True)
class Heading(Item):
    """Turns the nose while the `HoldTime` after it lasts."""

    yaw_rad: float


@dataclass(frozen=True, slots=True)
class RegionOfInterest(Item):
    """Points the camera, or without a gimbal the nose, at a place until `RegionOfInterestEnd`."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    altitude_reference: AltitudeReference = AltitudeReference.HOME


@dataclass(frozen=True, slots=True)
class RegionOfInterestEnd(Item):
    """Points at nothing any more."""


@dataclass(frozen=True, slots=True)
class CameraTrigger(Item):
    """Takes photos. `value` is in metres or in seconds, and 0 for `ONCE`, `STOP` and `STOP_WITH_PHOTO`."""

    action: CameraAction
    value: float = 0.0


@dataclass(frozen=True, slots=True)
class Land(Item):
    """Flies to a place and lands there. Ends the mission."""

    latitude_deg: float
    longitude_deg: float


@dataclass(frozen=True, slots=True)
class ReturnToLaunch(Item):
    """Returns by the autopilot's own way home. Ends the mission."""


@dataclass(frozen=True, slots=True)
class Jump(Item):
    """Goes on with another item, `times` times; after that with the next one. `to` counts the items from 1."""

    to: int
    times: int


@dataclass(frozen=True, slots=True)
class OtherItem(Item):
    """Something else that the autopilot has in its mission: a MAV_CMD, and why a mission of UAL has it not.

    It can be downloaded, and not uploaded.
    """

    command: int
    text: str


MOVING = (TakeOff, Waypoint, HoldTime, Land, ReturnToLaunch)
"""Items that take time to fly. The others act at once, on the way to the next of these."""
PLACED = (TakeOff, Waypoint, Land)
"""Items that lead to a place."""
ENDING = (Land, ReturnToLaunch)


def name_of(items: Sequence[Item], index: int) -> str:
    """Returns how messages call an item: by its number in the file, else by its place in the mission."""
    item = items[index]
    return f"item {item.number or index + 1} ({words_of(item)})"


def words_of(item: Item) -> str:
    """Returns what kind of item it is."""
    return _WORDS[type(item)]


_WORDS: dict[type[Item], str] = {
    TakeOff: "take-off",
    Waypoint: "waypoint",
    HoldTime: "hold",
    Speed: "speed",
    Heading: "heading",
    RegionOfInterest: "region of interest",
    RegionOfInterestEnd: "end of a region of interest",
    CameraTrigger: "camera trigger",
    Land: "landing",
    ReturnToLaunch: "return to launch",
    Jump: "jump",
    OtherItem: "another command",
}
