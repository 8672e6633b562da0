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
from ual.missions.plan import LinkLossAction, MissionPlan, MissionProgress, MissionStage, StoredMission

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
