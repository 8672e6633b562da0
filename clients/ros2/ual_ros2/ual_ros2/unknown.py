"""Unknown values of a measurement, in the form that readers of ROS expect. It needs no ROS.

A covariance of zeros is certainty for those that read odometry (robot_localization counts it as 1e-9). -1 on the
diagonal is "not known", as in ``sensor_msgs/Imu``; robot_localization takes it as a variance of 1.
"""

from __future__ import annotations

from ual_ros2.messages import Message

NOT_KNOWN = -1.0
ODOMETRY = tuple(NOT_KNOWN if row == column else 0.0 for row in range(6) for column in range(6))
"""The covariance of a pose or twist whose errors are not known."""


def fill_odometry(message: Message) -> None:
    """Says that no error of an Odometry is known."""
    message.pose.covariance = list(ODOMETRY)
    message.twist.covariance = list(ODOMETRY)


def fill_imu(message: Message) -> None:
    """Says of an Imu that it has no acceleration. Zeros say there that errors are not known, by its comment."""
    message.linear_acceleration_covariance[0] = NOT_KNOWN
