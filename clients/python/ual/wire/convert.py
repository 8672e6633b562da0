"""Between `ual.v1` protobuf messages and the value types: the only module that knows both.

``x_to_proto`` makes a message, ``x_from_proto`` a value. A reader of a message of which a caller may leave out a
part takes `field`, the name of the message in its request. It raises `InvalidArgumentError` that names the missing part
(``waypoint.pose.position: not set``). Values themselves (NaN, magnitudes) are judged by the daemon's validation,
not here. Poses, twists and telemetry flow often: their functions set fields one by one, the fastest way in protobuf.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from operator import attrgetter
from typing import Any, TypeAlias, TypeVar

from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp

from ual import errors
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
from ual.simulation import (
    AckLate,
    AckLost,
    BatteryLow,
    Command,
    CommandRefused,
    EstimatorJumps,
    FailsafeTriggered,
    Fault,
    LinkLost,
    MotorsWeak,
    PositionLost,
    SimulationPart,
)
from ual.types import (
    AltitudeReference,
    Battery,
    Capability,
    Circle,
    ExternalPose,
    FollowPathRequest,
    Frame,
    Geofence,
    GeoPoint,
    GeoWaypoint,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    GpsFix,
    GpsInfo,
    Health,
    Info,
    LandRequest,
    LeaseInfo,
    Limits,
    Odometry,
    PathHeading,
    Plan,
    ReturnToLaunchRequest,
    Route,
    State,
    TakeOffRequest,
    TaskInfo,
    TaskKind,
    TaskRequest,
    TaskStatus,
    Telemetry,
)
from ual.v1 import simulation_pb2 as sim_pb
from ual.v1 import ual_pb2 as pb

_E = TypeVar("_E", bound=Enum)

TaskRequestMessage: TypeAlias = (
    "pb.TakeOffRequest | pb.LandRequest | pb.GoToWaypointRequest | pb.GoToWaypointGeoRequest | pb.FollowPathRequest "
    "| pb.ReturnToLaunchRequest"
)

_STATE_TO_PROTO = {state: pb.State.ValueType(state.value) for state in State}
_STATE_FROM_PROTO: Mapping[int, State] = {state.value: state for state in State}
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


def _write_place(translation: Vector3, rotation: Quaternion, to: pb.Vector3, turned: pb.Quaternion) -> None:
    """Of a pose or a transform. Written out, as are twists: each sample has four, and a call for each costs as much."""
    to.x, to.y, to.z = translation.x, translation.y, translation.z
    turned.x, turned.y, turned.z, turned.w = rotation.x, rotation.y, rotation.z, rotation.w


def _write_pose(pose: Pose, message: pb.Pose) -> None:
    _write_place(pose.position, pose.orientation, message.position, message.orientation)


def _write_twist(twist: Twist, message: pb.Twist) -> None:
    v, w, linear, angular = twist.linear, twist.angular, message.linear, message.angular
    linear.x, linear.y, linear.z = v.x, v.y, v.z
    angular.x, angular.y, angular.z = w.x, w.y, w.z


def _write_transform(transform: Transform, message: pb.Transform) -> None:
    header = message.header
    stamp_to_proto(transform.stamp_s, header.stamp)
    header.frame_id = transform.frame_id
    message.child_frame_id = transform.child_frame_id
    _write_place(transform.translation, transform.rotation, message.translation, message.rotation)


def _read_pose(message: pb.Pose) -> Pose:
    position, orientation = message.position, message.orientation
    return Pose(
        Vector3(position.x, position.y, position.z),
        Quaternion(orientation.x, orientation.y, orientation.z, orientation.w),
    )


def _read_twist(message: pb.Twist) -> Twist:
    linear, angular = message.linear, message.angular
    return Twist(Vector3(linear.x, linear.y, linear.z), Vector3(angular.x, angular.y, angular.z))


def pose_stamped_to_proto(pose: PoseStamped) -> pb.PoseStamped:
    """A pose to fly to. Its stamp is left out: the daemon ignores it."""
    message = pb.PoseStamped()
    if pose.frame_id:
        message.header.frame_id = pose.frame_id
    _write_pose(pose.pose, message.pose)
    return message


def pose_stamped_from_proto(message: pb.PoseStamped, field: str = "pose") -> PoseStamped:
    """A pose to fly to, whose stamp is ignored; an orientation that is not set keeps the heading."""
    if not message.HasField("pose"):
        raise _not_set(f"{field}.pose")
    pose = message.pose
    if not pose.HasField("position"):
        raise _not_set(f"{field}.pose.position")
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
        raise _not_set(f"{field}.twist")
    return TwistStamped(_read_twist(message.twist), message.header.frame_id)


def transform_to_proto(transform: Transform) -> pb.Transform:
    """A transform with its frames and stamp."""
    message = pb.Transform()
    _write_transform(transform, message)
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


# Requests of tasks


def task_request_to_proto(request: TaskRequest, *, non_blocking: bool = False) -> TaskRequestMessage:
    """Converts the request of a task into the message of its method."""
    if isinstance(request, TakeOffRequest):
        return pb.TakeOffRequest(height_m=_given(request.height_m), non_blocking=non_blocking, force=request.force)
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
            latitude_deg=_given(request.waypoint.latitude_deg),
            longitude_deg=_given(request.waypoint.longitude_deg),
            altitude_m=_given(request.waypoint.altitude_m),
            altitude_reference=_altitude_reference_to_proto(request.waypoint.altitude_reference),
            yaw_rad=request.waypoint.yaw_rad,
            max_speed_m_s=_max_speed_to_proto(request.max_speed_m_s),
            non_blocking=non_blocking,
        )
    if isinstance(request, ReturnToLaunchRequest):
        return pb.ReturnToLaunchRequest(height_m=request.height_m, non_blocking=non_blocking)
    return _follow_path_to_proto(request, non_blocking)


def _given(value: float) -> float:
    """Returns the value. None is refused: protobuf takes it for a field that is left out, and so for 0."""
    if value is None:
        raise TypeError("None is not a number")
    return value


def _follow_path_to_proto(request: FollowPathRequest, non_blocking: bool) -> pb.FollowPathRequest:
    interest = request.point_of_interest
    return pb.FollowPathRequest(
        waypoints=[pose_stamped_to_proto(each) for each in request.waypoints if not isinstance(each, GeoWaypoint)],
        geo_waypoints=[_geo_waypoint_to_proto(each) for each in request.waypoints if isinstance(each, GeoWaypoint)],
        corner_radius_m=_given(request.corner_radius_m),
        max_speed_m_s=_max_speed_to_proto(request.max_speed_m_s),
        leg_speeds_m_s=request.leg_speeds_m_s,
        heading=_path_heading_to_proto(request.heading),
        point_of_interest=None if interest is None else point_stamped_to_proto(interest),
        holds_s=request.holds_s,
        non_blocking=non_blocking,
    )


def task_request_from_proto(message: TaskRequestMessage) -> TaskRequest:
    """Converts the message of a task's method into its request. Raises `InvalidArgumentError` for a part that is
    missing or unknown.
    """
    if isinstance(message, pb.TakeOffRequest):
        return TakeOffRequest(message.height_m, message.force)
    if isinstance(message, pb.LandRequest):
        return LandRequest()
    if isinstance(message, pb.GoToWaypointRequest):
        if not message.HasField("waypoint"):
            raise _not_set("waypoint")
        return GoToWaypointRequest(pose_stamped_from_proto(message.waypoint, "waypoint"), message.max_speed_m_s or None)
    if isinstance(message, pb.GoToWaypointGeoRequest):
        return GoToWaypointGeoRequest(_geo_waypoint_from_proto(message), message.max_speed_m_s or None)
    if isinstance(message, pb.ReturnToLaunchRequest):
        return ReturnToLaunchRequest(message.height_m if message.HasField("height_m") else None)
    return _follow_path_from_proto(message)


def _follow_path_from_proto(message: pb.FollowPathRequest) -> FollowPathRequest:
    poses = (pose_stamped_from_proto(each, f"waypoints[{i}]") for i, each in enumerate(message.waypoints))
    heading: int = message.heading
    return FollowPathRequest(
        # None, and both kinds at once, are for the daemon's validation to refuse.
        [*poses, *map(_geo_waypoint_from_proto, message.geo_waypoints)],
        message.corner_radius_m,
        message.max_speed_m_s or None,
        tuple(message.leg_speeds_m_s),
        _enum(PathHeading, heading or PathHeading.WAYPOINTS.value, "heading"),
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
        latitude_deg=_given(waypoint.latitude_deg),
        longitude_deg=_given(waypoint.longitude_deg),
        altitude_m=_given(waypoint.altitude_m),
        altitude_reference=_altitude_reference_to_proto(waypoint.altitude_reference),
        yaw_rad=waypoint.yaw_rad,
    )


def _geo_waypoint_from_proto(message: pb.GeoWaypoint | pb.GoToWaypointGeoRequest) -> GeoWaypoint:
    reference: int = message.altitude_reference
    return GeoWaypoint(
        message.latitude_deg,
        message.longitude_deg,
        message.altitude_m,
        _enum(AltitudeReference, reference or AltitudeReference.HOME.value, "altitude_reference"),
        message.yaw_rad if message.HasField("yaw_rad") else None,
    )


def point_stamped_to_proto(point: PointStamped) -> pb.PointStamped:
    """A point to look at. Its stamp is left out: the daemon ignores it."""
    message = pb.PointStamped(point=vector3_to_proto(point.point))
    if point.frame_id:
        message.header.frame_id = point.frame_id
    return message


def _point_of_interest_from_proto(request: pb.FollowPathRequest) -> PointStamped | None:
    if not request.HasField("point_of_interest"):
        return None
    return point_stamped_from_proto(request.point_of_interest, "point_of_interest")


def point_stamped_from_proto(message: pb.PointStamped, field: str) -> PointStamped:
    """A point to look at. Raises `InvalidArgumentError` where it is not set."""
    if not message.HasField("point"):
        raise _not_set(f"{field}.point")
    return PointStamped(vector3_from_proto(message.point), message.header.frame_id)


# References


def pose_from_proto(request: pb.SetPoseRequest | pb.StreamSetpointsRequest) -> PoseStamped:
    """The reference of SetPose, or of a setpoint that has one."""
    if not request.HasField("pose"):
        raise _not_set("pose")
    return pose_stamped_from_proto(request.pose, "pose")


def velocity_from_proto(request: pb.SetVelocityRequest | pb.StreamSetpointsRequest) -> TwistStamped:
    """The reference of SetVelocity, or of a setpoint that has one."""
    if not request.HasField("velocity"):
        raise _not_set("velocity")
    return twist_stamped_from_proto(request.velocity, "velocity")


def setpoint_from_proto(request: pb.StreamSetpointsRequest) -> PoseStamped | TwistStamped:
    """One setpoint of the stream."""
    kind = request.WhichOneof("setpoint")
    if kind == "velocity":
        return twist_stamped_from_proto(request.velocity, "velocity")
    if kind == "pose":
        return pose_stamped_from_proto(request.pose, "pose")
    raise _not_set("setpoint")


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
        _write_twist(setpoint.twist, velocity.twist)
    else:
        pose = message.pose
        if setpoint.frame_id:
            pose.header.frame_id = setpoint.frame_id
        _require_numbers_of_pose(setpoint.pose)
        _write_pose(setpoint.pose, pose.pose)
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
    _write_pose(pose.pose, external.pose.pose)
    if measured.position_std_dev_m is not None:
        external.position_std_dev_m = measured.position_std_dev_m
    if measured.orientation_std_dev_rad is not None:
        external.orientation_std_dev_rad = measured.orientation_std_dev_rad
    return message


def external_pose_from_proto(request: pb.SetExternalPoseRequest | pb.StreamExternalPosesRequest) -> ExternalPose:
    """One pose from outside. Without an orientation it has all zeros, which is no rotation."""
    if not request.HasField("external_pose"):
        raise _not_set("external_pose")
    external = request.external_pose
    if not external.HasField("pose"):
        raise _not_set("external_pose.pose")
    pose = pose_stamped_from_proto(external.pose, "external_pose.pose")
    return ExternalPose(
        PoseStamped(pose.pose, pose.frame_id, stamp_from_proto(external.pose.header.stamp)),
        external.position_std_dev_m if external.HasField("position_std_dev_m") else None,
        external.orientation_std_dev_rad if external.HasField("orientation_std_dev_rad") else None,
    )


def new_frame_from_proto(request: pb.AddFrameRequest) -> Transform:
    """The frame that AddFrame adds."""
    if not request.HasField("transform"):
        raise _not_set("transform")
    return transform_from_proto(request.transform)


def _path_heading_to_proto(heading: PathHeading) -> pb.PathHeading.ValueType:
    """Converts the heading of FollowPath."""
    return pb.PathHeading.ValueType(heading.value)


def _altitude_reference_to_proto(reference: AltitudeReference) -> pb.AltitudeReference.ValueType:
    """The altitude reference of a geographic goal."""
    return pb.AltitudeReference.ValueType(reference.value)


# Tasks


def task_error_to_proto(error: UalError) -> pb.TaskError:
    """Converts the error of a failed task."""
    return pb.TaskError(reason=error.reason, message=error.message, metadata=dict(error.metadata))


def task_error_from_proto(message: pb.TaskError) -> UalError:
    """Converts the error of a failed task into the one that waiting for the task raises."""
    return errors.from_reason(message.reason, message.message, dict(message.metadata))


def task_to_proto(task: TaskInfo) -> pb.Task:
    """Converts the state of a task."""
    return pb.Task(
        id=task.id,
        kind=pb.TaskKind.ValueType(task.kind.value),
        status=pb.TaskStatus.ValueType(task.status.value),
        progress=task.progress,
        distance_left_m=task.distance_left_m,
        elapsed=duration_to_proto(task.elapsed_s),
        waypoint_index=task.waypoint_index,
        error=None if task.error is None else task_error_to_proto(task.error),
        description=task.description,
        is_paused=task.is_paused,
    )


def task_from_proto(message: pb.Task) -> TaskInfo:
    """Converts the state of a task."""
    return TaskInfo(
        id=message.id,
        kind=_enum(TaskKind, message.kind, "task.kind"),
        status=_enum(TaskStatus, message.status, "task.status"),
        progress=message.progress if message.HasField("progress") else None,
        distance_left_m=message.distance_left_m if message.HasField("distance_left_m") else None,
        elapsed_s=duration_from_proto(message.elapsed),
        waypoint_index=message.waypoint_index if message.HasField("waypoint_index") else None,
        error=task_error_from_proto(message.error) if message.HasField("error") else None,
        description=message.description,
        is_paused=message.is_paused,
    )


# Dry runs


def plan_to_proto(plan: Plan) -> pb.Plan:
    """Converts a plan."""
    return pb.Plan(
        length_m=plan.length_m,
        duration=None if plan.duration_s is None else duration_to_proto(plan.duration_s),
    )


def plan_from_proto(message: pb.Plan) -> Plan:
    """Converts a plan."""
    return Plan(
        message.length_m if message.HasField("length_m") else None,
        duration_from_proto(message.duration) if message.HasField("duration") else None,
    )


# Telemetry


def telemetry_to_proto(telemetry: Telemetry) -> pb.Telemetry:
    """One sample. `missed_count` belongs to a subscriber and is sent beside it."""
    message = pb.Telemetry()
    write_telemetry(telemetry, message)
    return message


def write_telemetry(telemetry: Telemetry, message: pb.Telemetry) -> None:
    """As `telemetry_to_proto`, into an empty message, or part of one."""
    write_rare(telemetry, message)
    header = message.header
    stamp_to_proto(telemetry.stamp_s, header.stamp)
    header.frame_id = telemetry.frame_id
    message.sequence = telemetry.sequence
    if telemetry.pose is not None:
        _write_pose(telemetry.pose, message.pose)
    if telemetry.velocity is not None:
        _write_twist(telemetry.velocity, message.velocity)
    if telemetry.odometry is not None:
        _write_odometry(telemetry.odometry, message.odometry, telemetry, message)
    if telemetry.transform is not None:
        _write_transform(telemetry.transform, message.transform)
    if telemetry.reference_pose is not None:
        _write_pose(telemetry.reference_pose, message.reference_pose)
    if telemetry.position_geo is not None:
        message.position_geo.CopyFrom(geo_point_to_proto(telemetry.position_geo))
    if telemetry.task is not None:
        message.task.CopyFrom(task_to_proto(telemetry.task))


def rare_of_telemetry(telemetry: Telemetry) -> tuple[object, ...]:
    """Returns the values that `write_rare` writes: while they are equal, it writes the same."""
    return (
        telemetry.state,
        telemetry.state_reason,
        telemetry.flight_mode,
        telemetry.armed,
        telemetry.status_text,
        telemetry.frame_lost,
        telemetry.battery,
        telemetry.batteries,
        telemetry.gps,
        telemetry.health,
    )


def write_rare(telemetry: Telemetry, message: pb.Telemetry) -> None:
    """Writes the part of a sample that changes rarely; see `rare_of_telemetry`."""
    message.state = _STATE_TO_PROTO[telemetry.state]
    message.state_reason = telemetry.state_reason
    message.flight_mode = telemetry.flight_mode
    message.armed = telemetry.armed
    message.status_text = telemetry.status_text
    if telemetry.frame_lost:
        message.frame_lost = telemetry.frame_lost
    if telemetry.battery is not None:
        message.battery.CopyFrom(_battery_to_proto(telemetry.battery))
    if telemetry.batteries:
        message.batteries.extend(map(_battery_to_proto, telemetry.batteries))
    if telemetry.gps is not None:
        message.gps.CopyFrom(_gps_to_proto(telemetry.gps))
    if telemetry.health is not None:
        _write_health(telemetry.health, message.health)


def telemetry_from_proto(message: pb.Telemetry, missed_count: int = 0) -> Telemetry:
    """One sample, with how many the subscriber missed before it.

    Most of it is made when it is first read: few subscribers read all of it. What a newer daemon may tell and we do not
    know is read now, so that it fails here.
    """
    return Telemetry.late(
        lambda name: _TELEMETRY_READERS[name](message),
        state=_STATE_FROM_PROTO.get(message.state) or _enum(State, message.state, "state"),
        task=task_from_proto(message.task) if message.HasField("task") else None,
        missed_count=missed_count,
    )


def _write_odometry(odometry: Odometry, message: pb.Odometry, telemetry: Telemetry, written: pb.Telemetry) -> None:
    """Writes the odometry; values of `telemetry` that `written` has already are copied, which is faster."""
    stamp_to_proto(odometry.stamp_s, message.header.stamp)
    message.header.frame_id = odometry.frame_id
    message.child_frame_id = odometry.child_frame_id
    if odometry.pose is telemetry.pose:
        message.pose.CopyFrom(written.pose)
    else:
        _write_pose(odometry.pose, message.pose)
    _write_twist(odometry.twist, message.twist)


def _odometry_from_proto(message: pb.Odometry) -> Odometry:
    return Odometry(
        _read_pose(message.pose),
        _read_twist(message.twist),
        message.header.frame_id,
        message.child_frame_id,
        stamp_from_proto(message.header.stamp),
    )


def geo_point_to_proto(point: GeoPoint) -> pb.GeoPoint:
    """A place on Earth."""
    return pb.GeoPoint(
        latitude_deg=point.latitude_deg,
        longitude_deg=point.longitude_deg,
        altitude_amsl_m=point.altitude_amsl_m,
        altitude_home_m=point.altitude_home_m,
        altitude_ellipsoid_m=point.altitude_ellipsoid_m,
    )


def geo_point_from_proto(message: pb.GeoPoint) -> GeoPoint:
    """A place on Earth."""
    has = message.HasField
    return GeoPoint(
        message.latitude_deg,
        message.longitude_deg,
        message.altitude_amsl_m if has("altitude_amsl_m") else None,
        message.altitude_home_m if has("altitude_home_m") else None,
        message.altitude_ellipsoid_m if has("altitude_ellipsoid_m") else None,
    )


def _battery_to_proto(battery: Battery) -> pb.Battery:
    return pb.Battery(
        remaining_percent=battery.remaining_percent,
        voltage_v=battery.voltage_v,
        current_a=battery.current_a,
        id=battery.id,
        function=battery.function,
    )


def _battery_from_proto(message: pb.Battery) -> Battery:
    has = message.HasField
    return Battery(
        message.remaining_percent if has("remaining_percent") else None,
        message.voltage_v if has("voltage_v") else None,
        message.current_a if has("current_a") else None,
        message.id,
        message.function,
    )


def _gps_to_proto(gps: GpsInfo) -> pb.GpsInfo:
    return pb.GpsInfo(
        fix=pb.GpsFix.ValueType(gps.fix.value),
        satellites_count=gps.satellites_count or 0,
        horizontal_accuracy_m=gps.horizontal_accuracy_m,
        vertical_accuracy_m=gps.vertical_accuracy_m,
        corrections_age_s=gps.corrections_age_s,
        baseline_m=gps.baseline_m,
    )


def _gps_from_proto(message: pb.GpsInfo) -> GpsInfo:
    has = message.HasField
    return GpsInfo(
        # Not said: taken as no fix. Better than any we know: taken as the best.
        GpsFix(min(max(message.fix, GpsFix.NONE), GpsFix.RTK_FIXED)),
        message.satellites_count or None,
        message.horizontal_accuracy_m if has("horizontal_accuracy_m") else None,
        message.vertical_accuracy_m if has("vertical_accuracy_m") else None,
        message.corrections_age_s if has("corrections_age_s") else None,
        message.baseline_m if has("baseline_m") else None,
    )


def _write_health(health: Health, message: pb.Health) -> None:
    message.SetInParent()  # also where all of it is empty
    if health.is_ready_to_arm is not None:
        message.is_ready_to_arm = health.is_ready_to_arm
    if health.failing_checks:
        message.failing_checks.extend(health.failing_checks)
    if health.link_quality is not None:
        message.link_quality = health.link_quality
    message.failsafe = health.failsafe
    message.held_by = health.held_by


def _health_from_proto(message: pb.Health) -> Health:
    has = message.HasField
    return Health(
        message.is_ready_to_arm if has("is_ready_to_arm") else None,
        tuple(message.failing_checks),
        message.link_quality if has("link_quality") else None,
        message.failsafe,
        message.held_by,
    )


def _reader(name: str, read: Callable[[Any], object]) -> Callable[[pb.Telemetry], object]:
    """Reads a part that may not be there."""
    return lambda message: read(getattr(message, name)) if message.HasField(name) else None  # type: ignore[arg-type]


_TELEMETRY_READERS: Mapping[str, Callable[[pb.Telemetry], object]] = {
    "stamp_s": lambda message: stamp_from_proto(message.header.stamp),
    "frame_id": lambda message: message.header.frame_id,
    "pose": _reader("pose", _read_pose),
    "velocity": _reader("velocity", _read_twist),
    "odometry": _reader("odometry", _odometry_from_proto),
    "transform": _reader("transform", transform_from_proto),
    "reference_pose": _reader("reference_pose", _read_pose),
    "position_geo": _reader("position_geo", geo_point_from_proto),
    "battery": _reader("battery", _battery_from_proto),
    "batteries": lambda message: tuple(map(_battery_from_proto, message.batteries)),
    "gps": _reader("gps", _gps_from_proto),
    "health": _reader("health", _health_from_proto),
    **{
        name: attrgetter(name)
        for name in ("state_reason", "flight_mode", "armed", "sequence", "status_text", "frame_lost")
    },
}


# Frames and info


def frame_to_proto(frame: Frame) -> pb.Frame:
    """One frame of the tree."""
    return pb.Frame(
        frame_id=frame.frame_id,
        parent_frame_id=frame.parent_frame_id,
        transform=None if frame.transform is None else transform_to_proto(frame.transform),
        is_static=frame.is_static,
    )


def frame_from_proto(message: pb.Frame) -> Frame:
    """One frame of the tree."""
    return Frame(
        message.frame_id,
        message.parent_frame_id,
        transform_from_proto(message.transform) if message.HasField("transform") else None,
        message.is_static,
    )


def geofence_to_proto(fence: Geofence) -> pb.Geofence:
    """Converts a geofence."""
    circle = fence.circle
    return pb.Geofence(
        header=pb.Header(frame_id=fence.frame_id),
        corners=[vector3_to_proto(corner) for corner in fence.corners],
        circle=None if circle is None else pb.Circle(center=vector3_to_proto(circle.center), radius_m=circle.radius_m),
        min_z_m=fence.min_z_m,
        max_z_m=fence.max_z_m,
    )


def geofence_from_proto(message: pb.Geofence) -> Geofence:
    """Converts a geofence."""
    circle = message.circle
    return Geofence(
        message.header.frame_id,
        tuple(vector3_from_proto(corner) for corner in message.corners),
        Circle(vector3_from_proto(circle.center), circle.radius_m) if message.HasField("circle") else None,
        message.min_z_m if message.HasField("min_z_m") else None,
        message.max_z_m if message.HasField("max_z_m") else None,
    )


def route_to_proto(route: Route) -> pb.Route:
    """The way that is flown."""
    return pb.Route(
        header=pb.Header(frame_id=route.frame_id),
        points=[vector3_to_proto(point) for point in route.points],
        task_id=route.task_id,
        is_goal_moving=route.is_goal_moving,
    )


def route_from_proto(message: pb.Route) -> Route:
    """The way that is flown."""
    points = tuple(vector3_from_proto(point) for point in message.points)
    return Route(message.header.frame_id, points, message.task_id, message.is_goal_moving)


def info_to_proto(info: Info) -> pb.GetInfoResponse:
    """Converts the info of a UAV; its capabilities in a fixed order."""
    limits = info.limits
    return pb.GetInfoResponse(
        namespace=info.namespace,
        backend=info.backend,
        autopilot=info.autopilot,
        autopilot_version=info.autopilot_version,
        is_simulation=info.is_simulation,
        capabilities=[pb.Capability.ValueType(value) for value in sorted(each.value for each in info.capabilities)],
        limits=pb.Limits(
            horizontal_speed_m_s=limits.horizontal_speed_m_s,
            climb_speed_m_s=limits.climb_speed_m_s,
            descent_speed_m_s=limits.descent_speed_m_s,
            horizontal_acceleration_m_s2=limits.horizontal_acceleration_m_s2,
            vertical_acceleration_m_s2=limits.vertical_acceleration_m_s2,
            yaw_rate_rad_s=limits.yaw_rate_rad_s,
        ),
        ual_version=info.ual_version,
        is_arming_allowed=info.is_arming_allowed,
        url=info.url,
        has_safety_pilot=info.has_safety_pilot,
    )


def info_from_proto(message: pb.GetInfoResponse) -> Info:
    """Converts the info of a UAV. Capabilities that only a newer client knows are left out."""
    known = {capability.value for capability in Capability}
    limits = message.limits
    return Info(
        namespace=message.namespace,
        backend=message.backend,
        autopilot=message.autopilot,
        autopilot_version=message.autopilot_version,
        is_simulation=message.is_simulation,
        capabilities=frozenset(Capability(value) for value in message.capabilities if value in known),
        limits=Limits(
            limits.horizontal_speed_m_s,
            limits.climb_speed_m_s,
            limits.descent_speed_m_s,
            limits.horizontal_acceleration_m_s2,
            limits.vertical_acceleration_m_s2,
            limits.yaw_rate_rad_s,
        ),
        ual_version=message.ual_version,
        is_arming_allowed=message.is_arming_allowed,
        url=message.url,
        has_safety_pilot=message.has_safety_pilot,
    )


# Simulation


def fault_to_proto(fault: Fault) -> sim_pb.Fault:
    """A fault."""
    match fault:
        case LinkLost():
            return sim_pb.Fault(link_lost=sim_pb.LinkLost())
        case PositionLost():
            return sim_pb.Fault(position_lost=sim_pb.PositionLost())
        case EstimatorJumps(offset, period_s):
            jumps = sim_pb.EstimatorJumps(offset=vector3_to_proto(offset), period_s=period_s)
            return sim_pb.Fault(estimator_jumps=jumps)
        case MotorsWeak(power_ratio):
            return sim_pb.Fault(motors_weak=sim_pb.MotorsWeak(power_ratio=power_ratio))
        case BatteryLow(remaining_percent):
            return sim_pb.Fault(battery_low=sim_pb.BatteryLow(remaining_percent=remaining_percent))
        case CommandRefused(command, text):
            return sim_pb.Fault(command_refused=sim_pb.CommandRefused(command=_command(command), text=text))
        case AckLost(command):
            return sim_pb.Fault(ack_lost=sim_pb.AckLost(command=_command(command)))
        case AckLate(command, delay_s):
            return sim_pb.Fault(ack_late=sim_pb.AckLate(command=_command(command), delay_s=delay_s))
        case FailsafeTriggered(cause):
            return sim_pb.Fault(failsafe_triggered=sim_pb.FailsafeTriggered(cause=cause))
    raise InvalidArgumentError(f"fault: {fault!r} is none of ual.simulation", {"field": "fault"})


def fault_from_proto(message: sim_pb.Fault, field: str = "fault") -> Fault:
    """A fault."""
    match message.WhichOneof("kind"):
        case "link_lost":
            return LinkLost()
        case "position_lost":
            return PositionLost()
        case "estimator_jumps":
            jumps = message.estimator_jumps
            if not jumps.HasField("offset"):
                raise _not_set(f"{field}.estimator_jumps.offset")
            return EstimatorJumps(vector3_from_proto(jumps.offset), jumps.period_s)
        case "motors_weak":
            return MotorsWeak(message.motors_weak.power_ratio)
        case "battery_low":
            return BatteryLow(message.battery_low.remaining_percent)
        case "command_refused":
            refused = message.command_refused
            return CommandRefused(_enum(Command, refused.command, f"{field}.command_refused.command"), refused.text)
        case "ack_lost":
            return AckLost(_enum(Command, message.ack_lost.command, f"{field}.ack_lost.command"))
        case "ack_late":
            late = message.ack_late
            return AckLate(_enum(Command, late.command, f"{field}.ack_late.command"), late.delay_s)
        case "failsafe_triggered":
            return FailsafeTriggered(message.failsafe_triggered.cause)
        case _:
            raise _not_set(f"{field}.kind")


def parts_to_proto(parts: Iterable[SimulationPart]) -> sim_pb.ListPartsResponse:
    """The parts of a simulation, in a fixed order."""
    values = sorted(part.value for part in parts)
    return sim_pb.ListPartsResponse(parts=[sim_pb.SimulationPart.ValueType(value) for value in values])


def parts_from_proto(message: sim_pb.ListPartsResponse) -> frozenset[SimulationPart]:
    """The parts of a simulation. Those that only a newer client knows are left out."""
    known = {part.value for part in SimulationPart}
    return frozenset(SimulationPart(value) for value in message.parts if value in known)


def faults_to_proto(faults: Mapping[str, Fault]) -> sim_pb.ListFaultsResponse:
    """The faults under way, by their ids."""
    return sim_pb.ListFaultsResponse(
        faults=[sim_pb.ActiveFault(fault_id=key, fault=fault_to_proto(fault)) for key, fault in faults.items()]
    )


def faults_from_proto(faults: Iterable[sim_pb.ActiveFault]) -> dict[str, Fault]:
    """The faults under way, by their ids."""
    return {active.fault_id: fault_from_proto(active.fault) for active in faults}


def wind_from_proto(request: sim_pb.SetWindRequest) -> Vector3:
    """The wind of SetWind."""
    if not request.HasField("velocity_m_s"):
        raise _not_set("velocity_m_s")
    return vector3_from_proto(request.velocity_m_s)


def place_from_proto(request: sim_pb.PlaceOnGroundRequest) -> Vector3:
    """The place of PlaceOnGround."""
    if not request.HasField("position"):
        raise _not_set("position")
    return vector3_from_proto(request.position)


def _command(command: Command) -> sim_pb.Command.ValueType:
    return sim_pb.Command.ValueType(command.value)


def _not_set(field: str) -> InvalidArgumentError:
    return InvalidArgumentError(f"{field}: not set", {"field": field})


def _enum(kind: type[_E], value: int, field: str) -> _E:
    try:
        return kind(value)
    except ValueError:
        known = ", ".join(f"{each.value} ({each.name})" for each in kind)
        raise InvalidArgumentError(f"{field}: {value} is none of {known}", {"field": field}) from None


def lease_to_proto(lease: LeaseInfo | None) -> pb.Lease | None:
    """Returns the message of a lease; None where there is none."""
    if lease is None:
        return None
    message = pb.Lease(holder=lease.holder, identity=lease.identity)
    stamp_to_proto(lease.since_s, message.since)
    return message


def lease_from_proto(response: pb.GetLeaseResponse) -> LeaseInfo | None:
    """Reads who has the lease; None where there is none."""
    if not response.HasField("lease"):
        return None
    return LeaseInfo(response.lease.holder, response.lease.identity, stamp_from_proto(response.lease.since))
