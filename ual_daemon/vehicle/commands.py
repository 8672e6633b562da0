"""Every command that moves the UAV: checked, planned, and then begun, or not (a dry run).

Each member of `Commands` takes all the checks of its command and gives a `Prepared`: what the motion would be, and what
begins it. Nothing has happened until then.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from ual.errors import UalError, WrongStateError
from ual.geometry import PointStamped, PoseStamped, TwistStamped, Vector3
from ual.types import AltitudeReference, Capability, GeoWaypoint, Limits, PathHeading, Plan, State, TaskKind
from ual_daemon import validation
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Snapshot, Takes
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.catch_up import CatchUp
from ual_daemon.flight.flight import Flight, Turn
from ual_daemon.flight.follow import FollowTrajectory
from ual_daemon.flight.geofence import Geofence
from ual_daemon.flight.land import Land
from ual_daemon.flight.recover import Recover
from ual_daemon.flight.take_off import TakeOff
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.frames.resolver import FrameResolver, Goal
from ual_daemon.settings import Tracker, VehicleSettings
from ual_daemon.tracker import limits
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.tracker.pure_pursuit import Pursuit
from ual_daemon.tracker.references import VELOCITY_TIMEOUT_S, Follow, Hold, Reference, Velocity, measured_motion
from ual_daemon.trajectory import Line, Motion, Trajectory, path
from ual_daemon.vehicle.preconditions import Preconditions, accepted

T = TypeVar("T")

_MAX_WAYPOINTS = 100_000
_FLOWN_ON_M, _FLOWN_ON_S = 1.0, 0.5
"""How far a UAV may have flown on while its next trajectory was planned: so far, and at its speed for so long."""


@dataclass(frozen=True, slots=True)
class Prepared(Generic[T]):
    """A motion that may begin: what it would be, and what begins it (to be called at once, and once)."""

    plan: Plan
    begin: Callable[[], T]


class Commands:
    """The commands that move one UAV. Every member may be called from any thread and returns at once; refusals raise
    errors of `ual.errors`. See `ual.interface.Uav` for their meaning.
    """

    def __init__(
        self,
        backend: Backend,
        flight: Flight,
        resolver: FrameResolver,
        preconditions: Preconditions,
        settings: VehicleSettings,
        current_limits: Callable[[], Limits],
        new_task: Callable[[TaskKind, str], VehicleTask],
        geofence: Geofence | None,
    ) -> None:
        self._backend = backend
        self._flight = flight
        self._resolver = resolver
        self._preconditions = preconditions
        self._settings = settings
        self._tolerance = settings.tolerance
        self._limits = current_limits
        self._new_task = new_task
        self._geofence = geofence

    @property
    def turn(self) -> Turn:
        """The command that was the last to begin."""
        return self._flight.turn

    def take_off(self, height_m: float) -> Prepared[VehicleTask]:
        """Climbs to a height above where it stands."""
        with self._preconditions.refusing("take_off"):
            self._preconditions.require_capability(Capability.TAKE_OFF, "take_off")
            height_m = validation.positive(height_m, "height_m", at_most=validation.MAX_DISTANCE_M)
            self._flight.require_replaceable("take_off")
            snapshot = self._preconditions.require_state("take_off", State.LANDED_ARMED)
            ground, bounds = measured_motion(snapshot), self._limits()
            top = ground.position + Vector3(0.0, 0.0, height_m)
            on_setpoints = self._backend.info().flies_takeoff_on_setpoints
            line = Line(Hold(ground.position, ground.yaw_rad).motion(snapshot), top, ground.yaw_rad, bounds)
            plan = self._admit("take_off", line, snapshot)
            if not on_setpoints:  # the autopilot climbs as it likes
                plan = Plan(plan.length_m)

        def begin() -> VehicleTask:
            with self._preconditions.refusing("take_off"):
                task = self._new_task(TaskKind.TAKE_OFF, f"take off to {height_m:g} m")
                command = AutopilotCommand("take off", snapshot.time_s)
                climb = TakeOff(task, command, snapshot, height_m, bounds, self._tolerance, on_setpoints=on_setpoints)
                self._flight.begin(climb)
                command.send(lambda: self._backend.take_off(height_m))
                accepted("take_off", task_id=task.id, height_m=height_m)
                return task

        return Prepared(plan, begin)

    def land(self) -> Prepared[VehicleTask]:
        """Lands where it is."""
        with self._preconditions.refusing("land"):
            self._preconditions.require_capability(Capability.LAND, "land")
            self._flight.require_replaceable("land")
            snapshot = self._preconditions.require_state("land", State.FLYING_AUTO)

        def begin() -> VehicleTask:
            with self._preconditions.refusing("land"):
                task = self._new_task(TaskKind.LAND, "land")
                command = AutopilotCommand("land", snapshot.time_s)
                self._flight.begin(Land(task, command, self._flight.brake(snapshot), snapshot))
                command.send(self._backend.land)
                accepted("land", task_id=task.id)
                return task

        return Prepared(Plan(), begin)

    def go_to_waypoint(self, waypoint: PoseStamped, *, max_speed_m_s: float | None = None) -> Prepared[VehicleTask]:
        """Flies straight to a pose in any frame."""
        with self._preconditions.refusing("go_to_waypoint"):
            self._preconditions.require_capability(Capability.POSITION, "go_to_waypoint")
            turn = self._flight.turn
            goal = self._resolver.goal(waypoint, "waypoint")
            max_speed_m_s = validation.max_speed(max_speed_m_s)
            bounds = limits.at_most(self._limits(), max_speed_m_s)
            snapshot = self._preconditions.require_state("go_to_waypoint", State.FLYING_AUTO)
            what = f"go to {_text(goal)}"
            if self._resolver.is_moving(goal):
                chase = self._chase(goal, bounds, snapshot, max_speed_m_s)
                return self._catch_up(TaskKind.GO_TO_WAYPOINT, what, chase, bounds, snapshot)
            local = replace(self._resolver.to_local(goal, snapshot), max_speed_m_s=max_speed_m_s)
            trajectory = path(self._flight.start(snapshot), [local], 0.0, bounds)
            return self._follow(TaskKind.GO_TO_WAYPOINT, what, trajectory, snapshot, turn)

    def go_to_waypoint_geo(
        self,
        latitude_deg: float,
        longitude_deg: float,
        altitude_m: float,
        altitude_reference: AltitudeReference = AltitudeReference.HOME,
        *,
        yaw_rad: float | None = None,
        max_speed_m_s: float | None = None,
    ) -> Prepared[VehicleTask]:
        """Flies straight to a geographic position."""
        with self._preconditions.refusing("go_to_waypoint_geo"):
            self._preconditions.require_capability(Capability.GEO, "go_to_waypoint_geo")
            turn = self._flight.turn
            goal = validation.geo_waypoint(
                GeoWaypoint(latitude_deg, longitude_deg, altitude_m, altitude_reference, yaw_rad)
            )
            max_speed_m_s = validation.max_speed(max_speed_m_s)
            bounds = limits.at_most(self._limits(), max_speed_m_s)
            snapshot = self._preconditions.require_state("go_to_waypoint_geo", State.FLYING_AUTO)
            local = replace(self._resolver.geo_to_local(goal, snapshot), max_speed_m_s=max_speed_m_s)
            trajectory = path(self._flight.start(snapshot), [local], 0.0, bounds)
            return self._follow(TaskKind.GO_TO_WAYPOINT_GEO, f"go to {_text(goal)}", trajectory, snapshot, turn)

    def follow_path(
        self,
        waypoints: Sequence[PoseStamped | GeoWaypoint],
        *,
        corner_radius_m: float = 0.0,
        max_speed_m_s: float | None = None,
        leg_speeds_m_s: Sequence[float] = (),
        heading: PathHeading = PathHeading.WAYPOINTS,
        point_of_interest: PointStamped | None = None,
        turn: Turn | None = None,
    ) -> Prepared[VehicleTask]:
        """Flies through waypoints, unless another command has begun since a turn (default: since this call)."""
        with self._preconditions.refusing("follow_path"):
            self._preconditions.require_capability(Capability.POSITION, "follow_path")
            turn = turn or self._flight.turn  # first: reading many waypoints takes long, too
            if not waypoints:
                raise validation.refuse("waypoints", "there are none; a path needs at least one")
            if len(waypoints) > _MAX_WAYPOINTS:
                raise validation.refuse("waypoints", f"{len(waypoints)} are more than {_MAX_WAYPOINTS}")
            radius_m = validation.not_negative(corner_radius_m, "corner_radius_m", at_most=validation.MAX_DISTANCE_M)
            max_speed_m_s = validation.max_speed(max_speed_m_s)
            bounds = limits.at_most(self._limits(), max_speed_m_s)
            speeds_m_s = validation.leg_speeds(leg_speeds_m_s, len(waypoints))
            heading = validation.path_heading(heading, has_point=point_of_interest is not None)
            goals = self._goals(waypoints)
            interest = (
                None if point_of_interest is None else self._resolver.point(point_of_interest, "point_of_interest")
            )
            snapshot = self._preconditions.require_state("follow_path", State.FLYING_AUTO)
            local = [
                replace(waypoint, max_speed_m_s=limits.slower(speed_m_s, max_speed_m_s))
                for waypoint, speed_m_s in zip(self._resolver.all_to_local(goals, snapshot), speeds_m_s, strict=True)
            ]
            target = None if interest is None else self._resolver.to_local(interest, snapshot).position
            trajectory = path(self._flight.start(snapshot), local, radius_m, bounds, heading, target)
            what = f"follow {len(waypoints)} waypoints to {_text(goals[-1])}"
            return self._follow(TaskKind.FOLLOW_PATH, what, trajectory, snapshot, turn)

    def _goals(self, waypoints: Sequence[PoseStamped | GeoWaypoint]) -> Sequence[Goal] | Sequence[GeoWaypoint]:
        """The waypoints of a path, checked as far as that can be done without knowing where the UAV is."""
        geo = [waypoint for waypoint in waypoints if isinstance(waypoint, GeoWaypoint)]
        poses = [waypoint for waypoint in waypoints if not isinstance(waypoint, GeoWaypoint)]
        if geo and poses:
            raise validation.refuse("waypoints", "poses and geographic positions cannot be mixed in one path")
        if geo:
            self._preconditions.require_capability(Capability.GEO, "follow_path")
            return [validation.geo_waypoint(each, f"geo_waypoints[{i}].") for i, each in enumerate(geo)]
        return [self._resolver.goal(each, f"waypoints[{i}]") for i, each in enumerate(poses)]

    def _follow(
        self, kind: TaskKind, what: str, trajectory: Trajectory, snapshot: Snapshot, turn: Turn
    ) -> Prepared[VehicleTask]:
        """A trajectory that was planned since a turn, in the state of a snapshot. Planning a long one takes seconds, in
        which others may command, and the UAV flies on.
        """
        name = kind.name.lower()
        plan = self._admit(name, trajectory, snapshot)

        def begin() -> VehicleTask:
            with self._preconditions.refusing(name):
                self._require_near(name, trajectory)
                task = self._new_task(kind, what)
                tolerance, tracker = self._tolerance, self._tracker()
                follow = FollowTrajectory(name, task, trajectory, tolerance, tracker, snapshot.time_s)
                self._flight.begin(follow, turn)
                accepted(name, task_id=task.id, what=what, length_m=round(trajectory.length_m, 2))
                return task

        return Prepared(plan, begin)

    def _require_near(self, name: str, trajectory: Trajectory) -> None:
        """Raises `WrongStateError` where the UAV is not ours any more, or not where a trajectory begins any more: it
        would be told to jump back.
        """
        here = self._flight.start(self._preconditions.require_state(name, State.FLYING_AUTO))
        flown_on_m = (here.position - trajectory.at(0.0).position).norm()
        if flown_on_m > _FLOWN_ON_M + _FLOWN_ON_S * here.velocity.norm():
            raise WrongStateError(
                f"{name}: the UAV flew on by {flown_on_m:.1f} m while the way was planned; stop it (abort), and then "
                "command this again"
            )

    def _chase(self, goal: Goal, bounds: Limits, snapshot: Snapshot, max_speed_m_s: float | None = None) -> MovingGoal:
        """What follows a goal in a frame that moves."""
        start, geofence = self._flight.start(snapshot), self._geofence

        def admit(way: Sequence[Vector3], now: Snapshot) -> None:
            if geofence is not None:
                geofence.require_inside(way, "the goal in the moving frame", now)

        def where(now_s: float) -> Motion:
            return self._resolver.moving_to_local(goal, now_s, start.yaw_rad)

        return MovingGoal(where, start, snapshot.time_s, bounds, admit, max_speed_m_s or math.inf)

    def _catch_up(
        self, kind: TaskKind, what: str, chase: MovingGoal, bounds: Limits, snapshot: Snapshot
    ) -> Prepared[VehicleTask]:
        name = kind.name.lower()
        self._admit(name, chase, snapshot)
        goal = chase.goal(snapshot.time_s)

        def begin() -> VehicleTask:
            with self._preconditions.refusing(name):
                task = self._new_task(kind, what)
                self._flight.begin(CatchUp(name, task, chase, bounds, self._tolerance))
                accepted(name, task_id=task.id, what=what, speed_m_s=round(goal.velocity.norm(), 2))
                return task

        return Prepared(Plan((goal.position - measured_motion(snapshot).position).norm()), begin)

    def set_pose(self, pose: PoseStamped) -> Prepared[None]:
        """A pose reference, sent as it is; it has left when it has begun."""
        return self._setpoint("set_pose", self._pose, pose)

    def set_velocity(self, velocity: TwistStamped) -> Prepared[None]:
        """A velocity reference; it has left when it has begun."""
        return self._setpoint("set_velocity", self._velocity, velocity)

    def tell_pose(self, pose: PoseStamped) -> None:
        """Begins `set_pose` at once, by the short way: see `_tell`."""
        self._tell("set_pose", self._pose, pose)

    def tell_velocity(self, velocity: TwistStamped) -> None:
        """Begins `set_velocity` at once, by the short way: see `_tell`."""
        self._tell("set_velocity", self._velocity, velocity)

    def _tell(self, name: str, make: Callable[[T], tuple[Reference, Snapshot]], setpoint: T) -> None:
        """As `_setpoint` and its `begin`, through the same checks, but each once: every setpoint of a stream comes by
        here.
        """
        try:
            reference, snapshot = make(setpoint)
            self._require_inside(name, reference, snapshot)
            self._flight.refer(reference, name, snapshot)
        except UalError as error:
            self._preconditions.log_refusal(name, error)
            raise

    def _setpoint(self, name: str, make: Callable[[T], tuple[Reference, Snapshot]], setpoint: T) -> Prepared[None]:
        with self._preconditions.refusing(name):
            reference, snapshot = make(setpoint)
            plan = self._admit(name, reference, snapshot)

        def begin() -> None:
            with self._preconditions.refusing(name):
                self._flight.refer(reference, name, snapshot)

        return Prepared(plan, begin)

    def _pose(self, pose: PoseStamped) -> tuple[Reference, Snapshot]:
        """The reference of a pose, in the state of a snapshot."""
        self._preconditions.require_capability(Capability.POSITION, "set_pose")
        goal = self._resolver.goal(pose, "pose")
        snapshot = self._preconditions.require_state("set_pose", State.FLYING_AUTO)
        if self._resolver.is_moving(goal):  # within the limits: wherever it may go
            return self._chase(goal, self._limits(), snapshot), snapshot
        local = self._resolver.to_local(goal, snapshot)
        yaw_rad = self._flight.start(snapshot).yaw_rad if local.yaw_rad is None else local.yaw_rad
        return Hold(local.position, yaw_rad), snapshot

    def _velocity(self, velocity: TwistStamped) -> tuple[Reference, Snapshot]:
        """The reference of a velocity, in the state of a snapshot."""
        self._preconditions.require_capability(Capability.VELOCITY, "set_velocity")
        twist, frame_id = self._resolver.velocity(velocity, "velocity")
        snapshot = self._preconditions.require_state("set_velocity", State.FLYING_AUTO)
        in_body = frame_id == self._resolver.tree.body
        if not in_body:
            twist = self._resolver.velocity_to_local(twist, frame_id, snapshot)
        scaled = limits.scaled_down(twist, self._limits())
        return Velocity(scaled, in_body=in_body, expires_s=snapshot.time_s + VELOCITY_TIMEOUT_S), snapshot

    def recover_from_manual(self) -> Prepared[Future[None]]:
        """Takes control back; the future ends when the state is FLYING_AUTO."""
        with self._preconditions.refusing("recover_from_manual"):
            self._preconditions.require_capability(Capability.RECOVER, "recover_from_manual")
            self._flight.require_replaceable("recover_from_manual")
            snapshot = self._preconditions.require_state("recover_from_manual", State.FLYING_MANUAL)

        def begin() -> Future[None]:
            with self._preconditions.refusing("recover_from_manual"):
                command = AutopilotCommand("take our references", snapshot.time_s)
                recover = Recover(command, self._limits())
                self._flight.begin(recover)
                command.send(self._backend.take_control)
                accepted("recover_from_manual")
                return recover.future

        return Prepared(Plan(), begin)

    def _admit(self, command: str, motion: Trajectory | Reference, snapshot: Snapshot) -> Plan:
        """Where every trajectory and every reference that is commanded passes before it begins, dry or not.

        Raises what keeps it from beginning; tells what it would be.
        """
        self._flight.require_replaceable(command)
        self._require_inside(command, motion, snapshot)
        return Plan(motion.length_m, motion.duration_s) if isinstance(motion, Trajectory) else Plan()

    def _require_inside(self, command: str, motion: Trajectory | Reference, snapshot: Snapshot) -> None:
        """Raises `GeofenceError` for what would leave the fence."""
        if self._geofence is None:
            return
        if isinstance(motion, MovingGoal):
            way = [measured_motion(snapshot).position, motion.goal(snapshot.time_s).position]
            self._geofence.require_inside(way, command, snapshot)
        else:
            self._geofence.admit(command, motion, self._limits(), snapshot)

    def _tracker(self) -> type[Follow | Pursuit]:
        takes_motion = self._backend.info().takes is Takes.ALL
        return Follow if takes_motion and self._settings.tracker is Tracker.REFERENCE else Pursuit


def _text(goal: Goal | GeoWaypoint) -> str:
    if isinstance(goal, GeoWaypoint):
        above = goal.altitude_reference.name
        return f"{goal.latitude_deg:.7f}, {goal.longitude_deg:.7f} at {goal.altitude_m:g} m ({above})"
    p = goal.position
    return f"{p.x:g}, {p.y:g}, {p.z:g} in {goal.frame_id}"
