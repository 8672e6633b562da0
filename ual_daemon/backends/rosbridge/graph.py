"""ROS version and topics of the other side, with their types, from rosapi, which runs next to rosbridge."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

from ual_daemon.backends.rosbridge.operations import Message

TOPICS_SERVICE = "/rosapi/topics"
_ROS1_NAMES = {"VfrHud": "VFR_HUD"}
"""ROS 2 allows no underscore in the name of a type, so mavros_msgs renamed this one."""


class RosGeneration(IntEnum):
    """The generation of ROS."""

    ROS1 = 1
    ROS2 = 2

    def spell(self, kind: str) -> str:
        """Returns the name of a message type (``pkg/Name`` or ``pkg/msg/Name``) as this ROS writes it."""
        package, name = kind.split("/", maxsplit=1)[0], kind.rsplit("/", 1)[-1]
        return f"{package}/{_ROS1_NAMES.get(name, name)}" if self is RosGeneration.ROS1 else f"{package}/msg/{name}"


class Graph(NamedTuple):
    """The topics that somebody publishes or subscribes to, with their types."""

    ros: RosGeneration
    topics: Mapping[str, str]

    def fault(self, topic: str, kind: str) -> str:
        """Returns why a topic of a type cannot be subscribed to, human-readable; empty if it can."""
        found = self.topics.get(topic)
        if found is None:
            return f"nobody publishes {topic}"
        if self.ros.spell(found) != self.ros.spell(kind):
            return f"{topic} has the type {found}, not {self.ros.spell(kind)}"
        return ""


def read_graph(values: Message) -> Graph:
    """Reads the answer of `TOPICS_SERVICE`. ROS 2 has ``msg`` in the names of types, ROS 1 has not.

    Raises:
        ValueError: It is no such answer.
    """
    topics, types = values.get("topics"), values.get("types")
    if not isinstance(topics, list) or not isinstance(types, list):
        raise ValueError(f"{TOPICS_SERVICE} answers without topics and types")  # noqa: TRY004  not our type
    is_ros2 = any(str(each).count("/") == 2 for each in types)
    return Graph(
        RosGeneration.ROS2 if is_ros2 else RosGeneration.ROS1,
        dict(zip(map(str, topics), map(str, types), strict=False)),
    )
