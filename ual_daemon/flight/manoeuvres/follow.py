"""Following a trajectory: a go-to or a path."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from threading import Thread
from typing import NamedTuple, TypeAlias

from typing_extensions import override

from ual.errors import FrameLostError, UalError, UalTimeoutError, WrongStateError
from ual.geometry import Vector3
from ual_daemon import logs
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.arrival import Arrival
from ual_daemon.flight.manoeuvres.course import Course, CourseProgress, Onward
from ual_daemon.flight.manoeuvres.manoeuvre import (
    TIMEOUT_FACTOR,
    TIMEOUT_MARGIN_S,
    Handover,
    Manoeuvre,
    Step,
    failed,
    no_progress,
    why_not_ours,
)
from ual_daemon.flight.manoeuvres.progress_watch import Headway
from ual_daemon.flight.manoeuvres.remaining_route import RemainingRoute
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.stopping import next_start
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.pure_pursuit import Pursuit
from ual_daemon.tracker.references import LONGEST_STOP_S, Hold, Reference, TrajectoryReference, measured_motion
from ual_daemon.trajectory import Motion, Trajectory
from ual_daemon.trajectory.outline import outline

_log = logging.getLogger(__name__)

_REST_SPEED_M_S = 1e-6

MakeTracker: TypeAlias = Callable[[Trajectory, float, ToleranceSettings], TrajectoryReference | Pursuit]
"""Makes the tracker that flies a trajectory from a time on, within a tolerance."""


class _FollowedTrajectory(NamedTuple):
    """A trajectory as a part of the task: what was flown before it, and the number of its first waypoint there."""

    trajectory: Trajectory
    hold: Hold
    arrival: Arrival
    flown_m: float = 0.0
    first_waypoint: int = 0


class FollowTrajectory(Manoeuvre):
    """A go-to or a path: the manoeuvre that flies a trajectory by a tracker, until the UAV has arrived at its end.

    While its task is paused or waits for a position, the tracker brakes and holds on the trajectory, and the time limit
    does not run. When the world has changed, its `course` plans the rest again. Where that takes long, the UAV first
    comes to rest on its way.
    """

    why_not_pausable = ""

    def __init__(
        self,
        name: str,
        task: VehicleTask,
        trajectory: Trajectory,
        tolerance: ToleranceSettings,
        tracker: MakeTracker = TrajectoryReference,
        planned_s: float | None = None,
        course: Course | None = None,
    ) -> None:
        """`planned_s` is the time of the motion with which the trajectory begins; None: the time of the first step."""
        super().__init__(name, task)
        self._tracker = tracker
        self._task = task
        self._tolerance = tolerance
        self._course = course
        self._way = self._followed(trajectory)
        self._outline: Sequence[Vector3] | None = None
        # Set before the first step, so that a command that comes before it begins with the motion of this reference.
        self._reference = None if planned_s is None else tracker(trajectory, planned_s, tolerance)
        self._longest_s = _longest_s(trajectory)
        self._spent_s = 0.0
        self._stepped_s: float | None = None
        self._headway = Headway()
        self._watched_s, self._watched_waypoint = -math.inf, 0
        self._rest: RemainingRoute | None = None
        self._planning: _Planning | None = None
        self._said_before: str | None = None

    def _followed(self, trajectory: Trajectory, flown_m: float = 0.0, first_waypoint: int = 0) -> _FollowedTrajectory:
        end = trajectory.end()
        arrival = Arrival(end.position, end.yaw_rad, self._tolerance)
        return _FollowedTrajectory(trajectory, Hold(end.position, end.yaw_rad), arrival, flown_m, first_waypoint)

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_not_ours(snapshot, estimate, self.name)
        if lost is not None:
            return failed(lost)
        if self._reference is None:
            self._reference = self._tracker(self._way.trajectory, snapshot.time_s, self._tolerance)
        if self._said_before is None:
            self._said_before = snapshot.condition.status_text
        try:
            self._continue_planning(self._reference, snapshot)
        except UalError as error:
            return _ended_by_world(error)
        return self._follow(self._reference, snapshot, estimate)

    def _follow(self, reference: TrajectoryReference | Pursuit, snapshot: Snapshot, estimate: Estimate) -> Step:
        is_waiting = self.is_paused or self._planning is not None or bool(self.waits_for)
        self._task.note = f"waits: {self.waits_for}" if self.waits_for else ""
        self._spend(snapshot.time_s, is_paused=is_waiting)
        reference.is_stopping = is_waiting
        setpoint, arrival = reference.setpoint(snapshot), self._way.arrival
        self._task.report(partial(self._progress, snapshot, reference.motion(snapshot), reference.time_s))
        arrival.observe(snapshot)
        if is_waiting:
            self._headway.restart()
            return Step(setpoint)
        if reference.is_finished and arrival.has_arrived(snapshot):
            return Step(setpoint, has_ended=True, next_reference=self._way.hold)
        if self._spent_s > self._longest_s:
            late = UalTimeoutError(
                f"{self.name}: not there after {self._longest_s:.0f} s: {arrival.error_text()}",
                {"state": estimate.state.name},
            )
            return Step(has_ended=True, error=late, is_to_stop=True)
        stuck_s = self._stuck_s(reference, snapshot)
        if not stuck_s:
            return Step(setpoint)
        return no_progress(self.name, stuck_s, arrival.error_text(), snapshot, self._said_before)

    def _stuck_s(self, reference: TrajectoryReference | Pursuit, snapshot: Snapshot) -> float:
        """Returns for how long it has made no way; 0 while it makes way, or need not, or between two looks."""
        if not self._headway.is_due(snapshot.time_s):
            return 0.0
        trajectory, time_s, measured = self._way.trajectory, reference.time_s, measured_motion(snapshot)
        planned, waypoint, passed_s = trajectory.at(time_s), trajectory.waypoint_at(time_s), reference.passed_s
        is_holding = passed_s > self._watched_s and not reference.is_finished and planned.velocity == Vector3()
        if is_holding or waypoint != self._watched_waypoint:
            self._headway.restart()
        self._watched_s, self._watched_waypoint = passed_s, waypoint
        lag_m = (measured.position - planned.position).norm()
        turn_rad = self._way.arrival.turn_left_rad(measured) if reference.is_finished else 0.0
        return self._headway.stuck_s(
            snapshot.time_s,
            trajectory.length_left_m(time_s) + lag_m,
            turn_rad,
            lambda after_s: trajectory.length_left_m(time_s + after_s),
        )

    def _spend(self, now_s: float, *, is_paused: bool) -> None:
        """Lets time pass, as far as the time limit counts it."""
        if self._stepped_s is not None and not is_paused:
            self._spent_s += now_s - self._stepped_s
        self._stepped_s = now_s

    def _progress(self, snapshot: Snapshot, motion: Motion, time_s: float) -> Progress:
        """Returns the progress for a motion of the reference and its time on the trajectory."""
        trajectory, _, _, flown_m, first_waypoint = self._way
        measured = snapshot.motion.pose
        lag_m = 0.0 if measured is None else (measured.value.position - motion.position).norm()
        left_m = trajectory.length_left_m(time_s) + lag_m
        length_m, duration_s = flown_m + trajectory.length_m, trajectory.duration_s
        if length_m > 0.0:
            progress = max(0.0, 1.0 - left_m / length_m)
        else:
            progress = time_s / duration_s if duration_s > 0.0 else 1.0
        return Progress(min(1.0, progress), left_m, first_waypoint + trajectory.waypoint_at(time_s))

    # --- A world that has changed -------------------------------------------------------------------------------------

    @override
    def fit(self, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy) -> Step | None:
        course, reference = self._course, self._reference
        if course is None or reference is None:
            return None
        try:
            successor = course.successor(self._task, snapshot)
            if successor is not None:
                return Step(handover=Handover(successor))
            self._fit(course, self._course_progress(reference, snapshot), snapshot, limits, geofence)
        except UalError as error:
            return _ended_by_world(error)
        return None

    def _fit(
        self, course: Course, flown: CourseProgress, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy
    ) -> None:
        if self._planning is not None:
            self.is_fitted = False  # looked at again once that is done
        elif course.is_outdated(flown, snapshot):
            if course.is_long:
                self._planning = _Planning(course)
            else:
                self._take(course.plan(flown, snapshot), flown, snapshot)
        else:
            self._check_fence(course, flown, snapshot, limits, geofence)

    def _check_fence(
        self, course: Course, flown: CourseProgress, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy
    ) -> None:
        """Begins to check the rest of the way, if the geofence is another one than that in which it was planned."""
        try:
            fence = geofence.fence(snapshot)
            if fence is not course.fence:
                self._rest = RemainingRoute(self.name, flown, limits.get(), geofence, snapshot)
                course.fence = fence
        except FrameLostError:
            raise
        except WrongStateError:  # for a moment, as the autopilot's origin is requested again
            self.is_fitted = False

    def _continue_planning(self, reference: TrajectoryReference | Pursuit, snapshot: Snapshot) -> None:
        """Goes on with what one update has no time for. Raises a `UalError` if the task cannot go on."""
        if self._rest is not None:
            self._rest.require_inside(snapshot)
            self._rest = None if self._rest.is_over else self._rest
        planning = self._planning
        if planning is None:
            return
        flown = self._course_progress(reference, snapshot)
        still_m_s = self._tolerance.speed_m_s if isinstance(reference, Pursuit) else _REST_SPEED_M_S
        if flown.motion.velocity.norm() <= still_m_s:
            planning.begin(flown, snapshot)
        if planning.is_done:
            self._planning, self._rest = None, None
            self._take(planning.found(), flown, snapshot)

    def _course_progress(self, reference: TrajectoryReference | Pursuit, snapshot: Snapshot) -> CourseProgress:
        return CourseProgress(
            self._way.trajectory, reference.passed_s, next_start(reference, snapshot), reference.is_waiting
        )

    def _take(self, onward: Onward, flown: CourseProgress, snapshot: Snapshot) -> None:
        """Follows another trajectory from now on."""
        before, trajectory = self._way, onward.trajectory
        flown_m = before.flown_m + before.trajectory.length_m - before.trajectory.length_left_m(flown.time_s)
        self._way = self._followed(trajectory, flown_m, before.first_waypoint + onward.passed_count)
        begin_s = snapshot.time_s if self._reference is None else self._reference.motion_time_s(snapshot)
        self._reference = self._tracker(trajectory, begin_s, self._tolerance)
        self._longest_s = self._spent_s + _longest_s(trajectory)
        self._outline, self._watched_s, self._rest = None, -math.inf, None
        self._headway.restart()
        logs.event(
            _log, logging.INFO, "way_planned_anew", task=self.name, task_id=self._task.id, why=onward.why,
            left_m=round(trajectory.length_m, 1), duration_s=round(trajectory.duration_s, 1),
        )  # fmt: skip

    @override
    def current_reference(self) -> Reference | None:
        return self._reference

    @override
    def path_points(self, now_s: float) -> Sequence[Vector3]:
        if self._outline is None:
            self._outline = outline(self._way.trajectory)
        return self._outline


def _longest_s(trajectory: Trajectory) -> float:
    """Returns how long it may take to fly a trajectory."""
    stops_s = len(trajectory.stops_s) * LONGEST_STOP_S
    return (trajectory.duration_s + stops_s) * TIMEOUT_FACTOR + TIMEOUT_MARGIN_S


def _ended_by_world(error: UalError) -> Step:
    """Returns the step of a manoeuvre that cannot go on in a world that has changed."""
    text = f"{error.message}; this has changed in flight: the UAV stops and holds its position"
    return Step(has_ended=True, error=type(error)(text, error.metadata), is_to_stop=True)


class _Planning:
    """The planning of a long way, by a thread of its own, from where the UAV has come to rest on the one before."""

    def __init__(self, course: Course) -> None:
        self._course = course
        self._result: Future[Onward] | None = None

    @property
    def is_done(self) -> bool:
        """Whether it has ended."""
        return self._result is not None and self._result.done()

    def begin(self, flown: CourseProgress, snapshot: Snapshot) -> None:
        """Begins it, once."""
        if self._result is None:
            self._result = Future()
            Thread(target=self._run, args=(self._result, flown, snapshot), name="way", daemon=True).start()

    def found(self) -> Onward:
        """Returns the way. Raises a `UalError` if there is none."""
        assert self._result is not None
        return self._result.result()

    def _run(self, result: Future[Onward], flown: CourseProgress, snapshot: Snapshot) -> None:
        try:
            result.set_result(self._course.plan(flown, snapshot))
        except Exception as error:  # noqa: BLE001  raised in the thread that flies, which logs it
            result.set_exception(error)
