"""The frame resolver: converts between the frames of the interface and the backend's local frame.

The origin of ``<ns>/odom`` is where `set_home` put it, and at first the local origin. It stays there on Earth when the
autopilot's local frame moves, or is lost; see `LocalFrame`. For its metres, see `OdomMetres`.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ual.errors import NotSupportedError, WrongStateError
from ual.geometry import (
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    Twist,
    TwistStamped,
    Vector3,
    wrap_angle,
)
from ual.types import AltitudeReference, GeoWaypoint
from ual_daemon import logs, validation
from ual_daemon.backends.values import Snapshot
from ual_daemon.frames.anchor import Loss
from ual_daemon.frames.home_file import HomeFile
from ual_daemon.frames.local_frame import LocalFrame
from ual_daemon.frames.odom_metres import EarthMetres, FrameInLocal, OdomMetres
from ual_daemon.frames.tree import MAP, FrameTree, horizontal
from ual_daemon.settings import VehicleSettings
from ual_daemon.trajectory import Motion, PathWaypoint

_DIFFERENCE_S = 0.01
_UPSIDE_DOWN, _LEVEL = math.sin(math.radians(90.0) / 2.0) ** 2, math.sin(math.radians(20.0) / 2.0) ** 2
"""Of a rotation, x² + y² is the square of the sine of half its tilt. The pose of another UAV, which one may follow, is
tilted, but not upside down."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Goal:
    """A validated goal in any frame. A `rotation` of None keeps the heading. `field` names the position in errors."""

    position: Vector3
    rotation: Quaternion | None
    frame_id: str
    field: str


