"""Returning home: the way there by our own tracker, and then a landing, as one task."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TypeAlias

from typing_extensions import override

from ual.geometry import Vector3
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.course import Course
from ual_daemon.flight.manoeuvres.follow import FollowTrajectory, MakeTracker
from ual_daemon.flight.manoeuvres.land import OnHeight
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Step
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.references import Reference
from ual_daemon.trajectory import Motion, Trajectory

_NAME = "return_to_launch"

MakeLanding: TypeAlias = Callable[[VehicleTask, Snapshot, Reference, str, OnHeight], Handover]
"""Makes the landing that goes on with a task, from a snapshot: after a reference, by a name, telling its height."""


class HomeCourse(Course):
    """Leads over home, which may move."""

    ground_z_m: float
    """The ground at home in the local frame, as it was planned last."""


class ReturnManoeuvre(FollowTrajectory):
    """The way home. It can be replaced, cancelled and paused until the UAV is over home; then a landing goes on."""

    def __init__(
        self,
        task: VehicleTask,
        trajectory: Trajectory,
        course: HomeCourse,
        land: MakeLanding,
        tolerance: ToleranceSettings,
        tracker: MakeTracker,
        planned_s: float,
    ) -> None:
        """`land` makes the landing that goes on with the task."""
        super().__init__(_NAME, task, trajectory, tolerance, tracker, planned_s, course)
        self._land, self._home = land, course

    @property
    def _descent_m(self) -> float:
        return max(0.0, self._way.trajectory.end().position.z - self._home.ground_z_m)

    @property
    def _length_m(self) -> float:
        return self._way.flown_m + self._way.trajectory.length_m + self._descent_m

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        step = super().step(snapshot, estimate)
        if not step.has_ended or step.error is not None:
            return step
        report = partial(_report_landing, self._task, self._home.ground_z_m, self._length_m)
        return Step(handover=self._land(self._task, snapshot, self._way.hold, _NAME, report))

    @override
    def path_points(self, now_s: float) -> Sequence[Vector3]:
        end = self._way.trajectory.end().position
        return *super().path_points(now_s), Vector3(end.x, end.y, self._home.ground_z_m)

    @override
    def _progress(self, snapshot: Snapshot, motion: Motion, time_s: float) -> Progress:
        left_m = (super()._progress(snapshot, motion, time_s).distance_left_m or 0.0) + self._descent_m
        return _progress(left_m, self._length_m)


def _report_landing(task: VehicleTask, ground_z_m: float, length_m: float, z_m: float) -> None:
    task.report(partial(_progress, max(0.0, z_m - ground_z_m), length_m))


def _progress(left_m: float, length_m: float) -> Progress:
    return Progress(max(0.0, 1.0 - left_m / length_m) if length_m > 0.0 else None, left_m)
