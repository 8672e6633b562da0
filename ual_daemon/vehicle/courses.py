"""Plans of go-tos, paths and ways home: what is left of each can be planned again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, TypeAlias

from typing_extensions import override

from ual.geometry import Vector3
from ual.types import Limits, PathHeading
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.flight.manoeuvres.course import Course, CourseProgress, Onward
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre
from ual_daemon.flight.manoeuvres.return_to_launch import HomeCourse
from ual_daemon.flight.policy.home import home_point
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.settings import VehicleSettings
from ual_daemon.trajectory import Motion, PathWaypoint, Trajectory, path
from ual_daemon.vehicle.return_plan import ReturnPlan, plan_return

LONG_PATH_WAYPOINTS = 200
"""A path of more waypoints takes more than 15 ms to plan, 30 ms inside a fence."""
_EDGE_S = 1e-6
_SAME_HEIGHT_M = 0.25
"""Height difference in metres that counts as none; PX4 corrects its home by less at a time."""


class PathBounds(NamedTuple):
    """Bounds of a path: the limits, and the speed of legs that have none of their own (None: the limits' speed)."""

    limits: Limits
    leg_speed_m_s: float | None = None


Resolve: TypeAlias = Callable[[Snapshot], PathWaypoint]
"""Returns where a goal is in the local frame now. Raises a `UalError` if that is not known any more."""


class PathCourse(Course):
    """A path through waypoints, which stay where they are in the local frame, but for those whose heights count from
    home: they follow it up and down.
    """

    def __init__(
        self,
        flight: Flight,
        command: str,
        waypoints: Sequence[PathWaypoint],
        corner_radius_m: float,
        bounds: Callable[[], PathBounds],
        heading: PathHeading = PathHeading.WAYPOINTS,
        look_at: Vector3 | None = None,
        above_home: Sequence[bool] = (),
        home_m: float | None = None,
    ) -> None:
        """`above_home` says of each waypoint whether its height counts from home, which is at `home_m`; none: no."""
        self._flight, self._command = flight, command
        self._waypoints = list(waypoints)
        """Waypoints that are left; a speed of None is that of `bounds`, which returns what bounds the path now."""
        self._radius_m, self._bounds, self._heading, self._look_at = corner_radius_m, bounds, heading, look_at
        self._planned_by = bounds()
        self._above_home, self._home_m = list(above_home), home_m

    def first(self, snapshot: Snapshot) -> Trajectory:
        """Plans the whole way, from the motion that is commanded now."""
        start = self._flight.start(snapshot)
        kept_rad = start.yaw_rad
        for number, waypoint in enumerate(self._waypoints):  # what keeps the heading before must keep it later, too
            kept_rad = kept_rad if waypoint.yaw_rad is None else waypoint.yaw_rad
            self._waypoints[number] = replace(waypoint, yaw_rad=kept_rad)
        return self._path(start, self._waypoints, self._planned_by)

    def _path(self, start: Motion, waypoints: Sequence[PathWaypoint], bounds: PathBounds) -> Trajectory:
        speed_m_s = bounds.leg_speed_m_s
        if speed_m_s is not None:
            waypoints = [replace(each, max_speed_m_s=each.max_speed_m_s or speed_m_s) for each in waypoints]
        return path(start, waypoints, self._radius_m, bounds.limits, self._heading, self._look_at)

    @property
    @override
    def is_long(self) -> bool:
        return len(self._waypoints) > LONG_PATH_WAYPOINTS

    @override
    def is_outdated(self, flown: CourseProgress, snapshot: Snapshot) -> bool:
        return self._bounds() != self._planned_by or abs(self._risen_m(snapshot)) > _SAME_HEIGHT_M

    def _risen_m(self, snapshot: Snapshot) -> float:
        """Returns by how much home has risen since it was planned, where a height counts from it."""
        before_m, now_m = self._home_m, snapshot.earth.home_altitude_amsl_m
        return 0.0 if before_m is None or now_m is None or not any(self._above_home) else now_m - before_m

    @override
    def plan(self, flown: CourseProgress, snapshot: Snapshot) -> Onward:
        bounds, (passed_count, rest) = self._bounds(), self._rest(flown)
        above_home, risen_m = self._above_home[passed_count:], self._risen_m(snapshot)
        if risen_m:
            rest = [
                _raised(each, risen_m) if is_above else each for each, is_above in zip(rest, above_home, strict=True)
            ]
        trajectory = self._path(flown.motion, rest, bounds)
        self._flight.geofence.admit(self._command, trajectory, self._flight.limits.get(), snapshot)
        why = "limits" if bounds != self._planned_by else "home has moved"
        self._waypoints, self._planned_by, self._above_home = rest, bounds, above_home
        self._home_m = snapshot.earth.home_altitude_amsl_m
        self.fence = self._flight.geofence.fence(snapshot)
        return Onward(trajectory, passed_count, why)

    def _rest(self, flown: CourseProgress) -> tuple[int, list[PathWaypoint]]:
        """Returns how many waypoints are passed, and those that are left."""
        trajectory, time_s = flown.trajectory, flown.time_s
        begun_s = next(
            (stop_s for stop_s, hold_s in trajectory.holds_s.items() if 0.0 < time_s - stop_s < hold_s), None
        )
        if begun_s is not None:  # it holds: the rest of the hold is left
            number = trajectory.waypoint_at(begun_s - _EDGE_S)
            left_s = begun_s + trajectory.holds_s[begun_s] - time_s
            return number, [replace(self._waypoints[number], hold_s=left_s), *self._waypoints[number + 1 :]]
        number = trajectory.waypoint_at(time_s - _EDGE_S if flown.is_waiting else self._after_corner_s(flown))
        return number, self._waypoints[number:]

    @staticmethod
    def _after_corner_s(flown: CourseProgress) -> float:
        """Returns the end of the corner that it flies: the waypoint there counts as passed. Elsewhere the time now."""
        bends = (end_s for begin_s, end_s in flown.trajectory.bends_s() if begin_s < flown.time_s < end_s)
        return next(bends, flown.time_s)


def _raised(waypoint: PathWaypoint, risen_m: float) -> PathWaypoint:
    return replace(waypoint, position=waypoint.position + Vector3(0.0, 0.0, risen_m))


class StraightCourse(PathCourse):
    """A straight line to a goal, which may be elsewhere now: home has moved, or a client has moved its frame."""

    def __init__(
        self,
        flight: Flight,
        command: str,
        resolve: Resolve,
        bounds: Callable[[], PathBounds],
        same_place_m: float,
        follow_goal: Callable[[VehicleTask, Snapshot], Manoeuvre | None],
        snapshot: Snapshot,
    ) -> None:
        """`same_place_m`: a goal that has moved by less has not. `follow_goal` returns what flies on then."""
        super().__init__(flight, command, [resolve(snapshot)], 0.0, bounds)
        self._resolve, self._same_place_m, self._follow_goal = resolve, same_place_m, follow_goal

    @property
    def goal(self) -> PathWaypoint:
        """The goal in the local frame, as it was planned last."""
        return self._waypoints[0]

    @override
    def is_outdated(self, flown: CourseProgress, snapshot: Snapshot) -> bool:
        return super().is_outdated(flown, snapshot) or self._has_moved(snapshot)

    def _has_moved(self, snapshot: Snapshot) -> bool:
        return (self._resolve(snapshot).position - self.goal.position).norm() > self._same_place_m

    @override
    def plan(self, flown: CourseProgress, snapshot: Snapshot) -> Onward:
        found, has_moved = self._resolve(snapshot), self._has_moved(snapshot)
        self._waypoints = [replace(found, yaw_rad=self.goal.yaw_rad if found.yaw_rad is None else found.yaw_rad)]
        return super().plan(flown, snapshot)._replace(why="the goal has moved" if has_moved else "limits")

    @override
    def _rest(self, flown: CourseProgress) -> tuple[int, list[PathWaypoint]]:
        return 0, self._waypoints

    @override
    def successor(self, task: VehicleTask, snapshot: Snapshot) -> Manoeuvre | None:
        return self._follow_goal(task, snapshot)


class ReturnCourse(HomeCourse):
    """The way home: home may be set elsewhere, or be corrected."""

    def __init__(
        self,
        flight: Flight,
        settings: VehicleSettings,
        height_m: float | None,
        bounds: Callable[[], Limits],
        way: ReturnPlan,
    ) -> None:
        self._flight, self._settings, self._height_m, self._bounds = flight, settings, height_m, bounds
        self._planned_by = bounds()
        self._home = way.home.position
        self.ground_z_m = self._home.z

    @override
    def is_outdated(self, flown: CourseProgress, snapshot: Snapshot) -> bool:
        return self._bounds() != self._planned_by or self._has_moved(snapshot)

    def _has_moved(self, snapshot: Snapshot) -> bool:
        home = home_point(snapshot, self._flight.geofence.ground)
        return home is not None and (home.position - self._home).norm() > self._settings.tolerance.position_m

    @override
    def plan(self, flown: CourseProgress, snapshot: Snapshot) -> Onward:
        bounds, why = self._bounds(), "home has moved" if self._has_moved(snapshot) else "limits"
        way = plan_return(self._flight, self._settings, self._height_m, bounds, snapshot)
        self._planned_by, self._home, self.ground_z_m = bounds, way.home.position, way.home.position.z
        self.fence = self._flight.geofence.fence(snapshot)
        return Onward(way.trajectory, 0, why)
