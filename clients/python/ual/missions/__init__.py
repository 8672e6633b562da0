"""Missions that the autopilot flies by itself: items, and files of them. `ual.Uav.mission` brings them to a UAV."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, MissionStage, StoredMission
from ual.shared.late import late

if TYPE_CHECKING:
    from ual.missions.files import Mission, parse, read

__all__ = [
    "CameraAction",
    "CameraTrigger",
    "Heading",
    "HoldTime",
    "Item",
    "Jump",
    "Land",
    "LinkLossAction",
    "Mission",
    "MissionPlan",
    "MissionProgress",
    "MissionStage",
    "OtherItem",
    "RegionOfInterest",
    "RegionOfInterestEnd",
    "ReturnToLaunch",
    "Speed",
    "StoredMission",
    "TakeOff",
    "Waypoint",
    "parse",
    "read",
]


if not TYPE_CHECKING:  # a type checker would take any name for one of ours
    __getattr__ = late("ual.missions", "files", "Mission", "parse", "read")
