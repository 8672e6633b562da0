"""Between `ual.v1` protobuf messages and values that many others have: times, geometry, errors of tasks.

``x_to_proto`` makes a message, ``x_from_proto`` a value. A reader of a message of which a caller may leave out a
part takes `field`, the name of the message in its request. It raises `InvalidArgumentError` that names the missing part
(``waypoint.pose.position: not set``). Values themselves (NaN, magnitudes) are assessed by the daemon's validation,
not here. Poses and twists flow often: their functions set fields one by one, the fastest way in protobuf.
"""

from __future__ import annotations

from typing import TypeVar

from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from ual import errors
from ual.contract.odometry import Odometry
from ual.errors import InvalidArgumentError, UalError
from ual.geometry import (
    IDENTITY,
    KEEP_HEADING,
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    Twist,
    TwistStamped,
    Vector3,
)
from ual.v1 import ual_pb2 as pb

M = TypeVar("M", bound=Message)

_NANOS_PER_MICRO = 1_000
_MICROS_PER_S = 1_000_000


# Time


def stamp_to_proto(stamp_s: float, message: Timestamp) -> None:
    """Writes UTC seconds since 1970, to the microsecond; 0 (not known) leaves the message unset."""
    if stamp_s:
        message.seconds, message.nanos = stamp_parts(stamp_s)


def stamp_parts(stamp_s: float) -> tuple[int, int]:
    """UTC seconds since 1970 as whole seconds, and the nanoseconds after these, to the microsecond."""
    seconds, micros = divmod(round(stamp_s * _MICROS_PER_S), _MICROS_PER_S)
    return seconds, micros * _NANOS_PER_MICRO


def stamp_from_proto(message: Timestamp) -> float:
    """UTC seconds since 1970; 0 when not set."""
    return message.seconds + message.nanos * 1e-9


def duration_to_proto(duration_s: float) -> Duration:
    """A duration, to the microsecond."""
    micros = round(duration_s * _MICROS_PER_S)
    # A protobuf duration has seconds and nanoseconds of one sign.
    sign = -1 if micros < 0 else 1
    seconds, rest = divmod(abs(micros), _MICROS_PER_S)
    return Duration(seconds=sign * seconds, nanos=sign * rest * _NANOS_PER_MICRO)


def duration_from_proto(message: Duration) -> float:
    """Seconds."""
    return message.seconds + message.nanos * 1e-9


def timestamp_to_proto(stamp_s: float) -> Timestamp | None:
    """UTC seconds since 1970, to the microsecond; None for 0, which is not known."""
    if not stamp_s:
        return None
    seconds, nanos = stamp_parts(stamp_s)
    return Timestamp(seconds=seconds, nanos=nanos)


# Geometry


def vector3_to_proto(vector: Vector3) -> pb.Vector3:
    """Three components."""
    return pb.Vector3(x=vector.x, y=vector.y, z=vector.z)


def vector3_from_proto(message: pb.Vector3) -> Vector3:
    """Three components; zeros when not set."""
    return Vector3(message.x, message.y, message.z)


def quaternion_to_proto(rotation: Quaternion) -> pb.Quaternion:
    """Four components."""
    return pb.Quaternion(x=rotation.x, y=rotation.y, z=rotation.z, w=rotation.w)


def quaternion_from_proto(message: pb.Quaternion) -> Quaternion:
    """Four components; zeros when not set."""
    return Quaternion(message.x, message.y, message.z, message.w)


def _write_pose(translation: Vector3, rotation: Quaternion, to: pb.Vector3, turned: pb.Quaternion) -> None:
    """Of a pose or a transform. Written out, as are twists: each sample has four, and a call for each costs as much."""
    to.x, to.y, to.z = translation.x, translation.y, translation.z
    turned.x, turned.y, turned.z, turned.w = rotation.x, rotation.y, rotation.z, rotation.w


def write_pose(pose: Pose, message: pb.Pose) -> None:
    """Writes a pose into an empty message."""
    _write_pose(pose.position, pose.orientation, message.position, message.orientation)


def write_twist(twist: Twist, message: pb.Twist) -> None:
    """Writes velocities into an empty message."""
    v, w, linear, angular = twist.linear, twist.angular, message.linear, message.angular
    linear.x, linear.y, linear.z = v.x, v.y, v.z
    angular.x, angular.y, angular.z = w.x, w.y, w.z


def write_transform(transform: Transform, message: pb.Transform) -> None:
    """Writes a transform with its frames and stamp into an empty message."""
    header = message.header
    stamp_to_proto(transform.stamp_s, header.stamp)
    header.frame_id = transform.frame_id
    message.child_frame_id = transform.child_frame_id
    _write_pose(transform.translation, transform.rotation, message.translation, message.rotation)


