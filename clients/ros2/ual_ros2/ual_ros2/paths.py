"""Path of FollowPath. It needs no ROS: goals are known by their fields."""

from __future__ import annotations

import ual
from ual_ros2 import values
from ual_ros2.derived.values import read_geo_waypoint
from ual_ros2.messages import Message


def waypoints(goal: Message) -> list[ual.PoseStamped] | list[ual.GeoWaypoint]:
    """Reads the path or the places. Poses without a frame are in that of the path.

    Raises:
        InvalidArgumentError: There are both.

    """
    if not goal.geo_waypoints:
        return [values.pose_stamped(each, goal.path.header.frame_id) for each in goal.path.poses]
    if goal.path.poses:
        raise ual.InvalidArgumentError(
            "geo_waypoints: the goal has a path, too; give only one of both", {"field": "geo_waypoints"}
        )
    return list(map(read_geo_waypoint, goal.geo_waypoints))


def point_of_interest(goal: Message) -> ual.PointStamped | None:
    """Reads where the nose points; None where it points elsewhere."""
    is_at_point = values.path_heading(goal.heading) is ual.PathHeading.POINT_OF_INTEREST
    return values.point_stamped(goal.point_of_interest) if is_at_point else None


def frames(goal: Message) -> list[str]:
    """Returns the frames that it is given in."""
    stamped = (goal.path, goal.point_of_interest, *goal.path.poses)
    return [each.header.frame_id for each in stamped]
