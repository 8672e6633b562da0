"""Publishers of velocities for one UAV: two programs that publish at once fly it to and fro. It needs no ROS."""

from __future__ import annotations

from collections.abc import Iterable

from ual_ros2.messages import Entity

VELOCITIES = ("set_velocity", "cmd_vel")
"""The topics of velocities."""


def names(node: Entity, topics: Iterable[str]) -> tuple[str, ...]:
    """Returns the nodes that publish on topics."""
    found = (each for topic in topics for each in node.get_publishers_info_by_topic(topic))
    return tuple(sorted({f"{each.node_namespace.rstrip('/')}/{each.node_name}" for each in found}))


def doubt(publishers: tuple[str, ...]) -> str:
    """Returns what several publishers of velocities mean; empty for one, or none."""
    if len(publishers) < 2:
        return ""
    named = ", ".join(publishers)
    return f"{len(publishers)} nodes publish velocities: {named}. The UAV flies each one's: end all but one"
