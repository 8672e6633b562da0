"""Telemetry: one sample of everything known, made from a snapshot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, Protocol

from ual.errors import WrongStateError
from ual.geometry import IDENTITY, Pose, Transform, Twist
from ual.types import Health, Odometry, TaskInfo, Telemetry
from ual_daemon.backends.values import Cause, Snapshot
from ual_daemon.flight.state import Estimate
from ual_daemon.frames.resolver import FrameResolver
from ual_daemon.frames.tree import MAP

AUTOPILOT = "autopilot: "
"""Prefix of the autopilot's severe texts among the failing checks."""


class Follows(Protocol):
    """Whether a UAV follows; see `ual_daemon.flight.policy.following.Following`."""

    why: str
    """Why it does not; empty while it does, or where that is not watched."""


_AFTER_MISSION = (Cause.AUTOPILOT, Cause.GROUND_STATION)
"""Apparent holders of the control as a mission of UAL ends."""


class Doing(Protocol):
    """Activity of a UAV, as far as a sample reports it. `Flight` has the activity of a UAV that UAL flies."""

    @property
    def limitation(self) -> str:
        """Addition to the reason of the state; empty if there is none."""

    @property
    def following(self) -> Follows:
        """Whether the UAV follows."""

    @property
    def holder(self) -> Cause | None:
        """Holder of the control, where the autopilot's data do not tell."""

    @property
    def is_on_mission(self) -> bool:
        """Whether the autopilot flies a mission as a task of UAL, or has just ended it."""

    def reference_pose(self) -> Pose | None:
        """Returns the pose that is commanded now, in the local frame; None if no pose is."""

    def task_info(self) -> TaskInfo | None:
        """Returns the running task; None if there is none."""


class _Reported(NamedTuple):
    """Pose, velocity and reference in the pose frame."""

    frame_id: str
    pose: Pose | None
    velocity: Twist | None
    reference_pose: Pose | None


def make_telemetry(
    snapshot: Snapshot,
    found: Estimate,
    resolver: FrameResolver,
    doing: Doing,
    pose_frame_id: str | None,
    sequence: int,
    *,
    is_late: bool = False,
    daemon_checks: tuple[str, ...] = (),
) -> Telemetry:
    """Returns a sample, with its poses in `pose_frame_id`.

    They are in ``<ns>/odom`` if that is None, or as long as it is not known where that frame is. With `is_late`, what
    few read is computed when it is first read, by the thread that reads it, from what is known now.
    `daemon_checks` are the checks of this daemon that fail, as health tells them.
    """
    tree = resolver.tree
    control, motion, condition = snapshot.control, snapshot.motion, snapshot.condition
    twist = None if motion.velocity is None else motion.velocity.value
    reference = doing.reference_pose()
    with resolver.still:  # a pose of the moment while home moves would be off by as much
        odom_loss = resolver.odom_loss
        body = None if motion.pose is None else resolver.to_odom(motion.pose.value)
        reported = _reported(resolver, reference, body, twist, pose_frame_id)
        in_map = tree.odom_in_map() if resolver.map_loss is None else None
    limitation, stamp_s = doing.limitation, motion.stamp_s
    known: dict[str, Any] = {
        "state": found.state,
        "state_reason": f"{found.why}; {limitation}" if limitation else found.why,
        "stamp_s": stamp_s,
        "frame_id": reported.frame_id,
        "pose": reported.pose,
        "velocity": reported.velocity,
        "reference_pose": reported.reference_pose,
        "battery": condition.battery,
        "batteries": condition.batteries,
        "gps": condition.gps,
        "flight_mode": "" if control.mode is None else control.mode.value.own_text or control.mode.value.name,
        "armed": control.armed is not None and control.armed.value,
        "task": doing.task_info(),
        "sequence": sequence,
        "status_text": condition.status_text,
        "frame_lost": "" if odom_loss is None else str(odom_loss),
        "missed_count": 0,
    }
    # Of immutable values only: what is read late must be as it was now.
    placed = body if odom_loss is None else None
    if is_late:
        late: dict[str, Callable[[], Any]] = {
            "odometry": partial(_odometry, placed, twist, tree.odom, tree.body, stamp_s),
            "transform": partial(_in_map, in_map, body, tree.body, stamp_s),
            "position_geo": snapshot.position_geo,
            "health": partial(_health, snapshot, doing.following.why, _holder(snapshot, doing), daemon_checks),
        }
        return Telemetry.late(lambda name: late[name](), **known)
    return Telemetry(
        **known,
        odometry=_odometry(placed, twist, tree.odom, tree.body, stamp_s),
        transform=_in_map(in_map, body, tree.body, stamp_s),
        position_geo=snapshot.position_geo(),
        health=_health(snapshot, doing.following.why, _holder(snapshot, doing), daemon_checks),
    )


