from __future__ import annotations

import pytest

from ual_daemon.backends.rosbridge.graph import Graph, RosGeneration


@pytest.mark.parametrize(
    ("ros", "kind"),
    [
        (RosGeneration.ROS1, "mavros_msgs/State"),
        (RosGeneration.ROS1, "mavros_msgs/VFR_HUD"),
        (RosGeneration.ROS2, "mavros_msgs/msg/State"),
        (RosGeneration.ROS2, "mavros_msgs/msg/VfrHud"),
    ],
)
def test_a_topic_is_found_by_the_type_that_its_ros_gives_it(ros: RosGeneration, kind: str) -> None:
    """Types as a real MAVROS 1.21 publishes them, and as the sources of 2.12 name them."""
    name = kind.rsplit("/", 1)[-1]
    graph = Graph(ros, {"/topic": kind})
    assert graph.fault("/topic", f"mavros_msgs/{'VfrHud' if name == 'VFR_HUD' else name}") == ""
    assert graph.fault("/topic", "mavros_msgs/Other") != ""
    assert graph.fault("/other", "mavros_msgs/State") == "nobody publishes /other"
