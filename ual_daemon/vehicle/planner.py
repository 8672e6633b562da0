"""The planner of go-tos and paths: from a request to a task that may begin.

Planning a long path takes seconds, in which other commands may come and the UAV flies on. So a planned task begins only
if no newer command has begun in the meantime, and if the UAV is still near the start of the trajectory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeAlias

from ual.errors import ResourceExhaustedError, WrongStateError
from ual.geometry import PoseStamped
from ual.types import (
    AltitudeReference,
    Capability,
    FollowPathRequest,
    GeoWaypoint,
    GoToWaypointGeoRequest,
    GoToWaypointRequest,
    Limits,
    Plan,
    ReturnToLaunchRequest,
    State,
    TaskKind,
)
from ual_daemon import validation
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Snapshot, Takes
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.flight import CommandOrigin, Flight
from ual_daemon.flight.manoeuvres.follow import FollowTrajectory, MakeTracker
from ual_daemon.flight.manoeuvres.follow_moving_goal import FollowMovingGoal
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre
from ual_daemon.flight.manoeuvres.recover import RecoverFirst
from ual_daemon.flight.manoeuvres.return_to_launch import ReturnManoeuvre
from ual_daemon.flight.policy.ground import MEASURED_NOISE_M
from ual_daemon.flight.refusals import on_mission
from ual_daemon.flight.tasks import Tasks, VehicleTask
from ual_daemon.frames.resolver import FrameResolver, Goal
from ual_daemon.settings import Tracker, VehicleSettings
from ual_daemon.tracker import limits
from ual_daemon.tracker.pure_pursuit import Pursuit
from ual_daemon.tracker.references import TrajectoryReference, measured_motion
from ual_daemon.trajectory import PathWaypoint, Trajectory
from ual_daemon.vehicle.admission import admit
from ual_daemon.vehicle.courses import PathBounds, PathCourse, Resolve, ReturnCourse, StraightCourse
from ual_daemon.vehicle.distance_limit import DistanceLimit
from ual_daemon.vehicle.landings import Landings
from ual_daemon.vehicle.moving_goals import moving_goal
from ual_daemon.vehicle.preconditions import Preconditions
from ual_daemon.vehicle.prepared import Prepared
from ual_daemon.vehicle.refusal_log import accepted
from ual_daemon.vehicle.return_plan import ReturnPlan, plan_return

MOST_WAYPOINTS = 10_000
"""Most waypoints of a path: they take 0.7 s of processor time with a corner at each, 1.4 s inside a fence; a mission
has some hundred.
"""
_NEAR_START_M, _NEAR_START_S = 1.0, 0.5
"""Distance that a UAV may fly while its next trajectory is planned: these metres, plus its speed times these seconds.
"""


_MakeManoeuvre: TypeAlias = Callable[[VehicleTask], Manoeuvre]


class Planner:
    """Plans go-tos, paths and ways home of one UAV. Any thread may call; a long path blocks its caller for seconds."""

    def __init__(
        self,
        backend: Backend,
        flight: Flight,
        resolver: FrameResolver,
        preconditions: Preconditions,
        tasks: Tasks,
        settings: VehicleSettings,
        distance_limit: DistanceLimit,
        landings: Landings,
    ) -> None:
        self._backend = backend
        self._flight = flight
        self._landings = landings
        self._resolver = resolver
        self._preconditions = preconditions
        self._tasks = tasks
        self._settings = settings
        self._tolerance = settings.tolerance
        self._tracker_setting = settings.tracker
        self._distance_limit = distance_limit

    def go_to_waypoint(self, request: GoToWaypointRequest, order: CommandOrigin) -> Prepared[VehicleTask]:
        """Plans a straight line to a pose in any frame."""
        with self._preconditions.logging_refusal("go_to_waypoint"):
            self._preconditions.require_capability(Capability.POSITION, "go_to_waypoint")
            goal = self._resolver.goal(request.waypoint, "waypoint")
            max_speed_m_s = validation.max_speed(request.max_speed_m_s)
            snapshot = self._preconditions.require_state("go_to_waypoint", order.lease_id, State.FLYING_AUTO)
            if self._resolver.is_moving(goal):
                return self._follow_goal(goal, snapshot, max_speed_m_s, order)
            return self._go_straight(
                TaskKind.GO_TO_WAYPOINT, goal, self._goal_resolver(goal, snapshot), max_speed_m_s, snapshot, order
            )

    def _goal_resolver(self, goal: Goal, snapshot: Snapshot) -> Resolve:
        """Returns what finds a goal in the local frame. One that is ahead of the UAV stays where it was then."""
        if self._resolver.tree.is_below_body(goal.frame_id):
            local = self._resolver.to_local(goal, snapshot)
            return lambda _: local
        return partial(self._resolver.to_local, goal)

    def go_to_waypoint_geo(self, request: GoToWaypointGeoRequest, order: CommandOrigin) -> Prepared[VehicleTask]:
        """Plans a straight line to a position on Earth."""
        with self._preconditions.logging_refusal("go_to_waypoint_geo"):
            self._preconditions.require_capability(Capability.GEO, "go_to_waypoint_geo")
            goal = validation.geo_waypoint(request.waypoint)
            max_speed_m_s = validation.max_speed(request.max_speed_m_s)
            snapshot = self._preconditions.require_state("go_to_waypoint_geo", order.lease_id, State.FLYING_AUTO)
            resolve = partial(self._resolver.geo_to_local, goal)
            return self._go_straight(TaskKind.GO_TO_WAYPOINT_GEO, goal, resolve, max_speed_m_s, snapshot, order)

    def _go_straight(
        self,
        kind: TaskKind,
        goal: Goal | GeoWaypoint,
        resolve: Resolve,
        max_speed_m_s: float | None,
        snapshot: Snapshot,
        order: CommandOrigin,
    ) -> Prepared[VehicleTask]:
        """Prepares the straight line to a goal, which `resolve` finds in the local frame."""
        name = kind.name.lower()

        def at_speed(now: Snapshot) -> PathWaypoint:
            local = replace(resolve(now), max_speed_m_s=max_speed_m_s)
            self._distance_limit.require_goal(name, goal, local, now)
            return local

        course = StraightCourse(
            self._flight,
            name,
            at_speed,
            partial(self._path_bounds, max_speed_m_s),
            self._tolerance.position_m / 2,
            partial(self._follow_goal_instead, goal, max_speed_m_s),
            snapshot,
        )
        above = "" if isinstance(goal, GeoWaypoint) else self._height_text(goal, course.goal)
        what = f"go to {_text(goal)}{above}"
        return self._follow(kind, what, course, snapshot, order, relies_on_home=_is_above_home(goal))

    def _height_text(self, goal: Goal, local: PathWaypoint) -> str:
        """Says how high a goal is above the ground of the take-off, where its z does not say so; else empty."""
        ground_m = self._flight.geofence.ground.z_m
        if ground_m is None or abs(local.position.z - ground_m - goal.position.z) < MEASURED_NOISE_M:
            return ""
        height_m = local.position.z - ground_m
        return f" ({abs(height_m):.1f} m {'below' if height_m < 0.0 else 'above'} the ground of the take-off)"

    def follow_path(self, request: FollowPathRequest, order: CommandOrigin) -> Prepared[VehicleTask]:
        """Plans a path through waypoints."""
        with self._preconditions.logging_refusal("follow_path"):
            self._preconditions.require_capability(Capability.POSITION, "follow_path")
            count = len(request.waypoints)
            _require_count(count)
            radius_m = validation.not_negative(
                request.corner_radius_m, "corner_radius_m", at_most=validation.MAX_DISTANCE_M
            )
            max_speed_m_s = validation.max_speed(request.max_speed_m_s)
            leg_speeds_m_s = validation.leg_speeds(request.leg_speeds_m_s, count)
            holds_s = validation.holds(request.holds_s, count)
            speeds_m_s = [limits.slower(each, max_speed_m_s) for each in leg_speeds_m_s]
            point = request.point_of_interest
            heading = validation.path_heading(request.heading, has_point=point is not None)
            goals = self._goals(request.waypoints)
            interest = None if point is None else self._resolver.point(point, "point_of_interest")
            snapshot = self._preconditions.require_state("follow_path", order.lease_id, State.FLYING_AUTO)
            waypoints = self._local_waypoints(goals, speeds_m_s, holds_s, snapshot)
            self._distance_limit.require_goals("follow_path", goals, waypoints, snapshot)
            look_at = None if interest is None else self._resolver.to_local(interest, snapshot).position
            bounds = partial(self._path_bounds, max_speed_m_s, has_leg_speeds=any(leg_speeds_m_s))
            above_home, home_m = [_is_above_home(goal) for goal in goals], snapshot.earth.home_altitude_amsl_m
            course = PathCourse(
                self._flight, "follow_path", waypoints, radius_m, bounds, heading, look_at, above_home, home_m
            )
            what = f"follow {count} waypoints to {_text(goals[-1])}"
            relies_on_home = any(above_home)
            return self._follow(TaskKind.FOLLOW_PATH, what, course, snapshot, order, relies_on_home=relies_on_home)

    def _bounds(self, max_speed_m_s: float | None) -> Limits:
        """Returns the limits of a flight to a goal: at the speed that was requested, else at the autopilot's cruise."""
        in_force = self._flight.limits
        return in_force.cruise() if max_speed_m_s is None else limits.at_most(in_force.planned(), max_speed_m_s)

    def _path_bounds(self, max_speed_m_s: float | None, *, has_leg_speeds: bool = False) -> PathBounds:
        """Returns what bounds a path; a leg without a speed is flown as a goal would be."""
        if max_speed_m_s is not None or not has_leg_speeds:
            return PathBounds(self._bounds(max_speed_m_s))
        return PathBounds(self._flight.limits.planned(), self._flight.limits.cruise().horizontal_speed_m_s)

    def _local_waypoints(
        self,
        goals: Sequence[Goal | GeoWaypoint],
        speeds_m_s: Sequence[float | None],
        holds_s: Sequence[float],
        snapshot: Snapshot,
    ) -> list[PathWaypoint]:
        waypoints = self._resolver.all_to_local(goals, snapshot)
        return [
            replace(waypoint, max_speed_m_s=speed_m_s, hold_s=hold_s)
            for waypoint, speed_m_s, hold_s in zip(waypoints, speeds_m_s, holds_s, strict=True)
        ]

    def _goals(self, waypoints: Sequence[PoseStamped | GeoWaypoint]) -> Sequence[Goal] | Sequence[GeoWaypoint]:
        """Validates the waypoints of a path, as far as that is possible without the position of the UAV."""
        geo = [waypoint for waypoint in waypoints if isinstance(waypoint, GeoWaypoint)]
        poses = [waypoint for waypoint in waypoints if not isinstance(waypoint, GeoWaypoint)]
        if geo and poses:
            raise validation.refuse("waypoints", "poses and geographic positions cannot be mixed in one path")
        if geo:
            self._preconditions.require_capability(Capability.GEO, "follow_path")
            return [validation.geo_waypoint(each, f"geo_waypoints[{i}].") for i, each in enumerate(geo)]
        return [self._resolver.goal(each, f"waypoints[{i}]") for i, each in enumerate(poses)]

    def _follow(
        self,
        kind: TaskKind,
        what: str,
        course: PathCourse,
        snapshot: Snapshot,
        order: CommandOrigin,
        *,
        relies_on_home: bool,
    ) -> Prepared[VehicleTask]:
        """Prepares the task that follows a course, from the motion that is commanded at a snapshot."""
        name, trajectory, start_s = kind.name.lower(), course.first(snapshot), self._flight.start_time_s(snapshot)
        plan = admit(self._flight, name, trajectory, snapshot)
        course.fence = self._flight.geofence.fence(snapshot)

        def make(task: VehicleTask) -> Manoeuvre:
            tracker = self._tracker()
            return FollowTrajectory(name, task, trajectory, self._tolerance, tracker, start_s, course)

        def onward(task: VehicleTask, now: Snapshot) -> Manoeuvre:
            anew = course.first(now)
            admit(self._flight, name, anew, now)
            course.fence = self._flight.geofence.fence(now)
            return FollowTrajectory(name, task, anew, self._tolerance, self._tracker(), now.time_s, course)

        if self._flight.is_on_mission:
            return Prepared(plan, partial(self._begin_after_recovery, kind, what, onward, order))
        return self._prepared(kind, what, trajectory, plan, make, order, relies_on_home=relies_on_home)

    def return_to_launch(self, request: ReturnToLaunchRequest, order: CommandOrigin) -> Prepared[VehicleTask]:
        """Plans the way home. Where the autopilot flies by itself, control is taken back first."""
        with self._preconditions.logging_refusal("return_to_launch"):
            self._preconditions.require_capability(Capability.POSITION, "return_to_launch")
            self._preconditions.require_capability(Capability.LAND, "return_to_launch")
            height_m = request.height_m
            if height_m is not None:
                height_m = validation.positive(height_m, "height_m", at_most=validation.MAX_DISTANCE_M)
            self._flight.require_replaceable("return_to_launch")
            snapshot = self._preconditions.require_no_pilot("return_to_launch", order.lease_id)
            is_ours = self._flight.estimate(snapshot).state is State.FLYING_AUTO and not self._flight.is_on_mission
            if not is_ours and (refusal := self._failsafe_refusal(snapshot)):
                raise refusal
            way = plan_return(self._flight, self._settings, height_m, self._bounds(None), snapshot)
            start_s = self._flight.start_time_s(snapshot)

        def home_by(task: VehicleTask, way: ReturnPlan, planned_s: float) -> Manoeuvre:
            course = ReturnCourse(self._flight, self._settings, height_m, partial(self._bounds, None), way)
            tolerance, tracker = self._tolerance, self._tracker()
            land = self._landings.after
            return ReturnManoeuvre(task, way.trajectory, course, land, tolerance, tracker, planned_s)

        def onward(task: VehicleTask, now: Snapshot) -> Manoeuvre:
            way = plan_return(self._flight, self._settings, height_m, self._bounds(None), now)
            return home_by(task, way, now.time_s)

        way_height_m = way.trajectory.end().position.z - way.home.position.z
        what = f"return to {way.home.what} at {way_height_m:.1f} m above the ground, and land"
        if not is_ours:
            begin = partial(self._begin_after_recovery, TaskKind.RETURN_TO_LAUNCH, what, onward, order)
            return Prepared(way.plan, begin)
        make = partial(home_by, way=way, planned_s=start_s)
        kind = TaskKind.RETURN_TO_LAUNCH
        return self._prepared(kind, what, way.trajectory, way.plan, make, order, relies_on_home=True)

    def _failsafe_refusal(self, snapshot: Snapshot) -> WrongStateError | None:
        """Returns why a failsafe is not replaced by a way home of UAL; None if none holds the UAV."""
        refusal = self._preconditions.failsafe_refusal("return_to_launch", snapshot, force=False)
        if refusal is None:
            return None
        ways_out = "land ends the flight without that, recover_from_manual with force takes control back"
        return WrongStateError(f"{refusal.message}; {ways_out}", refusal.metadata)

    def _begin_after_recovery(
        self,
        kind: TaskKind,
        what: str,
        onward: Callable[[VehicleTask, Snapshot], Manoeuvre],
        order: CommandOrigin,
    ) -> VehicleTask:
        """Begins a task out of a mode in which the autopilot flies by itself. `onward` makes what then flies."""
        name = kind.name.lower()
        with self._preconditions.logging_refusal(name):
            snapshot = self._preconditions.require_no_pilot(name, order.lease_id)
            task = self._tasks.new(kind, what)
            command = AutopilotCommand("take our references")
            control = self._backend.take_control
            is_early = self._flight.raw_estimate(snapshot).state is State.FLYING_AUTO
            refusal = self._failsafe_refusal
            recover = RecoverFirst(task, name, command, control, refusal, partial(onward, task), is_early=is_early)
            self._flight.begin(recover, order, snapshot)
            self._flight.request_home()
            if snapshot.control.held_by is not Cause.OPEN and not is_early:
                recover.send(snapshot)
            accepted(name, task_id=task.id, what=what)
            return task

    def _prepared(
        self,
        kind: TaskKind,
        what: str,
        trajectory: Trajectory,
        plan: Plan,
        make: _MakeManoeuvre,
        order: CommandOrigin,
        *,
        relies_on_home: bool,
    ) -> Prepared[VehicleTask]:
        """Prepares the task whose manoeuvre `make` makes to fly a trajectory.

        Where it `relies_on_home`, that is requested: it may be seconds old, and what is flown is then fitted to it.
        """
        name = kind.name.lower()

        def begin() -> VehicleTask:
            with self._preconditions.logging_refusal(name):
                self._require_near(name, trajectory, order)
                task = self._tasks.new(kind, what)
                self._flight.begin(make(task), order)
                if relies_on_home:
                    self._flight.request_home()
                accepted(name, task_id=task.id, what=what, length_m=round(trajectory.length_m, 2))
                return task

        return Prepared(plan, begin)

    def _require_near(self, name: str, trajectory: Trajectory, order: CommandOrigin) -> None:
        """Raises `WrongStateError` if the reference would have to jump back to the start of the trajectory."""
        here = self._flight.start(self._preconditions.require_state(name, order.lease_id, State.FLYING_AUTO))
        distance_m = (here.position - trajectory.at(0.0).position).norm()
        if distance_m > _NEAR_START_M + _NEAR_START_S * here.velocity.norm():
            raise WrongStateError(
                f"{name}: the UAV flew on by {distance_m:.1f} m while the way was planned; stop it (abort), and then "
                "command this again"
            )

    def _follow_goal(
        self, goal: Goal, snapshot: Snapshot, max_speed_m_s: float | None, order: CommandOrigin
    ) -> Prepared[VehicleTask]:
        """Prepares the task that catches up with a goal in a frame that moves."""
        name, what, bounds = "go_to_waypoint", f"go to {_text(goal)}", partial(self._bounds, max_speed_m_s)
        if self._flight.is_on_mission:
            raise on_mission(name)
        reference = moving_goal(
            self._flight, self._resolver, self._distance_limit, goal, bounds, snapshot, max_speed_m_s
        )
        admit(self._flight, name, reference, snapshot)
        motion = reference.goal(snapshot.time_s)
        self._distance_limit.require_goal(name, goal, PathWaypoint(motion.position), snapshot)

        def begin() -> VehicleTask:
            with self._preconditions.logging_refusal(name):
                task = self._tasks.new(TaskKind.GO_TO_WAYPOINT, what)
                follow = FollowMovingGoal(name, task, reference, bounds, self._tolerance)
                self._flight.begin(follow, CommandOrigin(order.lease_id))  # it is not compared: planning took no time
                accepted(name, task_id=task.id, what=what, speed_m_s=round(motion.velocity.norm(), 2))
                return task

        return Prepared(Plan((motion.position - measured_motion(snapshot).position).norm()), begin)

    def _follow_goal_instead(
        self, goal: Goal | GeoWaypoint, max_speed_m_s: float | None, task: VehicleTask, snapshot: Snapshot
    ) -> Manoeuvre | None:
        """Returns the manoeuvre that goes on with a go-to whose goal has begun to move; None if it has not."""
        if isinstance(goal, GeoWaypoint) or not self._resolver.is_moving(goal):
            return None
        bounds = partial(self._bounds, max_speed_m_s)
        reference = moving_goal(
            self._flight, self._resolver, self._distance_limit, goal, bounds, snapshot, max_speed_m_s
        )
        return FollowMovingGoal("go_to_waypoint", task, reference, bounds, self._tolerance)

    def _tracker(self) -> MakeTracker:
        takes_motion = bool(self._flight.takes & (Takes.FEED_FORWARD | Takes.VELOCITY))
        if takes_motion and self._tracker_setting is Tracker.REFERENCE:
            return TrajectoryReference
        return partial(Pursuit, is_free=self._flight.geofence.is_free)


def _is_above_home(goal: Goal | GeoWaypoint) -> bool:
    return isinstance(goal, GeoWaypoint) and goal.altitude_reference is AltitudeReference.HOME


def _require_count(count: int) -> None:
    if not count:
        raise validation.refuse("waypoints", "there are none; a path needs at least one")
    if count > MOST_WAYPOINTS:
        raise ResourceExhaustedError(
            f"waypoints: {count} are more than the limit of {MOST_WAYPOINTS}: fly the path in parts",
            {"field": "waypoints", "limit": str(MOST_WAYPOINTS)},
        )


def _text(goal: Goal | GeoWaypoint) -> str:
    if isinstance(goal, GeoWaypoint):
        above = goal.altitude_reference.name
        return f"{goal.latitude_deg:.7f}, {goal.longitude_deg:.7f} at {goal.altitude_m:g} m ({above})"
    p = goal.position
    return f"{p.x:g}, {p.y:g}, {p.z:g} in {goal.frame_id}"
