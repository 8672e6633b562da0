"""Entities of a node below a name. It needs no ROS."""

from __future__ import annotations

from ual_ros2.messages import Entity


def destroy_below(node: Entity, prefix: str) -> None:
    """Destroys the topics and services of a node whose names begin so, as they were given: renamed ones, too.

    It is for a UAV whose making has failed. Its actions are made last: so there is none yet.
    """
    for publisher in [each for each in node.publishers if each.topic.startswith(prefix)]:
        node.destroy_publisher(publisher)
    for subscription in [each for each in node.subscriptions if each.topic.startswith(prefix)]:
        node.destroy_subscription(subscription)
    for service in [each for each in node.services if each.srv_name.startswith(prefix)]:
        node.destroy_service(service)
