"""Between what moves a UAV and its messages: requests of tasks, setpoints, and poses from outside.

Setpoints and poses from outside flow often: their functions set fields one by one, the fastest way in protobuf.
"""

from __future__ import annotations

from typing import TypeAlias

from ual.errors import InvalidArgumentError
from ual.geometry import PointStamped, Pose, PoseStamped, Transform, Twist, TwistStamped
from ual.types import (
    ExternalPose,
    FollowPathRequest,
    GeoWaypoint,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    LandRequest,
    ReturnToLaunchRequest,
    TakeOffRequest,
    TaskRequest,
)
from ual.v1 import ual_pb2 as pb
from ual.wire import uav
from ual.wire.convert import (
    not_set,
    point_stamped_from_proto,
    point_stamped_to_proto,
    pose_stamped_from_proto,
    pose_stamped_to_proto,
    stamp_from_proto,
    stamp_to_proto,
    transform_from_proto,
    twist_stamped_from_proto,
    write_pose,
    write_twist,
)

TaskRequestMessage: TypeAlias = (
    "pb.TakeOffRequest | pb.LandRequest | pb.GoToWaypointRequest | pb.GoToWaypointGeoRequest | pb.FollowPathRequest "
    "| pb.ReturnToLaunchRequest"
)


# Requests of tasks


def task_request_to_proto(request: TaskRequest, *, non_blocking: bool = False) -> TaskRequestMessage:
    """Converts the request of a task into the message of its method."""
    if isinstance(request, TakeOffRequest):
        return pb.TakeOffRequest(height_m=_required(request.height_m), non_blocking=non_blocking, force=request.force)
    if isinstance(request, LandRequest):
        return pb.LandRequest(non_blocking=non_blocking)
    if isinstance(request, GoToWaypointRequest):
        return pb.GoToWaypointRequest(
            waypoint=pose_stamped_to_proto(request.waypoint),
            max_speed_m_s=_max_speed_to_proto(request.max_speed_m_s),
            non_blocking=non_blocking,
        )
    if isinstance(request, GoToWaypointGeoRequest):
        return pb.GoToWaypointGeoRequest(
            latitude_deg=_required(request.waypoint.latitude_deg),
            longitude_deg=_required(request.waypoint.longitude_deg),
            altitude_m=_required(request.waypoint.altitude_m),
            altitude_reference=pb.AltitudeReference.ValueType(request.waypoint.altitude_reference.value),
            yaw_rad=request.waypoint.yaw_rad,
            max_speed_m_s=_max_speed_to_proto(request.max_speed_m_s),
            non_blocking=non_blocking,
        )
    if isinstance(request, ReturnToLaunchRequest):
        return pb.ReturnToLaunchRequest(height_m=request.height_m, non_blocking=non_blocking)
    return _follow_path_to_proto(request, non_blocking)


def _required(value: float) -> float:
    """Returns the value. None is refused: protobuf takes it for a field that is left out, and so for 0."""
    if value is None:
        raise TypeError("None is not a number")
    return value


def _follow_path_to_proto(request: FollowPathRequest, non_blocking: bool) -> pb.FollowPathRequest:
    interest = request.point_of_interest
    return pb.FollowPathRequest(
        waypoints=[pose_stamped_to_proto(each) for each in request.waypoints if not isinstance(each, GeoWaypoint)],
        geo_waypoints=[_geo_waypoint_to_proto(each) for each in request.waypoints if isinstance(each, GeoWaypoint)],
        corner_radius_m=_required(request.corner_radius_m),
        max_speed_m_s=_max_speed_to_proto(request.max_speed_m_s),
        leg_speeds_m_s=request.leg_speeds_m_s,
        heading=pb.PathHeading.ValueType(request.heading.value),
        point_of_interest=None if interest is None else point_stamped_to_proto(interest),
        holds_s=request.holds_s,
        non_blocking=non_blocking,
    )


