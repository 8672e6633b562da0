"""A program in ROS 1, which publishes velocities for a MAVROS that runs already."""

from __future__ import annotations

import time

import rospy
from mavros_msgs.msg import PositionTarget as Target

from benchmarks.marks import yaw_rate_rad_s
from benchmarks.peers.base import SynchronousPeer, until

_ONLY_VELOCITY = (
    (Target.IGNORE_PX | Target.IGNORE_PY | Target.IGNORE_PZ)
    | (Target.IGNORE_AFX | Target.IGNORE_AFY | Target.IGNORE_AFZ)
    | Target.IGNORE_YAW
)


class Peer(SynchronousPeer):
    def connect(self) -> None:
        rospy.init_node("peer", anonymous=True, disable_signals=True)
        self._publisher = rospy.Publisher("/mavros/setpoint_raw/local", Target, queue_size=1)
        self._message = Target(coordinate_frame=Target.FRAME_LOCAL_NED, type_mask=_ONLY_VELOCITY)
        self._message.velocity.y = 1.5
        until(lambda: self._publisher.get_num_connections() > 0, "MAVROS listens")
        for _ in range(20):
            self.send(0)
            time.sleep(0.05)

    def send(self, number: int) -> None:
        self._message.yaw_rate = yaw_rate_rad_s(number)
        self._publisher.publish(self._message)

    def close(self) -> None:
        rospy.signal_shutdown("the measurement has ended")
