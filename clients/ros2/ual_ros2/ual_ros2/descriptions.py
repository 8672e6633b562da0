"""What a daemon says of its UAV, in messages of ``ual_msgs``. It needs no ROS: messages are known by their fields."""

from __future__ import annotations

import math
from collections.abc import Callable

import ual
from ual_ros2 import values
from ual_ros2.messages import Message

KeyValue = Callable[..., Message]


def fill_info(message: Message, info: ual.Info) -> None:
    """Fills an Info, but for its header."""
    message.ns = info.namespace
    for name in ("backend", "autopilot", "autopilot_version", "url", "ual_version"):
        setattr(message, name, getattr(info, name))
    for name in ("is_simulation", "is_arming_allowed", "has_safety_pilot"):
        setattr(message, name, getattr(info, name))
    message.capabilities = sorted(each.name for each in info.capabilities)
    limits = info.limits
    message.horizontal_speed, message.yaw_rate = limits.horizontal_speed_m_s, limits.yaw_rate_rad_s
    message.climb_speed, message.descent_speed = limits.climb_speed_m_s, limits.descent_speed_m_s
    message.horizontal_acceleration = limits.horizontal_acceleration_m_s2
    message.vertical_acceleration = limits.vertical_acceleration_m_s2


def fill_geofence(message: Message, geofence: ual.types.Geofence, point: Callable[[], Message]) -> None:
    """Fills a Geofence, but for its stamp; `point` makes a Point."""
    message.header.frame_id = geofence.frame_id
    message.corners = [point() for _ in geofence.corners]
    for corner, place in zip(message.corners, geofence.corners, strict=True):
        values.fill_vector(corner, place)
    message.has_circle = geofence.circle is not None
    if geofence.circle is not None:
        values.fill_vector(message.center, geofence.circle.center)
        message.radius = geofence.circle.radius_m
    message.min_z = -math.inf if geofence.min_z_m is None else geofence.min_z_m
    message.max_z = math.inf if geofence.max_z_m is None else geofence.max_z_m


def fill_lease(message: Message, lease: ual.types.LeaseInfo) -> None:
    """Fills a Lease that is held, but for its stamps."""
    message.is_held, message.holder, message.identity = True, lease.holder, lease.identity


def fill_task(message: Message, task: ual.TaskInfo, key_value: KeyValue) -> Message:
    """Fills a Task, and returns it."""
    message.task_id, message.kind, message.status = task.id, task.kind.name, task.status.name
    message.progress, message.distance_left = values.known(task.progress), values.known(task.distance_left_m)
    message.elapsed, message.is_paused, message.description = task.elapsed_s, task.is_paused, task.description
    message.waypoint_index = -1 if task.waypoint_index is None else task.waypoint_index
    if task.error is not None:
        message.reason, message.message = task.error.reason, task.error.message
        message.metadata = [key_value(key=key, value=value) for key, value in task.error.metadata.items()]
    return message


def fill_plan(message: Message, plan: ual.types.Plan) -> Message:
    """Fills a Plan, and returns it."""
    message.length, message.duration = values.known(plan.length_m), values.known(plan.duration_s)
    return message


def fill_frame(message: Message, frame: ual.Frame) -> Message:
    """Fills a Frame, and returns it."""
    message.frame_id, message.parent_frame_id = frame.frame_id, frame.parent_frame_id
    message.is_static, message.is_known = frame.is_static, frame.transform is not None
    if frame.transform is not None:
        values.fill_vector(message.transform.translation, frame.transform.translation)
        values.fill_quaternion(message.transform.rotation, frame.transform.rotation)
    return message


def fill_position(message: Message, position: ual.GeoPoint, gps: ual.GpsInfo | None) -> None:
    """Fills a GeoPosition, but for its header."""
    message.latitude, message.longitude = position.latitude_deg, position.longitude_deg
    message.altitude_amsl = values.known(position.altitude_amsl_m)
    message.altitude_home = values.known(position.altitude_home_m)
    message.altitude_ellipsoid = values.known(position.altitude_ellipsoid_m)
    message.gps_fix, message.satellites_count = ("", 0) if gps is None else (gps.fix.name, gps.satellites_count)
    message.horizontal_accuracy = values.known(None if gps is None else gps.horizontal_accuracy_m)
    message.vertical_accuracy = values.known(None if gps is None else gps.vertical_accuracy_m)
    message.corrections_age = values.known(None if gps is None else gps.corrections_age_s)
    message.baseline = values.known(None if gps is None else gps.baseline_m)


def fill_refusal(message: Message, topic: str, error: ual.UalError, count: int, key_value: KeyValue) -> None:
    """Fills a Refusal, but for its stamp."""
    message.topic, message.count = topic, count
    message.reason, message.message = error.reason, error.message
    message.metadata = [key_value(key=key, value=value) for key, value in error.metadata.items()]
