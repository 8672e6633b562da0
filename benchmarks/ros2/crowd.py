"""A program in ROS 2 that takes off with many UAVs, hears them, and flies them by velocities at 50 Hz."""

from __future__ import annotations

import sys
import threading
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from ual_msgs.srv import TakeOff

from benchmarks.children import serve

_TURNS_RAD_S = 0.1
_HEARD = {"pose": PoseStamped, "velocity": TwistStamped, "odom": Odometry}


class Crowd:
    """The program."""

    def __init__(self, count: int) -> None:
        rclpy.init()
        self._node = rclpy.create_node("crowd")
        self._heard = 0
        self._names = [f"/uav_{number}/ual" for number in range(1, count + 1)]
        for name in self._names:
            for topic, kind in _HEARD.items():
                self._node.create_subscription(kind, f"{name}/{topic}", self._on_message, qos_profile_sensor_data)

    def handle(self, task: dict[str, Any]) -> dict[str, Any]:
        """Performs a task."""
        if task["do"] == "fly":
            self._fly()
            return {}
        heard, self._heard = self._heard, 0
        return {"count": heard}

    def _fly(self) -> None:
        for name in self._names:
            client = self._node.create_client(TakeOff, f"{name}/take_off")
            client.wait_for_service()
            future = client.call_async(TakeOff.Request(height=3.0, blocking=True))
            rclpy.spin_until_future_complete(self._node, future)
            if not future.result().success:
                raise RuntimeError(future.result().message)
        self._publishers = [
            self._node.create_publisher(TwistStamped, f"{name}/set_velocity", qos_profile_sensor_data)
            for name in self._names
        ]
        self._message = TwistStamped()
        self._message.twist.angular.z = _TURNS_RAD_S
        self._node.create_timer(0.02, self._send)
        threading.Thread(target=rclpy.spin, args=(self._node,), daemon=True).start()

    def _send(self) -> None:
        for publisher in self._publishers:
            publisher.publish(self._message)

    def _on_message(self, _: object) -> None:
        self._heard += 1


if __name__ == "__main__":
    serve(Crowd(int(sys.argv[1])).handle)
