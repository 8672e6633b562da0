"""Missions that the autopilot flies by itself: items, and files of them. `ual.Uav.mission` brings them to a UAV."""

from __future__ import annotations

from ual.missions.files import Mission, parse, read
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

__all__ = [
    "CameraAction",
    "CameraTrigger",
    "Heading",
    "HoldTime",
    "Item",
    "Jump",
    "Land",
    "Mission",
    "OtherItem",
    "RegionOfInterest",
    "RegionOfInterestEnd",
    "ReturnToLaunch",
    "Speed",
    "TakeOff",
    "Waypoint",
    "parse",
    "read",
]
