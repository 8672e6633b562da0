"""Following a trajectory: a go-to or a path."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

from typing_extensions import override

from ual.errors import UalTimeoutError
from ual.geometry import Vector3
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.arrival import Arrival
from ual_daemon.flight.manoeuvre import (
    TIMEOUT_FACTOR,
    TIMEOUT_MARGIN_S,
    Manoeuvre,
    Step,
    failed,
    no_way,
    why_not_ours,
)
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.stuck import Headway
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.pure_pursuit import Pursuit
from ual_daemon.tracker.references import LONGEST_STOP_S, Hold, Reference, TrajectoryReference, measured_motion
from ual_daemon.trajectory import Motion, Trajectory
from ual_daemon.trajectory.outline import outline

MakeTracker: TypeAlias = Callable[[Trajectory, float, ToleranceSettings], TrajectoryReference | Pursuit]
"""Makes the tracker that flies a trajectory from a time on, within a tolerance."""


class FollowTrajectory(Manoeuvre):
    """A go-to or a path: the manoeuvre that flies a trajectory by a tracker, until the UAV has arrived at its end.

    While its task is paused, the tracker brakes and holds on the trajectory, and the time limit does not run.
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
    ) -> None:
        """`planned_s` is the time of the motion with which the trajectory begins; None: the time of the first step."""
        super().__init__(name, task)
        self._tracker = tracker
        self._task = task
        end = trajectory.end()
        self._trajectory = trajectory
        self._outline: Sequence[Vector3] | None = None
        self._tolerance = tolerance
        # Set before the first step, so that a command that comes before it begins with the motion of this reference.
        self._reference = None if planned_s is None else tracker(trajectory, planned_s, tolerance)
        self._hold = Hold(end.position, end.yaw_rad)
        self._arrival = Arrival(end.position, end.yaw_rad, tolerance)
        stops_s = len(trajectory.stops_s) * LONGEST_STOP_S
        self._longest_s = (trajectory.duration_s + stops_s) * TIMEOUT_FACTOR + TIMEOUT_MARGIN_S
        self._spent_s = 0.0
        self._stepped_s: float | None = None
        self._headway = Headway()
        self._watched_s, self._watched_waypoint = -math.inf, 0

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_not_ours(snapshot, estimate, self.name)
        if lost is not None:
            return failed(lost)
        is_paused = self.is_paused
        self._spend(snapshot.time_s, is_paused=is_paused)
        if self._reference is None:
            self._reference = self._tracker(self._trajectory, snapshot.time_s, self._tolerance)
        reference = self._reference
        reference.is_stopping = is_paused
        setpoint = reference.setpoint(snapshot)
        self._task.report(partial(self._progress, snapshot, reference.motion(snapshot), reference.time_s))
        self._arrival.observe(snapshot)
        if is_paused:
            self._headway.restart()
            return Step(setpoint)
        if reference.is_finished and self._arrival.has_arrived(snapshot):
            return Step(setpoint, has_ended=True, next_reference=self._hold)
        if self._spent_s > self._longest_s:
            return failed(
                UalTimeoutError(
                    f"{self.name}: not there after {self._longest_s:.0f} s: {self._arrival.error_text()}",
                    {"state": estimate.state.name},
                )
            )
        stuck_s = self._stuck_s(reference, snapshot)
        return no_way(self.name, stuck_s, self._arrival.error_text(), snapshot) if stuck_s else Step(setpoint)

    def _stuck_s(self, reference: TrajectoryReference | Pursuit, snapshot: Snapshot) -> float:
        """Returns for how long it has made no way; 0 while it makes way, or need not."""
        trajectory, time_s, measured = self._trajectory, reference.time_s, measured_motion(snapshot)
        planned, waypoint = trajectory.at(time_s), trajectory.waypoint_at(time_s)
        is_holding = time_s > self._watched_s and not reference.is_finished and planned.velocity == Vector3()
        if is_holding or waypoint != self._watched_waypoint:
            self._headway.restart()
        self._watched_s, self._watched_waypoint = time_s, waypoint
        lag_m = (measured.position - planned.position).norm()
        turn_rad = self._arrival.turn_left_rad(measured) if reference.is_finished else 0.0
        return self._headway.stuck_s(
            snapshot.time_s,
            trajectory.length_left_m(time_s) + lag_m,
            turn_rad,
            lambda passed_s: trajectory.length_left_m(time_s + passed_s),
        )

    def _spend(self, now_s: float, *, is_paused: bool) -> None:
        """Lets time pass, as far as the time limit counts it."""
        if self._stepped_s is not None and not is_paused:
            self._spent_s += now_s - self._stepped_s
        self._stepped_s = now_s

    def _progress(self, snapshot: Snapshot, motion: Motion, time_s: float) -> Progress:
        """Returns the progress for a motion of the reference and its time on the trajectory."""
        lag_m = (measured_motion(snapshot).position - motion.position).norm()
        left_m = self._trajectory.length_left_m(time_s) + lag_m
        length_m, duration_s = self._trajectory.length_m, self._trajectory.duration_s
        if length_m > 0.0:
            progress = max(0.0, 1.0 - left_m / length_m)
        else:
            progress = time_s / duration_s if duration_s > 0.0 else 1.0
        return Progress(min(1.0, progress), left_m, self._trajectory.waypoint_at(time_s))

    @override
    def current_reference(self) -> Reference | None:
        return self._reference

    @override
    def way(self, now_s: float) -> Sequence[Vector3]:
        if self._outline is None:
            self._outline = outline(self._trajectory)
        return self._outline
