"""The topics that tell of one UAV, with messages that are made once."""

from __future__ import annotations

import copy
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import BatteryState, Imu, NavSatFix
from tf2_msgs.msg import TFMessage
from ual_msgs.msg import State

import ual
from ual.shared.ages import without_seconds
from ual_ros2 import health, unknown, values
from ual_ros2.messages import Entity, Message
from ual_ros2.ros_time import RosTime

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Of what comes in: it hears reliable publishers and others, and only the newest counts."""
MANY_LATCHED = QoSProfile(
    depth=100, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
SENSOR_DATA = qos_profile_sensor_data
TF = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
_OVERRIDABLE = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY)


def overridable(qos: QoSProfile) -> dict[str, Entity]:
    """Returns the arguments of a topic whose QoS parameters may change.

    They are named ``qos_overrides./uav_1/ual/pose.publisher.reliability``. rclpy writes them into the profile that it
    is given: so each topic gets one of its own.
    """
    return {"qos_profile": copy.copy(qos), "qos_overriding_options": QoSOverridingOptions(_OVERRIDABLE)}


class _StateContent(NamedTuple):
    """Content of a State message apart from its stamp: it is published when this changes."""

    state: ual.State
    reason: str
    flight_mode: str = ""
    armed: bool = False
    task: str = ""
    is_paused: bool = False
    task_id: str = ""
    frame_lost: str = ""
    failsafe: str = ""
    held_by: str = ""

    def is_as(self, other: _StateContent | None) -> bool:
        """Returns whether another one says the same, but for the seconds that its reason counts."""
        return self == other or (other is not None and self.timeless() == other.timeless())

    def timeless(self) -> _StateContent:
        """Returns the same without the seconds that its reason counts."""
        return self._replace(reason=without_seconds(self.reason))

    @classmethod
    def of(cls, sample: ual.Telemetry) -> _StateContent:
        task, about = sample.task, sample.health
        return cls(
            state=sample.state,
            reason=sample.state_reason,
            flight_mode=sample.flight_mode,
            armed=sample.armed,
            task="" if task is None else task.kind.name,
            is_paused=task is not None and task.is_paused,
            task_id="" if task is None else task.id,
            frame_lost=sample.frame_lost,
            failsafe="" if about is None else about.failsafe,
            held_by="" if about is None else about.held_by,
        )


class Topics:
    """Publishes the telemetry of one UAV. Only the event loop calls it."""

    def __init__(self, node: Entity, ns: str, time: RosTime, tf: Entity) -> None:
        self._node = node
        self._ns = ns
        self._time = time
        self._tf = tf
        self._told: _StateContent | None = None
        self._pose = self._publisher(PoseStamped, "pose")
        self._velocity = self._publisher(TwistStamped, "velocity")
        self._odom = self._publisher(Odometry, "odom")
        self._imu = self._publisher(Imu, "imu")
        self._ref_pose = self._publisher(PoseStamped, "ref_pose")
        self._battery = self._publisher(BatteryState, "battery")
        self._batteries = self._publisher(BatteryState, "batteries")
        self._fix = self._publisher(NavSatFix, "fix")
        self._state = self._publisher(State, "state", LATCHED)
        self._health = self._publisher(DiagnosticArray, "health", RELIABLE)
        self._make_messages()

    def destroy(self) -> None:
        """Ends the topics."""
        for each in (
            self._pose, self._velocity, self._odom, self._imu, self._ref_pose, self._battery, self._batteries,
            self._fix, self._state, self._health,
        ):  # fmt: skip
            self._node.destroy_publisher(each)

    def publish(self, sample: ual.Telemetry) -> None:
        """Publishes what changes fast. What is not known, or not heard by others, costs nothing."""
        self._publish_state(_StateContent.of(sample))
        odometry = sample.odometry
        if odometry is not None:
            self._publish_odometry(odometry)
        if sample.pose is not None and has_subscribers(self._pose):
            self._publish_pose(self._pose, self._pose_message, sample.pose, sample)
        if sample.velocity is not None and has_subscribers(self._velocity):
            self._stamp(self._velocity_message.header, sample.stamp_s, sample.frame_id)
            values.fill_twist(self._velocity_message.twist, sample.velocity)
            self._velocity.publish(self._velocity_message)
        if sample.reference_pose is not None and has_subscribers(self._ref_pose):
            self._publish_pose(self._ref_pose, self._ref_pose_message, sample.reference_pose, sample)

    def publish_slow(self, sample: ual.Telemetry, said: health.ConnectionReport) -> None:
        """Publishes what changes slowly."""
        self._publish_state(_StateContent.of(sample), again=True)
        if sample.battery is not None:
            self._publish_battery(self._battery, sample.battery)
        for each in sample.batteries:
            self._publish_battery(self._batteries, each)
        if sample.position_geo is not None and has_subscribers(self._fix):
            self._stamp(self._fix_message.header, sample.stamp_s, f"{self._ns}/base_link")
            values.fill_fix(self._fix_message, sample.position_geo, sample.gps)
            self._fix.publish(self._fix_message)
        if has_subscribers(self._health):
            self._publish_health(health.of(sample, said))

    def _publish_battery(self, publisher: Entity, battery: ual.Battery) -> None:
        if has_subscribers(publisher):
            self._time.stamp_now(self._battery_message.header.stamp)
            values.fill_battery(self._battery_message, battery)
            publisher.publish(self._battery_message)

    def others_count(self) -> int:
        """Returns how many others publish the state of this UAV."""
        return max(0, int(self._node.count_publishers(self._state.topic_name)) - 1)

    def tell_unknown(self, reason: str, said: health.ConnectionReport) -> None:
        """Says that nothing is known of the UAV, and why."""
        self._publish_state(_StateContent(ual.State.UNINITIALIZED, reason), again=True)
        self._publish_health(health.silent(reason, said))

    def _publisher(self, kind: Entity, name: str, qos: Entity = SENSOR_DATA) -> Entity:
        topic = f"/{self._ns}/ual/{name}"
        return self._node.create_publisher(kind, topic, **overridable(qos))

    def _make_messages(self) -> None:
        self._pose_message, self._ref_pose_message = PoseStamped(), PoseStamped()
        self._velocity_message, self._odom_message = TwistStamped(), Odometry()
        unknown.fill_odometry(self._odom_message)
        self._imu_message = Imu()
        unknown.fill_imu(self._imu_message)
        self._battery_message, self._fix_message = BatteryState(), NavSatFix()
        self._battery_message.header.frame_id = f"{self._ns}/base_link"
        self._fix_message.status.service = 1  # GPS
        self._transform_message = TransformStamped()
        self._tf_message = TFMessage(transforms=[self._transform_message])

    def _publish_odometry(self, odometry: ual.Odometry) -> None:
        if has_subscribers(self._tf):
            self._publish_body(odometry)
        if has_subscribers(self._odom):
            self._odom_message.child_frame_id = odometry.child_frame_id
            self._stamp(self._odom_message.header, odometry.stamp_s, odometry.frame_id)
            values.fill_pose(self._odom_message.pose.pose, odometry.pose)
            values.fill_twist(self._odom_message.twist.twist, odometry.twist)
            self._odom.publish(self._odom_message)
        if has_subscribers(self._imu):
            self._stamp(self._imu_message.header, odometry.stamp_s, odometry.child_frame_id)
            values.fill_quaternion(self._imu_message.orientation, odometry.pose.orientation)
            values.fill_vector(self._imu_message.angular_velocity, odometry.twist.angular)
            self._imu.publish(self._imu_message)

    def _publish_body(self, odometry: ual.Odometry) -> None:
        transform = ual.Transform(
            odometry.pose.position, odometry.pose.orientation, odometry.frame_id, odometry.child_frame_id
        )
        message = self._transform_message
        values.fill_transform(message, transform)
        self._time.stamp(message.header.stamp, odometry.stamp_s)
        self._tf.publish(self._tf_message)

    def _publish_pose(self, publisher: Entity, message: Message, pose: ual.Pose, sample: ual.Telemetry) -> None:
        self._stamp(message.header, sample.stamp_s, sample.frame_id)
        values.fill_pose(message.pose, pose)
        publisher.publish(message)

    def _publish_state(self, told: _StateContent, *, again: bool = False) -> None:
        """Publishes each change; what has not changed only again, for those who subscribe without transient local."""
        if told.is_as(self._told) and not (again and has_subscribers(self._state)):
            return
        self._told = told
        message = State(**{**told._asdict(), "state": values.STATE_NUMBERS[told.state]})
        self._time.stamp_now(message.header.stamp)
        self._state.publish(message)

    def _publish_health(self, status: health.Status) -> None:
        told = DiagnosticStatus(
            level=bytes([status.level]),
            name=f"{self._ns}: UAL",
            message=status.message,
            hardware_id=self._ns,
            values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
        )
        message = DiagnosticArray(status=[told])
        self._time.stamp_now(message.header.stamp)
        self._health.publish(message)

    def _stamp(self, header: Message, stamp_s: float, frame_id: str) -> None:
        self._time.stamp(header.stamp, stamp_s)
        header.frame_id = frame_id


def has_subscribers(publisher: Entity) -> bool:
    """Returns whether anything subscribes to a topic."""
    return bool(publisher.get_subscription_count())
