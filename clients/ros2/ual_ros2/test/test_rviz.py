"""Displays of rviz2 show what the node publishes: topics, types, quality of service and frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml
from conftest import ARMED_FAST, Processes
from flying import LATCHED, Client, waited
from rclpy.qos import (
    DurabilityPolicy,
    LivelinessPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from tf2_msgs.msg import TFMessage

PACKAGE = Path(__file__).parents[1]
CONFIGURATION = yaml.safe_load((PACKAGE / "rviz" / "uav.rviz").read_text())["Visualization Manager"]
SHOWN = {
    "rviz_default_plugins/Odometry": "nav_msgs/msg/Odometry",
    "rviz_default_plugins/Pose": "geometry_msgs/msg/PoseStamped",
    "rviz_default_plugins/Path": "nav_msgs/msg/Path",
}
"""Message type of each display of rviz_default_plugins."""
RELIABILITIES = {"Best Effort": ReliabilityPolicy.BEST_EFFORT, "Reliable": ReliabilityPolicy.RELIABLE}
DURABILITIES = {"Transient Local": DurabilityPolicy.TRANSIENT_LOCAL, "Volatile": DurabilityPolicy.VOLATILE}


def displays(group: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The displays of a group, and of those in it."""
    for each in group["Displays"]:
        yield each
        if "Displays" in each:
            yield from displays(each)


WITH_TOPIC = [each for each in displays(CONFIGURATION) if "Topic" in each]


@pytest.fixture(scope="module")
def node(processes: Processes) -> None:
    processes.daemon(*ARMED_FAST)
    processes.node("ns:=uav_1")


@pytest.mark.parametrize("display", WITH_TOPIC, ids=[str(each["Name"]) for each in WITH_TOPIC])
@pytest.mark.usefixtures("node")
def test_a_display_hears_its_topic(client: Client, display: dict[str, Any]) -> None:
    topic = display["Topic"]
    (publisher,) = waited(lambda: client.node.get_publishers_info_by_topic(topic["Value"]))
    assert publisher.topic_type == SHOWN[display["Class"]]
    asked = QoSProfile(
        depth=5,
        reliability=RELIABILITIES[topic.get("Reliability Policy", "Reliable")],
        durability=DURABILITIES[topic.get("Durability Policy", "Volatile")],
        liveliness=LivelinessPolicy.AUTOMATIC,
    )
    assert qos_check_compatible(publisher.qos_profile, asked) == (QoSCompatibility.OK, "")


@pytest.mark.usefixtures("node")
def test_the_frames_are_those_of_tf(client: Client) -> None:
    (model,) = (each for each in displays(CONFIGURATION) if each["Class"] == "rviz_default_plugins/RobotModel")
    (link,) = ET.parse(PACKAGE / "urdf" / "quadrotor.urdf").getroot().iter("link")
    moving, standing = client.hear(TFMessage, "/tf"), client.hear(TFMessage, "/tf_static", LATCHED)
    wanted = {CONFIGURATION["Global Options"]["Fixed Frame"], f"{model['TF Prefix']}/{link.get('name')}"}

    def known() -> set[str]:
        links = [link for message in [*moving, *standing] for link in message.transforms]
        return {frame for link in links for frame in (link.header.frame_id, link.child_frame_id)}

    waited(lambda: wanted <= known())
