"""Setpoints of a program in ROS: the first by a service, which answers, those that follow at once by a topic.

What is refused on the topic is heard on `refusals`, and raised at the next setpoint, as `ual.Uav` does.
"""

from __future__ import annotations

import time
from typing import Any

from flying import Client
from geometry_msgs.msg import PoseStamped, TwistStamped
from reading import error_of
from ros_tasks import Call
from ual_msgs import srv
from ual_msgs.msg import Refusal

import ual
from ual_ros2 import values

CONTINUES_S = 0.5


class Setpoints:
    """The setpoints and poses from outside of one UAV."""

    def __init__(self, client: Client, ns: str, call: Call) -> None:
        self._client = client
        self._prefix = f"/{ns}/ual"
        self._call = call
        self._until_s = 0.0
        self._refusals = client.hear(Refusal, f"{self._prefix}/refusals", 100)
        client.publisher(TwistStamped, f"{self._prefix}/set_velocity", 10)  # a new one may lose its first message

    def settle(self) -> None:
        """The next one waits for its answer again."""
        self._until_s = 0.0
        self._refusals.clear()

    def set_pose(self, pose: ual.PoseStamped) -> None:
        """Gives a pose as the reference."""
        self._call(srv.SetPose, "set_pose", pose=pose_message(pose))

    def ask_pose(self, pose: ual.PoseStamped) -> None:
        """Asks whether it would be taken."""
        self._call(srv.SetPose, "set_pose", pose=pose_message(pose), dry_run=True)

    def set_velocity(self, velocity: ual.TwistStamped) -> None:
        """Gives a velocity as the reference."""
        message, refused = _twist_message(velocity), list(self._refusals)
        if refused:
            self.settle()
            raise error_of(refused[-1])
        if time.monotonic() < self._until_s:
            self._client.publish(TwistStamped, f"{self._prefix}/set_velocity", message, 10)
        else:
            self._call(srv.SetVelocity, "set_velocity", velocity=message)
        self._until_s = time.monotonic() + CONTINUES_S

    def ask_velocity(self, velocity: ual.TwistStamped) -> None:
        """Asks whether it would be taken."""
        self._call(srv.SetVelocity, "set_velocity", velocity=_twist_message(velocity), dry_run=True)

    def set_external_pose(
        self, pose: ual.PoseStamped, position_std_dev_m: float | None, orientation_std_dev_rad: float | None
    ) -> None:
        """Gives a pose from outside."""
        message = pose_message(pose)
        message.header.stamp.sec, message.header.stamp.nanosec = values.split(pose.stamp_s)
        fields: dict[str, Any] = {}
        for name, value in (
            ("position_std_dev", position_std_dev_m),
            ("orientation_std_dev", orientation_std_dev_rad),
        ):
            if value is not None:
                fields |= {f"has_{name}": True, name: value}
        self._call(srv.SetExternalPose, "set_external_pose", pose=message, **fields)


def pose_message(stamped: ual.PoseStamped) -> Any:
    """A PoseStamped without a stamp."""
    message = PoseStamped()
    message.header.frame_id = stamped.frame_id
    values.fill_pose(message.pose, stamped.pose)
    return message


def _twist_message(stamped: ual.TwistStamped) -> Any:
    message = TwistStamped()
    message.header.frame_id = stamped.frame_id
    values.fill_twist(message.twist, stamped.twist)
    return message
