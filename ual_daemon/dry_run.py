"""The motions of the class, as questions; and what stands for what where a caller leaves out the frame."""

from __future__ import annotations

from collections.abc import Sequence

from ual.geometry import (
    PointStamped,
    Pose,
    PoseStamped,
    Twist,
    TwistStamped,
    Vector3,
    stamped_point,
    stamped_pose,
    stamped_twist,
)
from ual.types import AltitudeReference, GeoWaypoint, PathHeading, Plan, Waypoints
from ual_daemon.vehicle.commands import Commands


class DryRun:
    """What would happen; see `ual.interface.DryRun`."""

    def __init__(self, motions: Commands) -> None:
        self._commands = motions

    def take_off(self, height_m: float) -> Plan:
        return self._commands.take_off(height_m).plan

    def land(self) -> Plan:
        return self._commands.land().plan

    def go_to_waypoint(self, waypoint: PoseStamped | Pose, *, max_speed_m_s: float | None = None) -> Plan:
        return self._commands.go_to_waypoint(stamped_pose(waypoint), max_speed_m_s=max_speed_m_s).plan

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
    ) -> Plan:
        return self._commands.go_to_waypoint_geo(
            latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad=yaw_rad, max_speed_m_s=max_speed_m_s
        ).plan

    def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
    ) -> Plan:
        return self._commands.follow_path(
            stamped_waypoints(waypoints),
            corner_radius_m=corner_radius_m,
            max_speed_m_s=max_speed_m_s,
            leg_speeds_m_s=leg_speeds_m_s,
            heading=heading,
            point_of_interest=None if point_of_interest is None else stamped_point(point_of_interest),
        ).plan

    def set_pose(self, pose: PoseStamped | Pose) -> Plan:
        return self._commands.set_pose(stamped_pose(pose)).plan

    def set_velocity(self, velocity: TwistStamped | Twist) -> Plan:
        return self._commands.set_velocity(stamped_twist(velocity)).plan

    def recover_from_manual(self) -> Plan:
        return self._commands.recover_from_manual().plan


def stamped_waypoints(waypoints: Waypoints) -> list[PoseStamped | GeoWaypoint]:
    """The waypoints of a path; a bare pose is in ``<ns>/odom``."""
    return [each if isinstance(each, GeoWaypoint) else stamped_pose(each) for each in waypoints]
