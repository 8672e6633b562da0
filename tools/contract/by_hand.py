"""Values of the contract that are written by hand, with their codec: they flow often, or do more than hold fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class ByHand(NamedTuple):
    """A value written by hand: its module and class, and the functions of ``ual.wire`` that write and read it.

    `names_field`: the reader takes the name of the field, too, as a caller may have left out a part of it.
    """

    module: str
    name: str
    codec: str
    names_field: bool = False

    def writer(self) -> str:
        """Returns what makes the message."""
        return f"{self.codec}_to_proto"

    def reader(self) -> str:
        """Returns what reads the message."""
        return f"{self.codec}_from_proto"


MESSAGES: Mapping[str, ByHand | None] = {
    "PoseStamped": ByHand("ual.geometry", "PoseStamped", "convert.pose_stamped", names_field=True),
    "PointStamped": ByHand("ual.geometry", "PointStamped", "convert.point_stamped", names_field=True),
    "Quaternion": ByHand("ual.geometry", "Quaternion", "convert.quaternion"),
    "Vector3": ByHand("ual.geometry", "Vector3", "convert.vector3"),
    "Pose": ByHand("ual.geometry", "Pose", "convert.pose"),
    "Twist": ByHand("ual.geometry", "Twist", "convert.twist"),
    "Transform": ByHand("ual.geometry", "Transform", "convert.transform"),
    "Odometry": ByHand("ual.contract.odometry", "Odometry", "convert.odometry"),
    "TaskError": ByHand("ual.errors", "UalError", "convert.task_error"),
    "RallyPoint": ByHand("ual.contract.rally_point", "RallyPoint", "rally_points.rally_point"),
    "MissionItem": ByHand("ual.missions.items", "Item", "mission_items.item"),
    "ImageInfo": None,
    "Header": None,
    "TwistStamped": None,
    "ExternalPose": None,
    **dict.fromkeys(
        (
            "MissionPlace",
            "TakeOffItem",
            "WaypointItem",
            "HoldItem",
            "SpeedItem",
            "HeadingItem",
            "RegionOfInterestItem",
            "RegionOfInterestEndItem",
            "CameraTriggerItem",
            "LandItem",
            "ReturnToLaunchItem",
            "JumpItem",
            "OtherItem",
        )
    ),
}
"""By the name of the message. None: it is no value by itself."""
OF_UAV: Mapping[str, ByHand] = {
    "GeoPoint": ByHand("ual.types", "GeoPoint", "uav.geo_point"),
    "Task": ByHand("ual.types", "TaskInfo", "uav.task_info"),
}
"""Values of ``ual.proto`` that other files have, too."""
ENUMS = frozenset({"CameraAction"})
FILES = frozenset({"network"})
"""The files whose values are all written by hand."""
PLACES: Mapping[str, str] = {
    "gimbal": "ual.gimbals",
    "logs": "ual.logs.values",
    "mission": "ual.missions.plan",
    "ual": "ual.contract.uav",
    **{each: f"ual.contract.{each}" for each in ("camera", "corrections", "fence", "parameters")},
}
"""The modules of values that are not called as their file. What is in ``ual.contract`` is named by a module by hand."""


def of(name: str) -> ByHand | None:
    """Returns the value of a message by hand, or of the UAV's own file, where there is one."""
    return MESSAGES.get(name) or OF_UAV.get(name)