def _holder(snapshot: Snapshot, doing: Doing) -> Cause | None:
    """Returns the holder of the control. PX4's hold after a mission of UAL is nobody's, or looks like a ground
    station's choice.
    """
    held_by = snapshot.control.held_by
    if doing.is_on_mission and held_by in _AFTER_MISSION:
        return None
    return held_by or doing.holder


def _health(snapshot: Snapshot, trouble: str, held_by: Cause | None, daemon_checks: tuple[str, ...]) -> Health | None:
    """Returns the autopilot's health, with the failsafe, the holder of the control, what arming would start, that the
    UAV does not follow, and what fails in the daemon.
    """
    control, health = snapshot.control, snapshot.condition.health
    failsafe = control.failsafe
    is_armed = control.armed is not None and control.armed.value
    starts = "" if is_armed else control.arming_starts  # no call for each sample of a flight
    severe = snapshot.condition.severe_texts
    if failsafe is None and held_by is None and not starts and not trouble and not daemon_checks and not severe:
        return health
    said = (f"{AUTOPILOT}{each.text}" for each in severe)
    health = health or Health()
    return replace(
        health,
        failing_checks=(
            *health.failing_checks,
            *said,
            *(each for each in (starts, trouble) if each),
            *daemon_checks,
        ),
        failsafe="" if failsafe is None else failsafe.value,
        held_by="" if held_by is None else held_by.value,
    )


def _reported(
    resolver: FrameResolver, reference: Pose | None, body: Pose | None, twist: Twist | None, pose_frame_id: str | None
) -> _Reported:
    """Converts the pose and velocity of the body, and the reference in the local frame, to the pose frame."""
    odom = resolver.tree.odom
    reference = None if reference is None else resolver.to_odom(reference)
    if resolver.odom_loss is not None and not _is_known(resolver, pose_frame_id):
        return _Reported(odom, None, twist, None)
    to_frame = _lookup(resolver, pose_frame_id, odom, body) if pose_frame_id not in (None, odom) else None
    if to_frame is None:
        return _Reported(odom, body, twist, reference)
    return _Reported(
        to_frame.frame_id,
        None if body is None else to_frame.apply_pose(body),
        None if twist is None else Twist(to_frame.rotation.rotate(twist.linear), twist.angular),
        None if reference is None else to_frame.apply_pose(reference),
    )


def _is_known(resolver: FrameResolver, pose_frame_id: str | None) -> bool:
    """Returns whether a pose frame is known to be where it was, while ``<ns>/odom`` is not: one on Earth."""
    return pose_frame_id is not None and resolver.map_loss is None and not resolver.tree.is_below_odom(pose_frame_id)


def _in_map(home: Transform | None, body: Pose | None, body_frame_id: str, stamp_s: float) -> Transform | None:
    if home is None or body is None:
        return None
    position, orientation = body.position + home.translation, body.orientation
    if home.rotation is not IDENTITY:  # rarely
        position, orientation = home.apply(body.position), home.rotation * body.orientation
    return Transform(position, orientation, MAP, body_frame_id, stamp_s)


def _lookup(resolver: FrameResolver, target: str | None, source: str, body: Pose | None) -> Transform | None:
    if target is None:
        return None
    try:
        return resolver.tree.lookup(target, source, body)
    except WrongStateError:  # it is not known yet where the frame is
        return None


def _odometry(
    body: Pose | None, twist: Twist | None, frame_id: str, body_frame_id: str, stamp_s: float
) -> Odometry | None:
    if body is None or twist is None:
        return None
    in_body = Twist(body.orientation.inverse().rotate(twist.linear), twist.angular)
    return Odometry(body, in_body, frame_id, body_frame_id, stamp_s)
