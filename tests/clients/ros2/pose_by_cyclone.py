"""Prints a pose as Eclipse Cyclone DDS hears it, which shares no code with the ROS of the node.

``python pose_by_cyclone.py /uav_1/ual/pose DOMAIN`` prints the stamp, the frame and the height.
"""

import sys
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, uint32
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


name, domain = sys.argv[1:]
participant = DomainParticipant(int(domain))
topic = Topic(participant, f"rt{name}", PoseStamped)  # as ROS names a topic in DDS
reader = DataReader(participant, topic, qos=Qos(Policy.Reliability.BestEffort))
pose = next(reader.take_iter(timeout=duration(seconds=90)))
print(pose.header.stamp.sec, pose.header.frame_id, pose.pose.position.z)
