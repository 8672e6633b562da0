#!/usr/bin/env python3
"""Two UAVs fly a square side by side: a program for UAL of ROS 1, with rospy's names changed to rclpy's.

ual-daemon --backend light --fleet 2 --ns uav_1 --auto-arm
ual ros2
python two_uavs.py
"""

import sys

import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from ual_msgs.msg import State
from ual_msgs.srv import GoToWaypoint, Land, TakeOff

HEIGHT_M = 3.0
SQUARE = [(2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Ual:
    """One UAV."""

    def __init__(self, node, ns):
        self.node = node
        self.ns = ns
        self.state = State.UNINITIALIZED
        node.create_subscription(State, f"/{ns}/ual/state", self.on_state, LATCHED)
        self.take_off = self.service(TakeOff, "take_off")
        self.go_to_waypoint = self.service(GoToWaypoint, "go_to_waypoint")
        self.land = self.service(Land, "land")

    def on_state(self, message):
        self.state = message.state

    def service(self, kind, name):
        client = self.node.create_client(kind, f"/{self.ns}/ual/{name}")
        client.wait_for_service()
        return lambda **request: client.call_async(kind.Request(**request))


def wait_for_all(node, calls):
    """Waits until all have answered; ends the program where one is refused."""
    for call in calls:
        rclpy.spin_until_future_complete(node, call)
        if not call.result().success:
            sys.exit(f"{call.result().reason}: {call.result().message}")


def waypoint(x, y):
    message = PoseStamped()
    message.pose.position.x, message.pose.position.y, message.pose.position.z = x, y, HEIGHT_M
    return message


def main():
    rclpy.init()
    node = rclpy.create_node("two_uavs")
    uavs = [Ual(node, "uav_1"), Ual(node, "uav_2")]
    while any(uav.state != State.LANDED_ARMED for uav in uavs):  # until the safety pilots have armed
        rclpy.spin_once(node)
    wait_for_all(node, [uav.take_off(height=HEIGHT_M, blocking=True) for uav in uavs])
    for x, y in SQUARE:
        wait_for_all(node, [uav.go_to_waypoint(waypoint=waypoint(x, y), blocking=True) for uav in uavs])
        print(f"both are at {x:g}, {y:g}")
    wait_for_all(node, [uav.land(blocking=True) for uav in uavs])
    print("landed")


main()
