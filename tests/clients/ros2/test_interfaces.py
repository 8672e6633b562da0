"""`ual_msgs` and `tf2_msgs` as each ROS 2 builds and imports them."""

from __future__ import annotations

import json
import subprocess

import pytest

from tests.clients.ros2.environments import NAMES, Environment, environment

pytestmark = pytest.mark.slow
OF_ROS = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
"""The hash of tf2_msgs/msg/TFMessage in ROS: subscribers to /tf compare it."""
PROGRAM = """\
import json, rclpy
from rclpy.action import ActionServer
from tf2_msgs.msg import TFMessage
from ual_msgs.action import FollowPath
from ual_msgs.msg import State
from ual_msgs.srv import TakeOff
rclpy.init()
node = rclpy.create_node("node")
node.create_publisher(TFMessage, "/tf", 1)
node.create_publisher(State, "state", 1)
node.create_service(TakeOff, "take_off", lambda request, answer: answer)
server = ActionServer(node, FollowPath, "follow_path", lambda goal: None)
[tf] = node.get_publishers_info_by_topic("/tf")
print(json.dumps({
    "flying": State.FLYING_AUTO, "hash": str(tf.topic_type_hash),
    "topics": dict(node.get_topic_names_and_types()), "services": dict(node.get_service_names_and_types()),
}))
"""


@pytest.fixture(params=NAMES)
def ros(request: pytest.FixtureRequest) -> Environment:
    found = environment(request.param)
    if isinstance(found, str):
        pytest.skip(found)
    return found


def test_rclpy_makes_topics_services_and_actions_of_them(ros: Environment, request: pytest.FixtureRequest) -> None:
    command = [str(ros.python), "-c", PROGRAM]
    domain = 46 + NAMES.index(request.node.callspec.params["ros"])  # both may run at once, and hear each other
    done = subprocess.run(command, env=ros.in_domain(domain), capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert seen["flying"] == 4
    assert OF_ROS in seen["hash"]
    assert seen["topics"]["/state"] == ["ual_msgs/msg/State"]
    assert seen["services"]["/take_off"] == ["ual_msgs/srv/TakeOff"]
    assert seen["services"]["/follow_path/_action/send_goal"] == ["ual_msgs/action/FollowPath_SendGoal"]
