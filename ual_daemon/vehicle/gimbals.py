"""The gimbals of a UAV in motion: where each looks, its frame, and what it follows."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from ual.errors import UalError, WrongStateError
from ual.geometry import PointStamped, Pose, Quaternion, Vector3, wrap_angle
from ual.gimbals import (
    AngleRange,
    GimbalAbility,
    GimbalActivity,
    GimbalAngles,
    GimbalControl,
    GimbalInfo,
    GimbalReference,
    GimbalStatus,
)
from ual_daemon import validation
from ual_daemon.backends.base import Backend
from ual_daemon.backends.offers.gimbals import GimbalAttitude, GimbalDriver, GimbalDrivers
from ual_daemon.backends.values import Snapshot
from ual_daemon.frames.resolver import FrameResolver, Goal

_log = logging.getLogger(__name__)

TRACKING_PERIOD_S = 0.05
"""Seconds between two aims of a gimbal that follows, ..."""
CHECK_PERIOD_S = 0.5
"""... and between two searches for new gimbals before there was an order."""
_STRAIGHT_RAD = 1e-3
"""Angle in rad from straight down or up within which roll and yaw are one turn: all of it counts as yaw."""
_FORWARD = Vector3(1.0, 0.0, 0.0)


class GimbalTarget(NamedTuple):
    """Target that a gimbal follows: as it was given, and as a goal."""

    point: PointStamped
    goal: Goal


@dataclass(slots=True)
class _GimbalOrder:
    """The order to a gimbal that counts: the newest one that it has accepted."""

    number: int = 0
    boot: int = 0
    """Boot of the autopilot in which the order began; 0 where that is not known."""
    activity: GimbalActivity | None = None
    followed: GimbalTarget | None = None
    problem: str = ""
    is_logged: bool = False
    """Whether the log has said once that it does not see what it follows."""


class Aim(NamedTuple):
    """Turn that points a gimbal at a target: angles within its limits, and the vector to the target in the local
    frame.
    """

    angles: GimbalAngles
    reference: GimbalReference
    way: Vector3
    limit: str = ""


class UavGimbals:
    """The gimbals of one UAV. `update` belongs to the update thread; any thread may call the other members."""

    def __init__(self, backend: Backend, resolver: FrameResolver) -> None:
        self._backend = backend
        self._resolver = resolver
        self._offer = backend.offer(GimbalDrivers)  # type: ignore[type-abstract]  # it is only looked for
        self._lock = threading.Lock()
        self._orders: dict[int, _GimbalOrder] = {}
        self._attached_count = 0
        self.due_s = -math.inf if self._offer else math.inf
        """Time at which `update` is to be called next; an attribute, because each update reads it."""
        self.is_busy = False
        """Whether `update` is needed."""
        self.attach()

    def frame_id(self, number: int) -> str:
        """Returns the name of the frame that turns with a gimbal."""
        return f"{self._backend.options.ns}/gimbal_{number}"

    def goal(self, number: int, point: PointStamped) -> Goal:
        """Validates a position for a gimbal to look at. Raises as `FrameResolver.point`."""
        goal = self._resolver.point(point, "point")
        if self._resolver.tree.is_below(goal.frame_id, self.frame_id(number)):
            raise validation.refuse("point.header.frame_id", f"{goal.frame_id} turns with the gimbal itself")
        return goal

    def aim_now(self, gimbal: GimbalDriver, goal: Goal) -> Aim:
        """Returns how a gimbal has to be turned to look at a goal; see `aim`, also for what is raised."""
        return self.aim(gimbal, goal, self._backend.snapshot())

    # --- Orders -------------------------------------------------------------------------------------------------------

    def begin(self, number: int) -> int:
        """Ends what a gimbal was ordered before. Returns the number of the order that begins, for `did`."""
        boot = self._backend.snapshot().link.boot
        with self._lock:
            begun = self._orders.get(number, _GimbalOrder()).number + 1
            self._put(number, _GimbalOrder(begun, boot))
        return begun

    def did(self, number: int, begun: int, activity: GimbalActivity, followed: GimbalTarget | None = None) -> None:
        """Notes that a gimbal has accepted an order, unless a newer one has begun."""
        with self._lock:
            order = self._orders[number]
            if order.number == begun:
                self._put(number, _GimbalOrder(begun, order.boot, activity, followed))

    def _put(self, number: int, order: _GimbalOrder) -> None:
        """Puts an order in the place of the one before. The caller holds the lock."""
        self._orders[number] = order
        self.is_busy = any(each.followed is not None for each in self._orders.values())
        self.due_s = -math.inf

    # --- What follows from it -----------------------------------------------------------------------------------------

    def update(self, snapshot: Snapshot) -> None:
        """Adds the frames of gimbals that are new, and aims those that follow."""
        self.due_s = snapshot.time_s + (TRACKING_PERIOD_S if self._orders else CHECK_PERIOD_S)
        self.attach()
        for number, order in list(self._orders.items()):
            self._step(number, self._all()[number], order, snapshot)

    def _step(self, number: int, gimbal: GimbalDriver, order: _GimbalOrder, snapshot: Snapshot) -> None:
        control, words = gimbal.control()
        if control is GimbalControl.OTHER and order.activity is not None:
            self._end(number, order, f"{words} has taken the control of it: what this daemon ordered has ended")
            return
        if order.activity is not None and order.boot not in (0, snapshot.link.boot):
            self._end(number, order, "the autopilot has booted: what this daemon ordered before has ended")
            return
        if order.followed is not None:
            self._follow(number, gimbal, order, order.followed.goal, snapshot)

    def _end(self, number: int, order: _GimbalOrder, problem: str) -> None:
        _log.warning("gimbal %d: %s", number, problem)
        with self._lock:
            if self._orders[number] is order:
                self._put(number, _GimbalOrder(order.number, problem=problem))

    def _follow(self, number: int, gimbal: GimbalDriver, order: _GimbalOrder, goal: Goal, snapshot: Snapshot) -> None:
        try:
            aim = self.aim(gimbal, goal, snapshot)
        except UalError as error:
            problem = f"it stays as it is: {error.message}"
        else:
            with self._lock:  # an order that begins now leaves after it, and one that has begun keeps it back
                if self._orders[number] is not order:
                    return
                gimbal.aim(aim.angles, aim.reference)
            problem = aim.limit
        if problem and not order.is_logged:
            order.is_logged = True
            _log.warning("gimbal %d does not see what it follows: %s", number, problem)
        order.problem = problem

    def aim(self, gimbal: GimbalDriver, goal: Goal, snapshot: Snapshot) -> Aim:
        """Returns how a gimbal has to be turned now to look at a goal.

        Raises:
            UnknownFrameError: There is no such frame.
            WrongStateError: It is not known where the UAV, or the frame, is.
            FrameLostError: It is not known any more.

        """
        body = self._require_body(snapshot)
        eye = body.position + body.orientation.rotate(gimbal.mount_position)
        return aimed(gimbal.info, body, self._position_of(goal, snapshot) - eye)

    def _position_of(self, goal: Goal, snapshot: Snapshot) -> Vector3:
        """Returns where a goal is in the local frame."""
        resolver = self._resolver
        resolver.tree.require(goal.frame_id)
        if resolver.is_moving(goal):
            return resolver.moving_to_local(goal, snapshot.time_s, 0.0).position
        return resolver.to_local(goal, snapshot).position

    # --- Where it looks -----------------------------------------------------------------------------------------------

    def heading_rad(self) -> float:
        """Returns the heading of the UAV in the local frame.

        Raises:
            WrongStateError: It is not known.

        """
        return self._require_body(self._backend.snapshot()).yaw_rad

    def status(self, gimbal: GimbalDriver) -> GimbalStatus:
        """Returns where a gimbal looks, and what it does."""
        number, snapshot, attitude = gimbal.info.number, self._backend.snapshot(), gimbal.attitude()
        body = self._body(snapshot)
        order = self._orders.get(number, _GimbalOrder())
        followed, (control, words) = order.followed, gimbal.control()
        in_local = None if attitude is None else attitude.in_local(body)
        problems = [*gimbal.problems(), *([order.problem] if order.problem else [])]
        return GimbalStatus(
            stamp_s=None if attitude is None else self._backend.utc_s() - (snapshot.time_s - attitude.time_s),
            angles=None if attitude is None else angles_from_nose(attitude, body),
            in_body=None if attitude is None else attitude.in_body(body),
            in_odom=None if self._resolver.odom_loss is not None else in_local,
            activity=order.activity,
            target=None if followed is None else followed.point,
            off_target_rad=None
            if followed is None or in_local is None
            else self._off_target_rad(gimbal, followed.goal, in_local, snapshot),
            control=control,
            controller=words,
            problems=tuple(problems),
        )

    def _off_target_rad(
        self, gimbal: GimbalDriver, goal: Goal, in_local: Quaternion, snapshot: Snapshot
    ) -> float | None:
        try:
            way = self.aim(gimbal, goal, snapshot).way
        except UalError:  # `update` has reported it
            return None
        return 0.0 if way.norm() == 0.0 else _angle_between(in_local.rotate(_FORWARD), way)

    def attach(self) -> None:
        """Adds the frames of gimbals that are new."""
        found = self._all()
        for number in range(self._attached_count, len(found)):
            turned = partial(self._turned, found[number])
            self._resolver.tree.attach(self.frame_id(number), found[number].mount_position, turned)
        self._attached_count = len(found)

    def _turned(self, gimbal: GimbalDriver) -> Quaternion | None:
        attitude = gimbal.attitude()
        return None if attitude is None else attitude.in_body(self._body(self._backend.snapshot()))

    def _all(self) -> Sequence[GimbalDriver]:
        return () if self._offer is None else self._offer.all()

    def _body(self, snapshot: Snapshot) -> Pose | None:
        """Returns the pose of the body in the local frame, while that is known."""
        pose = snapshot.motion.pose
        is_fresh = pose is not None and snapshot.time_s - pose.time_s <= self._backend.freshness.pose_s
        return pose.value if pose is not None and is_fresh else None

    def _require_body(self, snapshot: Snapshot) -> Pose:
        body = self._body(snapshot)
        if body is None:
            raise WrongStateError("it is not known where the UAV is, and how it is turned")
        return body


def aimed(info: GimbalInfo, body: Pose, way: Vector3) -> Aim:
    """Returns how a gimbal has to be turned to look along a way in the local frame, as near as its limits let it."""
    across = way.horizontal_norm()
    pitch_rad = math.atan2(-way.z, across) if way.norm() > 0.0 else 0.0
    # Straight below there is no direction: along the nose.
    yaw_rad = wrap_angle(math.atan2(way.y, way.x) - body.yaw_rad) if across > 0.0 else 0.0
    pitch, pitch_limit = _within(pitch_rad, info.pitch, "pitch", has_axis=GimbalAbility.PITCH in info.abilities)
    yaw, yaw_limit = _within(yaw_rad, info.yaw, "yaw", has_axis=GimbalAbility.YAW in info.abilities)
    limit = pitch_limit or yaw_limit
    if GimbalAbility.EARTH in info.abilities and GimbalAbility.YAW in info.abilities:
        angles = GimbalAngles(0.0, pitch, wrap_angle(yaw + body.yaw_rad))
        return Aim(angles, GimbalReference.EARTH, way, limit)
    return Aim(GimbalAngles(0.0, pitch, yaw), GimbalReference.HORIZON, way, limit)


def _within(wanted_rad: float, range_: AngleRange | None, axis: str, *, has_axis: bool) -> tuple[float, str]:
    """Returns the nearest angle that an axis can turn to, and what limits it, in words."""
    if not has_axis:
        return 0.0, "" if abs(wanted_rad) < _STRAIGHT_RAD else f"it has no {axis} axis"
    nearest_rad = wanted_rad if range_ is None else range_.nearest(wanted_rad)
    if abs(nearest_rad - wanted_rad) < _STRAIGHT_RAD:
        return nearest_rad, ""
    return nearest_rad, f"its {axis} ends at {nearest_rad:.3f} rad, and {wanted_rad:.3f} rad are needed"


def angles_from_nose(attitude: GimbalAttitude, body: Pose | None) -> GimbalAngles | None:
    """Returns roll and pitch from the horizon, and yaw from the nose."""
    if attitude.reference is GimbalReference.HORIZON:
        return angles_of(attitude.orientation)
    in_local = attitude.in_local(body)
    if body is None or in_local is None:
        return None
    return angles_of(Quaternion.from_yaw(-body.yaw_rad) * in_local)


def angles_of(orientation: Quaternion) -> GimbalAngles:
    """Returns the angles of an orientation. One that looks straight down, or up, has no roll."""
    roll_rad, pitch_rad, yaw_rad = orientation.to_euler()
    if abs(pitch_rad) < math.pi / 2.0 - _STRAIGHT_RAD:
        return GimbalAngles(roll_rad, pitch_rad, yaw_rad)
    left = orientation.rotate(Vector3(0.0, 1.0, 0.0))
    return GimbalAngles(0.0, pitch_rad, math.atan2(-left.x, left.y))


def _angle_between(first: Vector3, second: Vector3) -> float:
    return math.atan2(first.cross(second).norm(), first.dot(second))
