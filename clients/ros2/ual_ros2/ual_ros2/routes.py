"""The way of a task as ROS' path."""

from __future__ import annotations

import asyncio

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path

import ual
from ual_ros2 import values
from ual_ros2.messages import Message

AT_ONCE = 50
"""Poses that are made before the event loop may do something else. A route has up to 2,000; setpoints are urgent."""


async def path(route: ual.types.Route | None) -> Message:
    """Makes the path of a way; an empty one where nothing is flown whose way is known."""
    message = Path()
    if route is None:
        return message
    message.header.frame_id = route.frame_id
    for number, point in enumerate(route.points):
        pose = PoseStamped(header=message.header)
        values.fill_vector(pose.pose.position, point)
        message.poses.append(pose)
        if number % AT_ONCE == AT_ONCE - 1:
            await asyncio.sleep(0)
    return message
