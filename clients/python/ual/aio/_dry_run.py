"""The motions of the asyncio client, as questions."""

from __future__ import annotations

from collections.abc import Sequence

from ual import _calls
from ual.aio._connection import Connection
from ual.geometry import PointStamped, Pose, PoseStamped, Twist, TwistStamped, Vector3
from ual.types import AltitudeReference, PathHeading, Plan, Waypoints


class DryRun:
    """What would happen; the members of `ual.interface.DryRun` as coroutines."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    async def take_off(self, height_m: float) -> Plan:
        return await self._connection.run(_calls.dry_run(_calls.take_off(height_m)))

    async def land(self) -> Plan:
        return await self._connection.run(_calls.dry_run(_calls.land()))

    async def go_to_waypoint(self, waypoint: PoseStamped | Pose, *, max_speed_m_s: float | None = None) -> Plan:
        return await self._connection.run(_calls.dry_run(_calls.go_to_waypoint(waypoint, max_speed_m_s)))

    async def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
    ) -> Plan:
        call = _calls.go_to_waypoint_geo(
            latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad, max_speed_m_s
        )
        return await self._connection.run(_calls.dry_run(call))

    async def follow_path(
        self,
        waypoints: Waypoints,
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | Vector3 | None = None,
    ) -> Plan:
        call = _calls.follow_path(waypoints, corner_radius_m, max_speed_m_s, leg_speeds_m_s, heading, point_of_interest)
        return await self._connection.run(_calls.dry_run(call))

    async def set_pose(self, pose: PoseStamped | Pose) -> Plan:
        return await self._connection.run(_calls.dry_run(_calls.single_setpoint(_calls.pose_setpoint(pose))))

    async def set_velocity(self, velocity: TwistStamped | Twist) -> Plan:
        return await self._connection.run(_calls.dry_run(_calls.single_setpoint(_calls.velocity_setpoint(velocity))))

    async def recover_from_manual(self) -> Plan:
        return await self._connection.run(_calls.dry_run(_calls.recover_from_manual()))
