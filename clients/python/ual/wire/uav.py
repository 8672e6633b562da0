"""Between the messages of ``ual.proto`` and their values. ``make proto`` writes this file: do not edit it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ual.contract.uav import (
    AltitudeReference,
    Battery,
    Capability,
    Circle,
    Frame,
    Geofence,
    GeoPoint,
    GeoWaypoint,
    GpsFix,
    GpsInfo,
    Health,
    Info,
    LeaseInfo,
    Limits,
    PathHeading,
    Plan,
    Route,
    State,
    TaskInfo,
    TaskKind,
    TaskStatus,
    Telemetry,
)
from ual.v1 import ual_pb2 as pb
from ual.wire import convert
from ual.wire.enums import member_of, number_of

_STATE: Mapping[int, State] = {each.value: each for each in State}

_ALTITUDE_REFERENCE: Mapping[int, AltitudeReference] = {each.value: each for each in AltitudeReference}

_PATH_HEADING: Mapping[int, PathHeading] = {each.value: each for each in PathHeading}

_TASK_KIND: Mapping[int, TaskKind] = {each.value: each for each in TaskKind}

_TASK_STATUS: Mapping[int, TaskStatus] = {each.value: each for each in TaskStatus}

_CAPABILITY: Mapping[int, Capability] = {each.value: each for each in Capability}


def altitude_reference_to_proto(value: AltitudeReference, field: str) -> pb.AltitudeReference.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.AltitudeReference.ValueType(number_of(value, AltitudeReference, field))


def altitude_reference_from_proto(number: int, field: str) -> AltitudeReference:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, _ALTITUDE_REFERENCE, field, AltitudeReference.HOME)


def path_heading_to_proto(value: PathHeading, field: str) -> pb.PathHeading.ValueType:
    """Makes a number of an enum. Raises `InvalidArgumentError` for what is no member of it."""
    return pb.PathHeading.ValueType(number_of(value, PathHeading, field))


def path_heading_from_proto(number: int, field: str) -> PathHeading:
    """Reads a number of an enum. Raises `InvalidArgumentError` for one that is not known, or not set."""
    return member_of(number, _PATH_HEADING, field, PathHeading.WAYPOINTS)


def geo_point_to_proto(value: GeoPoint) -> pb.GeoPoint:
    """Makes a message."""
    return pb.GeoPoint(
        latitude_deg=value.latitude_deg,
        longitude_deg=value.longitude_deg,
        altitude_amsl_m=value.altitude_amsl_m,
        altitude_home_m=value.altitude_home_m,
        altitude_ellipsoid_m=value.altitude_ellipsoid_m,
    )


def geo_point_from_proto(message: pb.GeoPoint) -> GeoPoint:
    """Reads a message."""
    return GeoPoint(
        message.latitude_deg,
        message.longitude_deg,
        message.altitude_amsl_m if message.HasField("altitude_amsl_m") else None,
        message.altitude_home_m if message.HasField("altitude_home_m") else None,
        message.altitude_ellipsoid_m if message.HasField("altitude_ellipsoid_m") else None,
    )


def battery_to_proto(value: Battery) -> pb.Battery:
    """Makes a message."""
    return pb.Battery(
        remaining_percent=value.remaining_percent,
        voltage_v=value.voltage_v,
        current_a=value.current_a,
        id=value.id,
        function=value.function,
    )


def battery_from_proto(message: pb.Battery) -> Battery:
    """Reads a message."""
    return Battery(
        message.remaining_percent if message.HasField("remaining_percent") else None,
        message.voltage_v if message.HasField("voltage_v") else None,
        message.current_a if message.HasField("current_a") else None,
        message.id,
        message.function,
    )


def gps_info_to_proto(value: GpsInfo) -> pb.GpsInfo:
    """Makes a message."""
    return pb.GpsInfo(
        fix=pb.GpsFix.ValueType(value.fix.value),
        satellites_count=value.satellites_count or 0,
        horizontal_accuracy_m=value.horizontal_accuracy_m,
        vertical_accuracy_m=value.vertical_accuracy_m,
        corrections_age_s=value.corrections_age_s,
        baseline_m=value.baseline_m,
    )


def gps_info_from_proto(message: pb.GpsInfo) -> GpsInfo:
    """Reads a message."""
    return GpsInfo(
        GpsFix(min(max(message.fix, GpsFix.NONE), GpsFix.RTK_FIXED)),
        message.satellites_count or None,
        message.horizontal_accuracy_m if message.HasField("horizontal_accuracy_m") else None,
        message.vertical_accuracy_m if message.HasField("vertical_accuracy_m") else None,
        message.corrections_age_s if message.HasField("corrections_age_s") else None,
        message.baseline_m if message.HasField("baseline_m") else None,
    )


def health_to_proto(value: Health) -> pb.Health:
    """Makes a message."""
    return pb.Health(
        is_ready_to_arm=value.is_ready_to_arm,
        failing_checks=value.failing_checks,
        link_quality=value.link_quality,
        failsafe=value.failsafe,
        held_by=value.held_by,
    )


def health_from_proto(message: pb.Health) -> Health:
    """Reads a message."""
    return Health(
        message.is_ready_to_arm if message.HasField("is_ready_to_arm") else None,
        tuple(message.failing_checks),
        message.link_quality if message.HasField("link_quality") else None,
        message.failsafe,
        message.held_by,
    )


def task_info_to_proto(value: TaskInfo) -> pb.Task:
    """Makes a message."""
    return pb.Task(
        id=value.id,
        kind=pb.TaskKind.ValueType(value.kind.value),
        status=pb.TaskStatus.ValueType(value.status.value),
        progress=value.progress,
        distance_left_m=value.distance_left_m,
        elapsed=convert.duration_to_proto(value.elapsed_s),
        waypoint_index=value.waypoint_index,
        error=None if value.error is None else convert.task_error_to_proto(value.error),
        description=value.description,
        is_paused=value.is_paused,
    )


def task_info_from_proto(message: pb.Task) -> TaskInfo:
    """Reads a message."""
    return TaskInfo(
        message.id,
        member_of(message.kind, _TASK_KIND, "task.kind"),
        member_of(message.status, _TASK_STATUS, "task.status"),
        message.progress if message.HasField("progress") else None,
        message.distance_left_m if message.HasField("distance_left_m") else None,
        convert.duration_from_proto(message.elapsed),
        message.waypoint_index if message.HasField("waypoint_index") else None,
        convert.task_error_from_proto(message.error) if message.HasField("error") else None,
        message.description,
        message.is_paused,
    )


def plan_to_proto(value: Plan) -> pb.Plan:
    """Makes a message."""
    return pb.Plan(
        length_m=value.length_m,
        duration=None if value.duration_s is None else convert.duration_to_proto(value.duration_s),
    )


def plan_from_proto(message: pb.Plan) -> Plan:
    """Reads a message."""
    return Plan(
        message.length_m if message.HasField("length_m") else None,
        convert.duration_from_proto(message.duration) if message.HasField("duration") else None,
    )


def frame_to_proto(value: Frame) -> pb.Frame:
    """Makes a message."""
    return pb.Frame(
        frame_id=value.frame_id,
        parent_frame_id=value.parent_frame_id,
        transform=None if value.transform is None else convert.transform_to_proto(value.transform),
        is_static=value.is_static,
    )


def frame_from_proto(message: pb.Frame) -> Frame:
    """Reads a message."""
    return Frame(
        message.frame_id,
        message.parent_frame_id,
        convert.transform_from_proto(message.transform) if message.HasField("transform") else None,
        message.is_static,
    )


def limits_to_proto(value: Limits) -> pb.Limits:
    """Makes a message."""
    return pb.Limits(
        horizontal_speed_m_s=value.horizontal_speed_m_s,
        climb_speed_m_s=value.climb_speed_m_s,
        descent_speed_m_s=value.descent_speed_m_s,
        horizontal_acceleration_m_s2=value.horizontal_acceleration_m_s2,
        vertical_acceleration_m_s2=value.vertical_acceleration_m_s2,
        yaw_rate_rad_s=value.yaw_rate_rad_s,
    )


def limits_from_proto(message: pb.Limits) -> Limits:
    """Reads a message."""
    return Limits(
        message.horizontal_speed_m_s,
        message.climb_speed_m_s,
        message.descent_speed_m_s,
        message.horizontal_acceleration_m_s2,
        message.vertical_acceleration_m_s2,
        message.yaw_rate_rad_s,
    )


def circle_to_proto(value: Circle) -> pb.Circle:
    """Makes a message."""
    return pb.Circle(
        center=convert.vector3_to_proto(value.center),
        radius_m=value.radius_m,
    )


def circle_from_proto(message: pb.Circle) -> Circle:
    """Reads a message."""
    return Circle(
        convert.vector3_from_proto(message.center),
        message.radius_m,
    )


def route_to_proto(value: Route) -> pb.Route:
    """Makes a message."""
    return pb.Route(
        header=pb.Header(frame_id=value.frame_id),
        points=map(convert.vector3_to_proto, value.points),
        task_id=value.task_id,
        is_goal_moving=value.is_goal_moving,
    )


def route_from_proto(message: pb.Route) -> Route:
    """Reads a message."""
    return Route(
        message.header.frame_id,
        tuple(map(convert.vector3_from_proto, message.points)),
        message.task_id,
        message.is_goal_moving,
    )


def geo_waypoint_to_proto(value: GeoWaypoint) -> pb.GeoWaypoint:
    """Makes a message."""
    return pb.GeoWaypoint(
        latitude_deg=value.latitude_deg,
        longitude_deg=value.longitude_deg,
        altitude_m=value.altitude_m,
        altitude_reference=pb.AltitudeReference.ValueType(value.altitude_reference.value),
        yaw_rad=value.yaw_rad,
    )


def geo_waypoint_from_proto(message: pb.GeoWaypoint) -> GeoWaypoint:
    """Reads a message."""
    return GeoWaypoint(
        message.latitude_deg,
        message.longitude_deg,
        message.altitude_m,
        member_of(message.altitude_reference, _ALTITUDE_REFERENCE, "altitude_reference", AltitudeReference.HOME),
        message.yaw_rad if message.HasField("yaw_rad") else None,
    )


def lease_info_to_proto(value: LeaseInfo) -> pb.Lease:
    """Makes a message."""
    return pb.Lease(
        holder=value.holder,
        identity=value.identity,
        since=convert.timestamp_to_proto(value.since_s),
    )


def lease_info_from_proto(message: pb.Lease) -> LeaseInfo:
    """Reads a message."""
    return LeaseInfo(
        message.holder,
        message.identity,
        convert.stamp_from_proto(message.since),
    )


TELEMETRY_READERS: Mapping[str, Callable[[pb.Telemetry], object]] = {
    "state": lambda message: member_of(message.state, _STATE, "state"),
    "state_reason": lambda message: message.state_reason,
    "stamp_s": lambda message: convert.stamp_from_proto(message.header.stamp),
    "frame_id": lambda message: message.header.frame_id,
    "pose": lambda message: convert.pose_from_proto(message.pose) if message.HasField("pose") else None,
    "velocity": lambda message: convert.twist_from_proto(message.velocity) if message.HasField("velocity") else None,
    "odometry": lambda message: convert.odometry_from_proto(message.odometry) if message.HasField("odometry") else None,
    "transform": lambda message: (
        convert.transform_from_proto(message.transform) if message.HasField("transform") else None
    ),
    "reference_pose": lambda message: (
        convert.pose_from_proto(message.reference_pose) if message.HasField("reference_pose") else None
    ),
    "position_geo": lambda message: (
        geo_point_from_proto(message.position_geo) if message.HasField("position_geo") else None
    ),
    "battery": lambda message: battery_from_proto(message.battery) if message.HasField("battery") else None,
    "gps": lambda message: gps_info_from_proto(message.gps) if message.HasField("gps") else None,
    "flight_mode": lambda message: message.flight_mode,
    "armed": lambda message: message.armed,
    "task": lambda message: task_info_from_proto(message.task) if message.HasField("task") else None,
    "sequence": lambda message: message.sequence,
    "status_text": lambda message: message.status_text,
    "frame_lost": lambda message: message.frame_lost,
    "health": lambda message: health_from_proto(message.health) if message.HasField("health") else None,
    "batteries": lambda message: tuple(map(battery_from_proto, message.batteries)),
}
"""Reader of each field."""


def rare_of_telemetry(value: Telemetry) -> tuple[object, ...]:
    """Returns what `write_rare_of_telemetry` writes: while it is equal, that writes the same."""
    return (
        value.state,
        value.state_reason,
        value.battery,
        value.gps,
        value.flight_mode,
        value.armed,
        value.status_text,
        value.frame_lost,
        value.health,
        value.batteries,
    )


def write_rare_of_telemetry(value: Telemetry, message: pb.Telemetry) -> None:
    """Writes what changes rarely into an empty message."""
    message.state = pb.State.ValueType(value.state.value)
    message.state_reason = value.state_reason
    if value.battery is not None:
        message.battery.CopyFrom(battery_to_proto(value.battery))
    if value.gps is not None:
        message.gps.CopyFrom(gps_info_to_proto(value.gps))
    message.flight_mode = value.flight_mode
    message.armed = value.armed
    message.status_text = value.status_text
    message.frame_lost = value.frame_lost
    if value.health is not None:
        message.health.CopyFrom(health_to_proto(value.health))
    if value.batteries:
        message.batteries.extend(map(battery_to_proto, value.batteries))


def geofence_to_proto(value: Geofence) -> pb.Geofence:
    """Makes a message."""
    return pb.Geofence(
        header=pb.Header(frame_id=value.frame_id),
        corners=map(convert.vector3_to_proto, value.corners),
        circle=None if value.circle is None else circle_to_proto(value.circle),
        min_z_m=value.min_z_m,
        max_z_m=value.max_z_m,
    )


def geofence_from_proto(message: pb.Geofence) -> Geofence:
    """Reads a message."""
    return Geofence(
        message.header.frame_id,
        tuple(map(convert.vector3_from_proto, message.corners)),
        circle_from_proto(message.circle) if message.HasField("circle") else None,
        message.min_z_m if message.HasField("min_z_m") else None,
        message.max_z_m if message.HasField("max_z_m") else None,
    )


def info_to_proto(value: Info) -> pb.GetInfoResponse:
    """Makes a message."""
    return pb.GetInfoResponse(
        namespace=value.namespace,
        backend=value.backend,
        autopilot=value.autopilot,
        autopilot_version=value.autopilot_version,
        is_simulation=value.is_simulation,
        capabilities=[pb.Capability.ValueType(each) for each in sorted(each.value for each in value.capabilities)],
        limits=limits_to_proto(value.limits),
        ual_version=value.ual_version,
        is_arming_allowed=value.is_arming_allowed,
        url=value.url,
        has_safety_pilot=value.has_safety_pilot,
    )


def info_from_proto(message: pb.GetInfoResponse) -> Info:
    """Reads a message."""
    return Info(
        message.namespace,
        message.backend,
        message.autopilot,
        message.autopilot_version,
        message.is_simulation,
        frozenset(_CAPABILITY[each] for each in message.capabilities if each in _CAPABILITY),
        limits_from_proto(message.limits),
        message.ual_version,
        message.is_arming_allowed,
        message.url,
        message.has_safety_pilot,
    )