def task_request_from_proto(message: TaskRequestMessage) -> TaskRequest:
    """Converts the message of a task's method. Raises `InvalidArgumentError` for a part that is missing or unknown."""
    if isinstance(message, pb.TakeOffRequest):
        return TakeOffRequest(message.height_m, message.force)
    if isinstance(message, pb.LandRequest):
        return LandRequest()
    if isinstance(message, pb.GoToWaypointRequest):
        if not message.HasField("waypoint"):
            raise not_set("waypoint")
        return GoToWaypointRequest(pose_stamped_from_proto(message.waypoint, "waypoint"), message.max_speed_m_s or None)
    if isinstance(message, pb.GoToWaypointGeoRequest):
        return GoToWaypointGeoRequest(_geo_waypoint_of(message), message.max_speed_m_s or None)
    if isinstance(message, pb.ReturnToLaunchRequest):
        return ReturnToLaunchRequest(message.height_m if message.HasField("height_m") else None)
    return _follow_path_from_proto(message)


def _follow_path_from_proto(message: pb.FollowPathRequest) -> FollowPathRequest:
    poses = (pose_stamped_from_proto(each, f"waypoints[{i}]") for i, each in enumerate(message.waypoints))
    return FollowPathRequest(
        # None, and both kinds at once, are for the daemon's validation to refuse.
        [*poses, *map(uav.geo_waypoint_from_proto, message.geo_waypoints)],
        message.corner_radius_m,
        message.max_speed_m_s or None,
        tuple(message.leg_speeds_m_s),
        uav.path_heading_from_proto(message.heading, "heading"),
        _point_of_interest_from_proto(message),
        tuple(message.holds_s),
    )


def _max_speed_to_proto(max_speed_m_s: float | None) -> float:
    """In requests 0 stands for no speed. One that is given as 0 must not become that."""
    if max_speed_m_s == 0.0:
        raise InvalidArgumentError("max_speed_m_s: is zero; it must be more", {"field": "max_speed_m_s"})
    return 0.0 if max_speed_m_s is None else max_speed_m_s


def _geo_waypoint_to_proto(waypoint: GeoWaypoint) -> pb.GeoWaypoint:
    return pb.GeoWaypoint(
        latitude_deg=_required(waypoint.latitude_deg),
        longitude_deg=_required(waypoint.longitude_deg),
        altitude_m=_required(waypoint.altitude_m),
        altitude_reference=pb.AltitudeReference.ValueType(waypoint.altitude_reference.value),
        yaw_rad=waypoint.yaw_rad,
    )


def _geo_waypoint_of(message: pb.GoToWaypointGeoRequest) -> GeoWaypoint:
    return GeoWaypoint(
        message.latitude_deg,
        message.longitude_deg,
        message.altitude_m,
        uav.altitude_reference_from_proto(message.altitude_reference, "altitude_reference"),
        message.yaw_rad if message.HasField("yaw_rad") else None,
    )


def _point_of_interest_from_proto(request: pb.FollowPathRequest) -> PointStamped | None:
    if not request.HasField("point_of_interest"):
        return None
    return point_stamped_from_proto(request.point_of_interest, "point_of_interest")


# References


def pose_setpoint_from_proto(request: pb.SetPoseRequest | pb.StreamSetpointsRequest) -> PoseStamped:
    """The reference of SetPose, or of a setpoint that has one."""
    if not request.HasField("pose"):
        raise not_set("pose")
    return pose_stamped_from_proto(request.pose, "pose")


def velocity_setpoint_from_proto(request: pb.SetVelocityRequest | pb.StreamSetpointsRequest) -> TwistStamped:
    """The reference of SetVelocity, or of a setpoint that has one."""
    if not request.HasField("velocity"):
        raise not_set("velocity")
    return twist_stamped_from_proto(request.velocity, "velocity")


