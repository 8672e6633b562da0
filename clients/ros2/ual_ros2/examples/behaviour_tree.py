#!/usr/bin/env python3
"""A behaviour tree of py_trees_ros patrols two places, and lands once the battery is below 30 %.

ual-daemon --backend light --ns uav_1 --auto-arm --set light.battery_endurance_s=60
ual ros2
python behaviour_tree.py
"""

import operator
import sys
import time

import py_trees
import py_trees_ros
import rclpy
from geometry_msgs.msg import PoseStamped
from py_trees.common import ComparisonExpression, ParallelPolicy, Status
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import BatteryState
from ual_msgs.action import GoToWaypoint, Land, TakeOff
from ual_msgs.msg import State

NS = "/uav_1/ual"
LOW = 0.3  # of the charge: BatteryState counts from 0 to 1
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PLACES = [(6.0, 0.0), (0.0, 0.0)]
HEIGHT_M = 3.0
PERIOD_S = 0.1


def topic_to_blackboard(kind, topic, qos, field):
    """Returns a behaviour that keeps a topic's last message as a variable of the blackboard."""
    return py_trees_ros.subscribers.ToBlackboard(
        name=topic, topic_name=f"{NS}/{topic}", topic_type=kind, qos_profile=qos, blackboard_variables={topic: field}
    )


def action(kind, name, goal):
    return py_trees_ros.action_clients.FromConstant(
        name=name, action_type=kind, action_name=f"{NS}/{name}", action_goal=goal
    )


def go_to(x, y):
    waypoint = PoseStamped()
    waypoint.pose.position.x, waypoint.pose.position.y, waypoint.pose.position.z = x, y, HEIGHT_M
    return action(GoToWaypoint, "go_to_waypoint", GoToWaypoint.Goal(waypoint=waypoint))


def check(name, variable, value, compare):
    return py_trees.behaviours.CheckBlackboardVariableValue(name, ComparisonExpression(variable, value, compare))


def wait_until(name, variable, value, compare):
    return py_trees.behaviours.WaitForBlackboardVariableValue(name, ComparisonExpression(variable, value, compare))


def sequence(name, *children):
    return py_trees.composites.Sequence(name=name, memory=True, children=list(children))


def grown():
    """The tree. Whatever the patrol does, a low battery comes first."""
    low = sequence(
        "the battery is low",
        check("is it low?", "battery", LOW, operator.lt),
        check("does it fly?", "state", State.FLYING_AUTO, operator.eq),
        action(Land, "land", Land.Goal()),
    )
    patrol = sequence(
        "patrol",
        wait_until("is the battery full enough?", "battery", LOW, operator.ge),
        wait_until("has the safety pilot armed?", "state", State.LANDED_ARMED, operator.eq),
        action(TakeOff, "take_off", TakeOff.Goal(height=HEIGHT_M)),
        py_trees.decorators.Repeat("again and again", sequence("round", *[go_to(*place) for place in PLACES]), -1),
    )
    flight = py_trees.composites.Selector(name="flight", memory=False, children=[low, patrol])
    told = [
        topic_to_blackboard(BatteryState, "battery", qos_profile_sensor_data, "percentage"),
        topic_to_blackboard(State, "state", LATCHED, "state"),
    ]
    return py_trees.composites.Parallel(
        name="uav_1", policy=ParallelPolicy.SuccessOnSelected([flight], synchronise=False), children=[*told, flight]
    )


def refusal(tree):
    """Why the goal on which the tree has failed ended so."""
    ended = getattr(tree.root.tip(), "result_message", None)
    return "" if ended is None else f"{ended.result.reason}: {ended.result.message}"


class Narrator:
    """Says what the tree does, whenever that changes."""

    def __init__(self):
        self.said = ""

    def __call__(self, tree):
        name = tree.root.tip().name
        if name != self.said:
            print(name, flush=True)
        self.said = name


def spin(tree, until):
    while not until():
        rclpy.spin_once(tree.node, timeout_sec=PERIOD_S)


def main():
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # so that Ctrl-C leaves time to cancel
    tree = py_trees_ros.trees.BehaviourTree(grown())
    tree.setup(node_name="patrol", timeout=15.0)
    tree.add_post_tick_handler(Narrator())
    tree.tick_tock(period_ms=1000.0 * PERIOD_S)
    try:
        spin(tree, lambda: tree.root.status in (Status.SUCCESS, Status.FAILURE))
    except KeyboardInterrupt:
        tree.interrupt()  # cancels what flies: then the UAV holds
        end_s = time.monotonic() + 1.0
        spin(tree, lambda: time.monotonic() > end_s)
        sys.exit("stopped")
    if tree.root.status is Status.FAILURE:
        sys.exit(f"the patrol has ended: {refusal(tree)}")
    print("landed")


main()
