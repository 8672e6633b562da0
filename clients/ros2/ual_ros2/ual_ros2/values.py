"""From ROS messages to values of UAL and back, in one place. It needs no ROS: messages are known by their fields.

Both sides use SI units, radians, REP 103's axes and quaternions x, y, z, w; so numbers pass as they are. Nothing is
checked here: the daemon does that, once for all callers, and its words reach the caller.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import ual
from ual_ros2 import unknown
from ual_ros2.messages import Message

STATE_NUMBERS: Mapping[ual.State, int] = {state: state.value - 1 for state in ual.State}
"""The states' numbers in ``ual_msgs/State``: those of the first UAL, 0 to 6."""
NO_FIX, FIX, AUGMENTED_FIX, GROUND_FIX = -1, 0, 1, 2
"""The constants of ``sensor_msgs/NavSatStatus``."""
FIXES: Mapping[ual.GpsFix, int] = {
    ual.GpsFix.NONE: NO_FIX,
    ual.GpsFix.FIX_2D: FIX,
    ual.GpsFix.FIX_3D: FIX,
    ual.GpsFix.DIFFERENTIAL: AUGMENTED_FIX,
    ual.GpsFix.RTK_FLOAT: GROUND_FIX,
    ual.GpsFix.RTK_FIXED: GROUND_FIX,
}
COVARIANCE_UNKNOWN, COVARIANCE_DIAGONAL_KNOWN = 0, 2
DISCHARGING, POWER_STATUS_UNKNOWN = 2, 0
"""The constants of ``sensor_msgs/NavSatFix`` and ``sensor_msgs/BatteryState``."""
NANO = 1_000_000_000


# --- From ROS ---------------------------------------------------------------------------------------------------------


def vector(message: Message) -> ual.Vector3:
    """Reads a Vector3 or Point."""
    return ual.Vector3(message.x, message.y, message.z)


def quaternion(message: Message) -> ual.Quaternion:
    """Reads a Quaternion."""
    return ual.Quaternion(message.x, message.y, message.z, message.w)


def pose(message: Message) -> ual.Pose:
    """Reads a Pose."""
    return ual.Pose(vector(message.position), quaternion(message.orientation))


def pose_stamped(message: Message, frame_id: str = "", stamp_s: float = 0.0) -> ual.PoseStamped:
    """Reads a PoseStamped; `frame_id` is its frame where it names none."""
    return ual.PoseStamped(pose(message.pose), message.header.frame_id or frame_id, stamp_s)


def external_pose(message: Message, stamp_s: float) -> ual.types.ExternalPose:
    """Reads a PoseStamped."""
    return ual.types.ExternalPose(pose_stamped(message, stamp_s=stamp_s))


def external_pose_with_covariance(message: Message, stamp_s: float) -> ual.types.ExternalPose:
    """Reads a PoseWithCovarianceStamped."""
    told, covariance = message.pose, message.pose.covariance
    measured = ual.PoseStamped(pose(told.pose), message.header.frame_id, stamp_s)
    return ual.types.ExternalPose(measured, standard_deviation(covariance, 0), standard_deviation(covariance, 3))


def standard_deviation(covariance: Sequence[float], first: int) -> float | None:
    """Returns the largest of three axes from `first` on, of a matrix of 6 x 6; None where it is not known.

    That is where it is all zeros, or -1 as this node itself says it in `odom`.

    A variance that is none (negative, not finite) is NaN, so that the daemon refuses it.
    """
    variances = [float(covariance[7 * axis]) for axis in range(first, first + 3)]
    if not any(variances) or all(each == unknown.NOT_KNOWN for each in variances):
        return None
    return math.sqrt(max(variances)) if all(0.0 <= each < math.inf for each in variances) else math.nan


def twist(message: Message) -> ual.Twist:
    """Reads a Twist."""
    return ual.Twist(vector(message.linear), vector(message.angular))


def twist_stamped(message: Message) -> ual.TwistStamped:
    """Reads a TwistStamped."""
    return ual.TwistStamped(twist(message.twist), message.header.frame_id)


def transform_stamped(message: Message, stamp_s: float = 0.0) -> ual.Transform:
    """Reads a TransformStamped. Its own stamp is left out: it may be of a clock that is not UTC."""
    moved = message.transform
    return ual.Transform(
        vector(moved.translation), quaternion(moved.rotation), message.header.frame_id, message.child_frame_id, stamp_s
    )


def altitude_reference(number: int) -> ual.AltitudeReference:
    """Reads the constants of GoToWaypointGeo; 0 is home, as everywhere in UAL."""
    try:
        return ual.AltitudeReference(number or ual.AltitudeReference.HOME.value)
    except ValueError:
        raise _unknown("altitude_reference", number) from None