class FrameResolver:
    """The frames of one UAV, and the conversion of what is commanded and reported in them. Any thread may call."""

    def __init__(
        self,
        ns: str,
        settings: VehicleSettings,
        home_file: HomeFile | None = None,
        identity: Callable[[], str] = str,
    ) -> None:
        """`home_file` and `identity` are as for `LocalFrame`."""
        self.tree = FrameTree(ns, settings)
        self._map_origin, self._reach_m = settings.map_origin_geo, settings.reach_m
        self.local_frame = LocalFrame(home_file, identity, self._update_odom_in_map)
        self.still = self.local_frame.lock
        """Held while home moves, and ``map`` with it. For readers of several values; conversions hold it themselves."""
        self.update = self.local_frame.update
        """Follows the local frame. Called by the update thread at each update."""
        self._metres = OdomMetres(self.local_frame.home.local)
        self._external_metres: OdomMetres | None = None

    def open(self) -> None:
        """Reads the file with home, if there is one. To be called once, before the first update."""
        self.local_frame.open()

    # --- What is lost -------------------------------------------------------------------------------------------------

    @property
    def odom_loss(self) -> Loss | None:
        """Why it is not known where ``<ns>/odom`` is; None while it is known."""
        return self.local_frame.home.loss

    @property
    def map_loss(self) -> Loss | None:
        """Why it is not known where ``map`` is; None while it is known."""
        return self.local_frame.home.loss if self._map_origin is None else self.local_frame.map_loss

    def _require_known(self, frame_id: str) -> None:
        """Raises `FrameLostError` if it is not known where a frame is in the local frame."""
        if self.odom_loss is None and self.map_loss is None:
            return
        self.tree.require(frame_id)
        loss = self._loss_to_body(frame_id)
        if loss is not None:
            raise loss.error(frame_id)

    def _loss_to_body(self, frame_id: str) -> Loss | None:
        if self.tree.is_below_body(frame_id):
            return None
        return self.odom_loss if self.tree.is_below_odom(frame_id) else self.map_loss

    def _require_related(self, target: str, source: str) -> None:
        """Raises `FrameLostError` if it is not known how two frames lie to each other."""
        if self.odom_loss is None and self.map_loss is None:
            return
        for frame_id in (target, source):
            self.tree.require(frame_id)
        in_body, in_odom = (
            [is_below(frame_id) for frame_id in (target, source)]
            for is_below in (self.tree.is_below_body, self.tree.is_below_odom)
        )
        if in_body[0] is not in_body[1]:
            self._require_known(source if in_body[0] else target)
        elif in_odom[0] is not in_odom[1] and self._map_origin is not None:
            for frame_id in (target, source):
                self._require_known(frame_id)

    # --- Reported -----------------------------------------------------------------------------------------------------

    def to_odom(self, local: Pose) -> Pose:
        """Converts a pose from the local frame to ``<ns>/odom``. While that is lost, its origin is the local origin."""
        position = self._odom_metres.to_odom(local.position)
        # The same while the origins are one and nobody has set home: each sample passes here twice.
        return local if position is local.position else Pose(position, local.orientation)

    @property
    def _odom_metres(self) -> OdomMetres:
        home, metres = self.local_frame.home.local, self._metres
        return metres if metres.home is home else OdomMetres(home)

    def body(self, snapshot: Snapshot) -> Pose | None:
        """Returns the pose of the body in ``<ns>/odom``; None if it is not known."""
        return None if self.odom_loss is not None else self._body(snapshot)

    def _body(self, snapshot: Snapshot) -> Pose | None:
        return None if snapshot.motion.pose is None else self.to_odom(snapshot.motion.pose.value)

    def transform(self, target: str, source: str, snapshot: Snapshot) -> Transform:
        """Returns the transform from the source frame (empty: the body) to the target frame (empty: ``map``).

        Raises as `FrameTree.lookup`, and `FrameLostError`.
        """
        target, source = target or MAP, source or self.tree.body
        with self.still:
            self._require_related(target, source)
            return self.tree.lookup(target, source, self._body(snapshot))

    def describe(self, local: Vector3) -> str:
        """Returns a position in the local frame as text, in ``<ns>/odom`` while that is known."""
        p = self._odom_metres.to_odom(local)
        frame_id = self.tree.odom if self.odom_loss is None else "the autopilot's local frame"
        return f"{p.x:.1f}, {p.y:.1f}, {p.z:.1f} in {frame_id}"

    def frames_version(self) -> tuple[object, ...]:
        """Returns what the places of fixed frames in the local frame depend on: they differ only where this does."""
        frame = self.local_frame
        return (self.tree.links, frame.home, frame.start, frame.map_loss)

    @property
    def odom_z_m(self) -> float:
        """The z of the origin of ``<ns>/odom`` in the local frame; that of the local origin while it is lost."""
        return self.local_frame.home.local.z

    # --- Commanded ----------------------------------------------------------------------------------------------------

    def goal(self, goal: PoseStamped, field: str) -> Goal:
        """Validates a goal, as far as that is possible without the position of the UAV.

        Raises:
            InvalidArgumentError: A value is out of range; `field` and the field in it are named.
            UnknownFrameError: There is no such frame.

        """
        if not isinstance(goal, PoseStamped):
            raise validation.refuse(field, f"{goal!r} is neither a PoseStamped nor a Pose")
        validation.require_type(goal.pose, Pose, f"{field}.pose")
        self._require_frame(goal.frame_id, field)
        frame_id = goal.frame_id or self.tree.odom
        position = validation.position(goal.pose.position, f"{field}.pose.position")
        rotation = validation.orientation(goal.pose.orientation, f"{field}.pose.orientation")
        if rotation is not None and rotation.x * rotation.x + rotation.y * rotation.y > _UPSIDE_DOWN:
            self._require_order(rotation, frame_id, f"{field}.pose.orientation")
        return Goal(position, rotation, frame_id, f"{field}.pose.position")

    def _require_order(self, rotation: Quaternion, frame_id: str, field: str) -> None:
        """Refuses an orientation upside down that is level in the order w, x, y, z, in a frame whose z is up."""
        x, y, z, w = rotation
        if y * y + z * z <= _LEVEL and self._is_upright(frame_id):
            tilt_deg = math.degrees(2.0 * math.asin(min(1.0, math.hypot(x, y))))
            given = f"({x:g}, {y:g}, {z:g}, {w:g})"
            text = f"{given} is tilted by {tilt_deg:.0f} degrees, and level as w, x, y, z: the order is x, y, z, w"
            raise validation.refuse(field, text)

    def _is_upright(self, frame_id: str) -> bool:
        """Returns whether a frame is known to be level; the UAV's is, for commands."""
        tree = self.tree
        top = tree.body if tree.is_below_body(frame_id) else tree.odom if tree.is_below_odom(frame_id) else MAP
        try:
            x, y, _, _ = tree.lookup(top, frame_id, None).rotation
        except WrongStateError:
            return False
        return x * x + y * y <= _LEVEL

    def point(self, point: PointStamped, field: str) -> Goal:
        """Validates a point as a goal without a heading. Raises as `goal`."""
        if not isinstance(point, PointStamped):
            raise validation.refuse(field, f"{point!r} is neither a PointStamped nor a Vector3")
        self._require_frame(point.frame_id, field)
        position = validation.position(point.point, f"{field}.point")
        return Goal(position, None, point.frame_id or self.tree.odom, f"{field}.point")

    def to_local(self, goal: Goal, snapshot: Snapshot) -> PathWaypoint:
        """Converts a goal to the backend's local frame. Raises as `all_to_local`."""
        (waypoint,) = self.all_to_local([goal], snapshot)
        return waypoint

    def is_moving(self, goal: Goal) -> bool:
        """Returns whether a goal moves, because a client moves its frame."""
        return self.tree.is_moving(goal.frame_id)

    def moving_to_local(self, goal: Goal, now_s: float, kept_yaw_rad: float) -> Motion:
        """Converts a goal in a moving frame to its motion in the local frame, at a time of the backend's clock.

        A goal without a heading gets `kept_yaw_rad`.

        Raises:
            WrongStateError: It is not known where its frame is, or it moves with the UAV itself.
            FrameLostError: It is not known any more.
            InvalidArgumentError: It is too far away.

        """
        with self.still:  # both of the same frames: an update between them would be a motion that is none
            self._require_known(goal.frame_id)
            if self.tree.is_below_body(goal.frame_id):
                raise WrongStateError(
                    f"the frame {goal.frame_id} hangs below {self.tree.body}: it moves with the UAV itself"
                )
            links, metres = self.tree.links, self._odom_metres
            here, soon = (
                self._waypoint(goal, self.tree.lookup(self.tree.odom, goal.frame_id, None, time_s, links), metres)
                for time_s in (now_s, now_s + _DIFFERENCE_S)
            )
        velocity = (soon.position - here.position) / _DIFFERENCE_S
        if here.yaw_rad is None or soon.yaw_rad is None:
            return Motion(here.position, kept_yaw_rad, velocity)
        yaw_rate_rad_s = wrap_angle(soon.yaw_rad - here.yaw_rad) / _DIFFERENCE_S
        return Motion(here.position, here.yaw_rad, velocity, yaw_rate_rad_s=yaw_rate_rad_s)

    def all_to_local(self, goals: Sequence[Goal | GeoWaypoint], snapshot: Snapshot) -> list[PathWaypoint]:
        """Converts goals to the backend's local frame, all at the same time: each frame is looked up once.

        Raises:
            WrongStateError: It is not known where a frame, or the local frame on Earth, is.
            FrameLostError: It is not known any more where a frame is.
            InvalidArgumentError: A goal is too far away.
            NotSupportedError: The autopilot does not say what a geographic goal needs.

        """
        frame_ids = {goal.frame_id for goal in goals if isinstance(goal, Goal)}
        with self.still:
            for frame_id in frame_ids:
                self._require_known(frame_id)
            frame_ids -= {self.tree.odom}
            to_odom = {frame_id: self._to_odom(frame_id, snapshot) for frame_id in frame_ids}
            metres = self._odom_metres
        return [
            self._waypoint(goal, to_odom.get(goal.frame_id), metres)
            if isinstance(goal, Goal)
            else self.geo_to_local(goal, snapshot)
            for goal in goals
        ]

    def _waypoint(self, goal: Goal, to_odom: Transform | None, metres: OdomMetres) -> PathWaypoint:
        position, rotation = goal.position, goal.rotation
        if to_odom is not None:
            position = validation.position(to_odom.apply(position), f"{goal.field} (in {self.tree.odom})")
            rotation = rotation and to_odom.rotation * rotation
        return PathWaypoint(metres.to_local(position), rotation.yaw_rad if rotation else None)

    def in_local(self, frame_id: str) -> FrameInLocal:
        """Returns where a fixed frame is in the backend's local frame.

        Raises:
            WrongStateError: It is not known where the frame is.
            FrameLostError: It is not known any more.

        """
        with self.still:
            self._require_known(frame_id)
            return FrameInLocal(self.tree.lookup(self.tree.odom, frame_id, None), self._odom_metres)

    def from_start(self, at_start: FrameInLocal) -> FrameInLocal:
        """Returns where a frame is that was in the local frame of the start, and stays: in the present local frame.

        Raises:
            FrameLostError: It is not known any more where the local frame was at the start.

        """
        start = self.local_frame.start
        if start.loss is not None:
            raise start.loss.error(at_start.to_odom.child_frame_id)
        return FrameInLocal(at_start.to_odom, OdomMetres(at_start.metres.home + start.local))

    def external_pose(self, pose: PoseStamped, now_s: float) -> Pose:
        """Validates a pose from outside, and converts it to the backend's local frame, also before that has a place.

        A measurement from outside does not move with home. So ``map`` without an origin on Earth, and what lies
        below it, is then as it was before any `set_home`. ``<ns>/odom`` that nothing ties to Earth is as it was at the
        first pose from outside in it. Such a frame is never lost for these poses, since they lay the local frame.

        Raises:
            InvalidArgumentError: A value is out of range, the orientation is no rotation, or the frame is the body's.
            UnknownFrameError: There is no such frame.
            WrongStateError: It is not known where the frame is.
            FrameLostError: It is not known any more.

        """
        validation.require_type(pose, PoseStamped, "pose")
        validation.require_type(pose.pose, Pose, "pose.pose")
        self._require_frame(pose.frame_id, "pose")
        frame_id = pose.frame_id or self.tree.odom
        if self.tree.is_below_body(frame_id):
            raise validation.refuse("pose.header.frame_id", f"{frame_id} moves with the UAV, so it says nothing of it")
        position = validation.position(pose.pose.position, "pose.pose.position")
        rotation = validation.rotation(pose.pose.orientation, "pose.pose.orientation")
        with self.still:
            metres = self._metres_outside(frame_id)
            to_odom = self.tree.lookup(self.tree.odom, frame_id, None, now_s)
        there = validation.position(to_odom.apply(position), f"pose.pose.position (in {self.tree.odom})")
        return Pose(metres.to_local(there), to_odom.rotation * rotation)

    def _metres_outside(self, frame_id: str) -> OdomMetres:
        """Returns where ``<ns>/odom`` is, for a pose from outside in a frame; see `external_pose`."""
        is_below_odom = self.tree.is_below_odom(frame_id)
        if is_below_odom and self.local_frame.home.geo is None:
            if self._external_metres is None:
                self._external_metres = self._odom_metres
            return self._external_metres
        if is_below_odom or self._map_origin is not None:
            self._require_known(frame_id)
            return self._odom_metres
        start = self.local_frame.start
        return OdomMetres(Vector3() if start.geo is None else start.local)

    def is_moved_by_set_home(self, frame_id: str) -> bool:
        """Returns whether `set_home` moves a fixed frame in the local frame.

        It moves all frames; but where ``map`` has an origin on Earth, only those below ``<ns>/odom``.
        """
        return self._map_origin is None or self.tree.is_below_odom(frame_id)

    def velocity(self, velocity: TwistStamped, field: str) -> tuple[Twist, str]:
        """Validates a velocity, and returns it with the name of its frame. Raises as `goal`."""
        if not isinstance(velocity, TwistStamped):
            raise validation.refuse(field, f"{velocity!r} is neither a TwistStamped nor a Twist")
        self._require_frame(velocity.frame_id, field)
        return validation.twist(velocity.twist, f"{field}.twist"), velocity.frame_id or self.tree.odom

    def require_odom(self) -> None:
        """Raises `FrameLostError` or `WrongStateError` where it is not known where ``<ns>/odom`` is."""
        loss = self.local_frame.home.loss
        if loss is not None:
            raise loss.error(self.tree.odom)

    def velocity_to_local(self, twist: Twist, frame_id: str, snapshot: Snapshot) -> Twist:
        """Converts a velocity from the axes of a frame to the local axes.

        Raises:
            WrongStateError: It is not known where the frame is.
            FrameLostError: It is not known any more.

        """
        if frame_id == self.tree.odom:
            self.require_odom()
            return twist
        self._require_known(frame_id)
        rotation = self._to_odom(frame_id, snapshot).rotation
        return Twist(rotation.rotate(twist.linear), rotation.rotate(twist.angular))

    def geo_to_local(self, goal: GeoWaypoint, snapshot: Snapshot) -> PathWaypoint:
        """Converts a geographic goal to the backend's local frame, by the autopilot's own projection.

        Raises:
            WrongStateError: It is not known where the local frame, or home, is on Earth.
            NotSupportedError: The autopilot does not say how the ellipsoid lies to mean sea level.
            InvalidArgumentError: The goal is too far away.

        """
        if snapshot.earth.projection is None:
            raise WrongStateError("the autopilot has not said where its local frame is on Earth")
        altitude_m = _amsl_m(goal.altitude_m, goal.altitude_reference, snapshot)
        position = snapshot.earth.projection.to_local(goal.latitude_deg, goal.longitude_deg, altitude_m)
        field = "latitude_deg, longitude_deg, altitude_m (in the local frame)"
        return PathWaypoint(validation.position(position, field), goal.yaw_rad)

    def _to_odom(self, frame_id: str, snapshot: Snapshot) -> Transform:
        body = self._body(snapshot)
        return self.tree.lookup(self.tree.odom, frame_id, body and horizontal(body), snapshot.time_s)

    def _require_frame(self, frame_id: str, field: str) -> None:
        if frame_id:
            self.tree.require(validation.frame_id(frame_id, f"{field}.header.frame_id"))

    # --- Home ---------------------------------------------------------------------------------------------------------

    def set_home(self, position: Vector3, snapshot: Snapshot, *, set_z: bool) -> None:
        """Moves the origin of ``<ns>/odom`` to a position in the local frame.

        Its height is set only with `set_z`, or if it was lost.
        """
        self.local_frame.set_home(position, snapshot, set_z=set_z)

    def estimate_jumped(self, jump: Vector3) -> None:
        """Notes that the autopilot's estimate has jumped. Called by the update thread."""
        self.local_frame.estimate_jumped(jump)

    def _update_odom_in_map(self) -> None:
        """Computes where ``<ns>/odom`` is in ``map``, if that follows from `map_origin_geo`. With the lock held."""
        projection = self.local_frame.projection
        if self._map_origin is None:
            return
        if projection is None:
            if self.tree.has_home():
                self.tree.forget_home()
            self._metres = OdomMetres(self.local_frame.home.local)
            return
        home, metres = self.local_frame.home.local, self._metres
        if not isinstance(metres, EarthMetres) or metres.projection != projection or metres.home is not home:
            metres = EarthMetres(projection, home)
        in_map, turn = metres.in_map(self._map_origin)
        self._metres = metres
        self.tree.set_home(in_map, turn)
        if self.odom_loss is None:
            self._log_home(in_map)

    def _log_home(self, in_map: Vector3) -> None:
        far = {"why": "map_origin_geo is far from it: are latitude and longitude swapped, or is a sign missing?"}
        is_far = self._reach_m is not None and in_map.horizontal_norm() > self._reach_m
        level, more = (logging.WARNING, far) if is_far else (logging.INFO, {})
        logs.event(_log, level, "home_pose", frame=MAP, x=in_map.x, y=in_map.y, z=in_map.z, **more)


def _amsl_m(altitude_m: float, above: AltitudeReference, snapshot: Snapshot) -> float:
    if above is AltitudeReference.AMSL:
        return altitude_m
    if above is AltitudeReference.ELLIPSOID:
        if snapshot.earth.geoid_separation_m is None:
            raise NotSupportedError("the autopilot does not say how the ellipsoid lies to mean sea level here")
        return altitude_m - snapshot.earth.geoid_separation_m
    if snapshot.earth.home_altitude_amsl_m is None:
        raise WrongStateError("the autopilot has not said where its home is; give the altitude as AMSL")
    return snapshot.earth.home_altitude_amsl_m + altitude_m
