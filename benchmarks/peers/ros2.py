"""A program in ROS 2, which publishes velocities for the node of `ual_ros2`. It runs in an environment with ROS 2."""

from __future__ import annotations

import time

import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.qos import qos_profile_sensor_data

from benchmarks.marks import yaw_rate_rad_s
from benchmarks.peers.base import SynchronousPeer, until


class Peer(SynchronousPeer):
    def connect(self) -> None:
        rclpy.init()
        self._node = rclpy.create_node("peer")
        self._publisher = self._node.create_publisher(TwistStamped, "/uav_1/ual/set_velocity", qos_profile_sensor_data)
        self._message = TwistStamped()
        self._message.twist.linear.y = 1.5
        until(lambda: self._publisher.get_subscription_count() > 0, "the node listens")
        for _ in range(20):  # until DDS, the node and the daemon's stream are all at work
            self.send(0)
            time.sleep(0.05)

    def send(self, number: int) -> None:
        self._message.twist.angular.z = yaw_rate_rad_s(number)
        self._publisher.publish(self._message)

    def close(self) -> None:
        rclpy.try_shutdown()