def setpoint_from_proto(request: pb.StreamSetpointsRequest) -> PoseStamped | TwistStamped:
    """One setpoint of the stream."""
    kind = request.WhichOneof("setpoint")
    if kind == "velocity":
        return twist_stamped_from_proto(request.velocity, "velocity")
    if kind == "pose":
        return pose_stamped_from_proto(request.pose, "pose")
    raise not_set("setpoint")


def _require_numbers_of_pose(pose: Pose) -> None:
    """Raises `TypeError` for a bool, which protobuf takes for a number. Written out: each setpoint is asked."""
    p, q = pose.position, pose.orientation
    if bool in (
        p.x.__class__, p.y.__class__, p.z.__class__, q.x.__class__, q.y.__class__, q.z.__class__, q.w.__class__,
    ):  # fmt: skip
        raise TypeError("a bool is no number")


def _require_numbers_of_twist(twist: Twist) -> None:
    """Raises `TypeError` for a bool; see `_require_numbers_of_pose`."""
    v, w = twist.linear, twist.angular
    if bool in (v.x.__class__, v.y.__class__, v.z.__class__, w.x.__class__, w.y.__class__, w.z.__class__):
        raise TypeError("a bool is no number")


def setpoint_to_proto(setpoint: PoseStamped | TwistStamped) -> pb.StreamSetpointsRequest:
    """One setpoint of the stream.

    Raises:
        TypeError: A part is no number, or a bool.

    """
    message = pb.StreamSetpointsRequest()
    if isinstance(setpoint, TwistStamped):
        velocity = message.velocity
        if setpoint.frame_id:
            velocity.header.frame_id = setpoint.frame_id
        _require_numbers_of_twist(setpoint.twist)
        write_twist(setpoint.twist, velocity.twist)
    else:
        pose = message.pose
        if setpoint.frame_id:
            pose.header.frame_id = setpoint.frame_id
        _require_numbers_of_pose(setpoint.pose)
        write_pose(setpoint.pose, pose.pose)
    return message


def external_pose_to_proto(measured: ExternalPose) -> pb.StreamExternalPosesRequest:
    """One pose from outside of the stream.

    Raises:
        TypeError: A part is no number, or a bool.

    """
    if bool in (measured.position_std_dev_m.__class__, measured.orientation_std_dev_rad.__class__):
        raise TypeError("a bool is no number")
    _require_numbers_of_pose(measured.pose.pose)
    message = pb.StreamExternalPosesRequest()
    external, pose = message.external_pose, measured.pose
    if pose.frame_id:
        external.pose.header.frame_id = pose.frame_id
    stamp_to_proto(pose.stamp_s, external.pose.header.stamp)
    write_pose(pose.pose, external.pose.pose)
    if measured.position_std_dev_m is not None:
        external.position_std_dev_m = measured.position_std_dev_m
    if measured.orientation_std_dev_rad is not None:
        external.orientation_std_dev_rad = measured.orientation_std_dev_rad
    return message


def external_pose_from_proto(request: pb.SetExternalPoseRequest | pb.StreamExternalPosesRequest) -> ExternalPose:
    """One pose from outside. Without an orientation it has all zeros, which is no rotation."""
    if not request.HasField("external_pose"):
        raise not_set("external_pose")
    external = request.external_pose
    if not external.HasField("pose"):
        raise not_set("external_pose.pose")
    pose = pose_stamped_from_proto(external.pose, "external_pose.pose")
    return ExternalPose(
        PoseStamped(pose.pose, pose.frame_id, stamp_from_proto(external.pose.header.stamp)),
        external.position_std_dev_m if external.HasField("position_std_dev_m") else None,
        external.orientation_std_dev_rad if external.HasField("orientation_std_dev_rad") else None,
    )


def new_frame_from_proto(request: pb.AddFrameRequest) -> Transform:
    """The frame that AddFrame adds."""
    if not request.HasField("transform"):
        raise not_set("transform")
    return transform_from_proto(request.transform)