def pose_from_proto(message: pb.Pose) -> Pose:
    """A pose; zeros where it is not set."""
    position, orientation = message.position, message.orientation
    return Pose(
        Vector3(position.x, position.y, position.z),
        Quaternion(orientation.x, orientation.y, orientation.z, orientation.w),
    )


def twist_from_proto(message: pb.Twist) -> Twist:
    """Velocities; zeros where they are not set."""
    linear, angular = message.linear, message.angular
    return Twist(Vector3(linear.x, linear.y, linear.z), Vector3(angular.x, angular.y, angular.z))


def pose_stamped_to_proto(pose: PoseStamped) -> pb.PoseStamped:
    """A pose to fly to. Its stamp is left out: the daemon ignores it."""
    message = pb.PoseStamped()
    if pose.frame_id:
        message.header.frame_id = pose.frame_id
    write_pose(pose.pose, message.pose)
    return message


def pose_stamped_from_proto(message: pb.PoseStamped, field: str = "pose") -> PoseStamped:
    """A pose to fly to, whose stamp is ignored; an orientation that is not set keeps the heading."""
    if not message.HasField("pose"):
        raise not_set(f"{field}.pose")
    pose = message.pose
    if not pose.HasField("position"):
        raise not_set(f"{field}.pose.position")
    position, orientation = pose.position, pose.orientation
    return PoseStamped(
        Pose(
            Vector3(position.x, position.y, position.z),
            Quaternion(orientation.x, orientation.y, orientation.z, orientation.w)
            if pose.HasField("orientation")
            else KEEP_HEADING,
        ),
        message.header.frame_id,
    )


def twist_stamped_from_proto(message: pb.TwistStamped, field: str = "velocity") -> TwistStamped:
    """A velocity to fly, whose stamp is ignored; parts of the twist that are not set are zero."""
    if not message.HasField("twist"):
        raise not_set(f"{field}.twist")
    return TwistStamped(twist_from_proto(message.twist), message.header.frame_id)


def transform_to_proto(transform: Transform) -> pb.Transform:
    """A transform with its frames and stamp."""
    message = pb.Transform()
    write_transform(transform, message)
    return message


def transform_from_proto(message: pb.Transform) -> Transform:
    """A transform; a translation that is not set is zero, a rotation that is not set is none."""
    rotation, header = message.rotation, message.header
    return Transform(
        vector3_from_proto(message.translation),
        Quaternion(rotation.x, rotation.y, rotation.z, rotation.w) if message.HasField("rotation") else IDENTITY,
        header.frame_id,
        message.child_frame_id,
        stamp_from_proto(header.stamp),
    )


def point_stamped_to_proto(point: PointStamped) -> pb.PointStamped:
    """A point to look at. Its stamp is left out: the daemon ignores it."""
    message = pb.PointStamped(point=vector3_to_proto(point.point))
    if point.frame_id:
        message.header.frame_id = point.frame_id
    return message


def point_stamped_from_proto(message: pb.PointStamped, field: str) -> PointStamped:
    """A point to look at. Raises `InvalidArgumentError` where it is not set."""
    if not message.HasField("point"):
        raise not_set(f"{field}.point")
    return PointStamped(vector3_from_proto(message.point), message.header.frame_id)


def odometry_from_proto(message: pb.Odometry) -> Odometry:
    """Odometry; zeros where it is not set."""
    return Odometry(
        pose_from_proto(message.pose),
        twist_from_proto(message.twist),
        message.header.frame_id,
        message.child_frame_id,
        stamp_from_proto(message.header.stamp),
    )


# Errors


def task_error_to_proto(error: UalError) -> pb.TaskError:
    """Converts the error of a failed task."""
    return pb.TaskError(reason=error.reason, message=error.message, metadata=dict(error.metadata))


def task_error_from_proto(message: pb.TaskError) -> UalError:
    """Converts the error of a failed task into the one that waiting for the task raises."""
    return errors.from_reason(message.reason, message.message, dict(message.metadata))


def with_part(message: M, name: str, field: str) -> M:
    """Returns a message. Raises `InvalidArgumentError` where its part `name` is not set."""
    if not message.HasField(name):
        raise not_set(field)
    return message


def no_kind(value: object, field: str) -> InvalidArgumentError:
    """Returns that a value is none of those that a message can have."""
    return InvalidArgumentError(f"{field}: {value!r:.100} is no {field}", {"field": field})


def not_set(field: str) -> InvalidArgumentError:
    """Returns that a caller has left out a part."""
    return InvalidArgumentError(f"{field}: not set", {"field": field})