def path_heading(number: int) -> ual.PathHeading:
    """Reads the constants of FollowPath; 0 is that of each waypoint."""
    try:
        return ual.PathHeading(number or ual.PathHeading.WAYPOINTS.value)
    except ValueError:
        raise _unknown("heading", number) from None


def _unknown(field: str, number: int) -> ual.InvalidArgumentError:
    return ual.InvalidArgumentError(f"{field}: {number} is none of its constants", {"field": field})


def point_stamped(message: Message) -> ual.PointStamped:
    """Reads a PointStamped."""
    return ual.PointStamped(vector(message.point), message.header.frame_id)


def stamp_s(stamp: Message) -> float:
    """Reads a stamp, in seconds."""
    return float(stamp.sec + stamp.nanosec / NANO)


# --- To ROS: messages are made once and filled again, because making one costs time -----------------------------


def split(time_s: float) -> tuple[int, int]:
    """Splits a time into whole seconds and nanoseconds."""
    seconds = math.floor(time_s)
    nanoseconds = round((time_s - seconds) * NANO)
    return (seconds + 1, 0) if nanoseconds == NANO else (seconds, nanoseconds)


def fill_vector(message: Message, value: ual.Vector3) -> None:
    """Fills a Vector3 or Point."""
    message.x, message.y, message.z = value.x, value.y, value.z


def fill_pose(message: Message, value: ual.Pose) -> None:
    """Fills a Pose."""
    fill_vector(message.position, value.position)
    fill_quaternion(message.orientation, value.orientation)


def fill_quaternion(message: Message, value: ual.Quaternion) -> None:
    """Fills a Quaternion."""
    message.x, message.y, message.z, message.w = value.x, value.y, value.z, value.w


def fill_twist(message: Message, value: ual.Twist) -> None:
    """Fills a Twist."""
    fill_vector(message.linear, value.linear)
    fill_vector(message.angular, value.angular)


def fill_transform(message: Message, value: ual.Transform) -> None:
    """Fills a TransformStamped, but for its stamp."""
    message.header.frame_id, message.child_frame_id = value.frame_id, value.child_frame_id
    fill_vector(message.transform.translation, value.translation)
    fill_quaternion(message.transform.rotation, value.rotation)


def fill_battery(message: Message, value: ual.Battery) -> None:
    """Fills a BatteryState. ROS counts a current that discharges as negative."""
    percent, current_a = value.remaining_percent, value.current_a
    message.present = True
    message.location = f"id{value.id} {value.function}".strip()
    message.voltage = known(value.voltage_v)
    message.percentage = math.nan if percent is None else percent / 100.0
    message.current = math.nan if current_a is None else -current_a
    is_discharging = current_a is not None and current_a > 0.0
    message.power_supply_status = DISCHARGING if is_discharging else POWER_STATUS_UNKNOWN
    message.temperature = message.charge = message.capacity = message.design_capacity = math.nan


def fill_fix(message: Message, position: ual.GeoPoint, gps: ual.GpsInfo | None) -> None:
    """Fills a NavSatFix. Its altitude is above the ellipsoid, as ROS wants it; NaN where that is not known."""
    message.latitude, message.longitude = position.latitude_deg, position.longitude_deg
    message.altitude = known(position.altitude_ellipsoid_m)
    message.status.status = NO_FIX if gps is None else FIXES[gps.fix]
    message.position_covariance_type = COVARIANCE_UNKNOWN
    if gps is not None and gps.horizontal_accuracy_m is not None and gps.vertical_accuracy_m is not None:
        message.position_covariance_type = COVARIANCE_DIAGONAL_KNOWN
        horizontal_m2, vertical_m2 = gps.horizontal_accuracy_m**2, gps.vertical_accuracy_m**2
        message.position_covariance = [horizontal_m2, 0.0, 0.0, 0.0, horizontal_m2, 0.0, 0.0, 0.0, vertical_m2]


def fill_feedback(message: Message, sample: ual.Telemetry, task: ual.TaskInfo) -> None:
    """Fills the feedback that all actions have."""
    message.distance_left = known(task.distance_left_m)
    message.progress = known(task.progress)
    message.state = STATE_NUMBERS[sample.state]
    message.reason = sample.state_reason
    message.is_paused = task.is_paused
    message.task_id = task.id
    if hasattr(message, "waypoint_index"):  # of FollowPath only
        message.waypoint_index = -1 if task.waypoint_index is None else task.waypoint_index


def known(number: float | None) -> float:
    """Returns a number; NaN where it is not known."""
    return math.nan if number is None else number
