"""Where things are: between the frames of the interface and the backend's local frame.

``<ns>/odom`` has the local frame's axes; its origin lies where `set_home` put it, at first at the local origin.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

from ual.errors import NotSupportedError, WrongStateError
from ual.geometry import Pose, PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3
from ual.types import AltitudeReference
from ual_daemon import logs, validation
from ual_daemon.backends.values import Snapshot
from ual_daemon.frames import MAP, FrameTree, horizontal
from ual_daemon.geodesy import EllipsoidProjection
from ual_daemon.settings import VehicleSettings
from ual_daemon.trajectory import Waypoint

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Goal:
    """A goal in a frame of the user's, checked; `turn` None keeps the heading."""

    position: Vector3
    turn: Quaternion | None
    frame_id: str
    field: str


class Places:
    """The frames of one UAV, and what is commanded and reported in them. Any thread may call."""

    def __init__(self, ns: str, settings: VehicleSettings) -> None:
        self.tree = FrameTree(ns, settings)
        self._map_origin = settings.map_origin_geo
        self._origin = Vector3()  # of <ns>/odom, in the local frame

    # --- Reported -----------------------------------------------------------------------------------------------------

    def to_odom(self, local: Pose) -> Pose:
        """A pose of the local frame in ``<ns>/odom``."""
        return Pose(local.position - self._origin, local.orientation)

    def body(self, snapshot: Snapshot) -> Pose | None:
        """The body in ``<ns>/odom``."""
        return None if snapshot.pose is None else self.to_odom(snapshot.pose.value)

    def transform(self, target: str, source: str, snapshot: Snapshot) -> Transform:
        """What takes coordinates in the source frame (empty: the body) to the target frame (empty: ``map``)."""
        return self.tree.lookup(target or MAP, source or self.tree.body, self.body(snapshot))

    # --- Commanded ----------------------------------------------------------------------------------------------------

    def goal(self, goal: PoseStamped, field: str) -> Goal:
        """Checks a goal, as far as that can be done without knowing where the UAV is."""
        if not isinstance(goal, PoseStamped):
            raise validation.refuse(field, f"{goal!r} is neither a PoseStamped nor a Pose")
        validation.require_type(goal.pose, Pose, f"{field}.pose")
        self._require_frame(goal.frame_id, field)
        return Goal(
            validation.position(goal.pose.position, f"{field}.pose.position"),
            validation.orientation(goal.pose.orientation, f"{field}.pose.orientation"),
            goal.frame_id or self.tree.odom,
            field,
        )

    def to_local(self, goal: Goal, snapshot: Snapshot) -> Waypoint:
        """A goal in the backend's local frame."""
        position, turn = goal.position, goal.turn
        if goal.frame_id != self.tree.odom:
            to_odom = self._to_odom(goal.frame_id, snapshot)
            field = f"{goal.field}.pose.position (in {self.tree.odom})"
            position = validation.position(to_odom.apply(position), field)
            turn = turn and to_odom.rotation * turn
        return Waypoint(position + self._origin, turn.yaw_rad if turn else None)

    def velocity(self, velocity: TwistStamped, field: str) -> tuple[Twist, str]:
        """Checks a velocity; with the frame that it is in."""
        if not isinstance(velocity, TwistStamped):
            raise validation.refuse(field, f"{velocity!r} is neither a TwistStamped nor a Twist")
        self._require_frame(velocity.frame_id, field)
        return validation.twist(velocity.twist, f"{field}.twist"), velocity.frame_id or self.tree.odom

    def velocity_to_local(self, twist: Twist, frame_id: str, snapshot: Snapshot) -> Twist:
        """A velocity along the axes of a frame, along the local axes."""
        if frame_id == self.tree.odom:
            return twist
        turn = self._to_odom(frame_id, snapshot).rotation
        return Twist(turn.rotate(twist.linear), turn.rotate(twist.angular))

    def geo_to_local(
        self, latitude_deg: float, longitude_deg: float, altitude_m: float, above: AltitudeReference, snapshot: Snapshot
    ) -> Vector3:
        """A geographic position in the backend's local frame, by the autopilot's own projection."""
        if snapshot.projection is None:
            raise WrongStateError("the autopilot has not said where its local frame is on Earth")
        return snapshot.projection.to_local(latitude_deg, longitude_deg, _amsl_m(altitude_m, above, snapshot))

    def _to_odom(self, frame_id: str, snapshot: Snapshot) -> Transform:
        body = self.body(snapshot)
        return self.tree.lookup(self.tree.odom, frame_id, body and horizontal(body))

    def _require_frame(self, frame_id: str, field: str) -> None:
        if frame_id:
            self.tree.require(validation.frame_id(frame_id, f"{field}.header.frame_id"))

    # --- Home ---------------------------------------------------------------------------------------------------------

    def set_home(self, position: Vector3, snapshot: Snapshot, *, set_z: bool) -> None:
        """Puts the origin of ``<ns>/odom`` at a position of the local frame (its height only with `set_z`)."""
        self._origin = position if set_z else Vector3(position.x, position.y, self._origin.z)
        self._place_in_map(snapshot)

    def update(self, snapshot: Snapshot) -> None:
        """Learns where ``<ns>/odom`` is in ``map``, where that follows from `map_origin_geo`."""
        if self._map_origin is not None and not self.tree.has_home():
            self._place_in_map(snapshot)

    def _place_in_map(self, snapshot: Snapshot) -> None:
        if self._map_origin is None or snapshot.projection is None:
            return
        home = snapshot.projection.to_geo(self._origin)
        assert home.altitude_amsl_m is not None
        in_map = EllipsoidProjection(*self._map_origin).to_local(
            home.latitude_deg, home.longitude_deg, home.altitude_amsl_m
        )
        self.tree.set_home(in_map)
        logs.event(_log, logging.INFO, "home_pose", frame=MAP, x=in_map.x, y=in_map.y, z=in_map.z)


def _amsl_m(altitude_m: float, above: AltitudeReference, snapshot: Snapshot) -> float:
    if above is AltitudeReference.AMSL:
        return altitude_m
    if above is AltitudeReference.ELLIPSOID:
        if snapshot.geoid_separation_m is None:
            raise NotSupportedError("the autopilot does not say how the ellipsoid lies to mean sea level here")
        return altitude_m - snapshot.geoid_separation_m
    if snapshot.home_altitude_amsl_m is None:
        raise WrongStateError("the autopilot has not said where its home is; give the altitude as AMSL")
    return snapshot.home_altitude_amsl_m + altitude_m
