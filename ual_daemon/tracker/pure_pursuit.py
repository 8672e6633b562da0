"""Pure pursuit: the tracker for autopilots that take bare positions only, and by ``tracker: pursuit``.

The setpoint is a point of the path a little ahead of the UAV. See Coulter, "Implementation of the Pure Pursuit Path
Tracking Algorithm", CMU-RI-TR-92-01; in the air: Real et al., "Unmanned aerial vehicle abstraction layer", 2020. The
UAV comes back to the line from wherever it was pushed off, and the autopilot needs no feed-forward. But the UAV is
slower, and cuts corners by up to the look-ahead. At a corner of the geofence that points inwards it looks ahead only as
far as the straight way there is inside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from typing_extensions import override

from ual.geometry import Pose, Vector3
from ual_daemon.backends.values import PositionSetpoint, Setpoint, Snapshot
from ual_daemon.settings import ToleranceSettings
from ual_daemon.tracker.references import LONGEST_STOP_S, Reference, measured_motion, pose_of
from ual_daemon.trajectory import Motion, Trajectory

LOOKAHEAD_S = 1.0
"""The look-ahead is as far as the UAV flies in this time at the speed planned there, ..."""
LEAST_LOOKAHEAD_M = 0.5
"""... but at least this far."""
LEAST_AT_FENCE_M = 0.3
"""Least metres to the point ahead once the UAV is nearly there, where the straight line ahead is not inside. It must
not stall at a corner of the fence because its estimate wanders.
"""
_ARRIVAL_DISTANCE_M = 0.15
_SEARCH_STEP_S = 0.05
_LONGEST_SEARCH_S = 3.0
_LONGEST_UPDATE_STEP_S = 0.2


IsFree: TypeAlias = Callable[[Vector3, Vector3, Snapshot], bool]
"""Whether a UAV may fly straight from one position to another, by the geofence."""


class Pursuit(Reference):
    """Sends a point ahead on a trajectory, which moves on at most as fast as the trajectory.

    `time_s` is the time on the trajectory of its point nearest to the UAV. It only grows, and not beyond a stop before
    the UAV stands there (within `tolerance`).
    """

    def __init__(
        self, trajectory: Trajectory, now_s: float, tolerance: ToleranceSettings, is_free: IsFree | None = None
    ) -> None:
        self.trajectory = trajectory
        self._tolerance = tolerance
        self._is_free = is_free
        self._stops_s = [*trajectory.stops_s, trajectory.duration_s]
        self._at_stop_since_s: float | None = None
        self._held_s = 0.0
        self.is_stopping = False
        """Whether the point ahead stands still, so that the UAV comes to rest there."""
        self.time_s = 0.0
        self._ahead = trajectory.at(0.0)
        is_moving = self._ahead.velocity.norm() * LOOKAHEAD_S > LEAST_LOOKAHEAD_M
        self._ahead_s = LOOKAHEAD_S if is_moving else 0.0  # else it would brake whenever a way is planned again
        self._updated_s = now_s

    @property
    def passed_s(self) -> float:
        """`time_s`, and what has passed of the hold at the present stop."""
        return self.time_s + self._held_s

    @property
    def is_waiting(self) -> bool:
        """Whether it waits at a stop, or holds there."""
        return self.time_s == self._stops_s[0] and len(self._stops_s) > 1

    @property
    def is_finished(self) -> bool:
        """Whether the point ahead is the end; the UAV may still be on its way."""
        return len(self._stops_s) == 1 and self._ahead.position == self.trajectory.end().position

    @override
    def setpoint(self, snapshot: Snapshot) -> Setpoint:
        measured = measured_motion(snapshot)
        passed_s = min(max(0.0, snapshot.time_s - self._updated_s), _LONGEST_UPDATE_STEP_S)
        self._updated_s = snapshot.time_s
        self._advance(measured.position)
        if not self.is_stopping:
            self._pass_stop(measured, snapshot.time_s, passed_s)
            self._ahead = self._lead_motion(passed_s, snapshot)
        return PositionSetpoint(self._ahead.position, self._ahead.yaw_rad)

    def _advance(self, position: Vector3) -> None:
        """Advances `time_s` to the point nearest to the UAV, as far as the distance falls on the way there."""
        limit_s = self._stops_s[0]
        nearest_m = (self.trajectory.at(self.time_s).position - position).norm()
        time_s = self.time_s
        while time_s < min(limit_s, self.time_s + _LONGEST_SEARCH_S):
            time_s = min(limit_s, time_s + _SEARCH_STEP_S)
            distance_m = (self.trajectory.at(time_s).position - position).norm()
            if distance_m > nearest_m + LEAST_LOOKAHEAD_M:
                break
            if distance_m <= nearest_m:
                nearest_m, self.time_s = distance_m, time_s

    def _pass_stop(self, measured: Motion, now_s: float, passed_s: float) -> None:
        """Goes on from a stop once the UAV has come to rest and held there."""
        if len(self._stops_s) == 1 or not (self._held_s or self._has_stopped(measured, now_s)):
            return
        self._held_s += passed_s
        hold_s = self.trajectory.holds_s.get(self._stops_s[0], 0.0)
        if self._held_s >= hold_s:
            self.time_s = self._stops_s.pop(0) + hold_s
            self._held_s, self._at_stop_since_s = 0.0, None

    def _has_stopped(self, measured: Motion, now_s: float) -> bool:
        """Returns whether the UAV stands at the next stop, or has been there for `LONGEST_STOP_S` (a wandering
        estimate).
        """
        stop = self.trajectory.at(self._stops_s[0])
        if (measured.position - stop.position).norm() > self._tolerance.position_m:
            return False
        if self._at_stop_since_s is None:
            self._at_stop_since_s = now_s
        is_slow = measured.velocity.norm() <= self._tolerance.speed_m_s
        return is_slow or now_s - self._at_stop_since_s > LONGEST_STOP_S

    def _lead_motion(self, passed_s: float, snapshot: Snapshot) -> Motion:
        """Returns the motion of the trajectory at the end of the look-ahead.

        The point ahead moves on no faster than the trajectory, because the UAV flies as fast as that point.
        """
        here = self.trajectory.at(self.time_s)
        far_m = max(LEAST_LOOKAHEAD_M, here.velocity.norm() * LOOKAHEAD_S)
        time_s, ahead = self._point_at(far_m, passed_s)
        if self._is_free is not None and not self._is_free_to(ahead, snapshot):
            time_s, ahead = self._free_point(time_s, passed_s, snapshot)
        self._ahead_s = time_s
        return ahead

    def _point_at(self, far_m: float, passed_s: float) -> tuple[float, Motion]:
        """Returns the time and the motion of the trajectory so far ahead."""
        here = self.trajectory.at(self.time_s)
        limit_s = min(self._stops_s[0], max(self.time_s, self._ahead_s + passed_s))
        time_s, ahead = self.time_s, here
        while time_s < limit_s and (ahead.position - here.position).norm() < far_m:
            time_s = min(limit_s, time_s + _SEARCH_STEP_S)
            ahead = self.trajectory.at(time_s)
        return time_s, ahead

    def _free_point(self, time_s: float, passed_s: float, snapshot: Snapshot) -> tuple[float, Motion]:
        """Returns the farthest point to which the straight way is inside, or a near one once the UAV is there."""
        ahead = self.trajectory.at(time_s)
        while time_s > self.time_s and not self._is_free_to(ahead, snapshot):
            time_s = max(self.time_s, time_s - _SEARCH_STEP_S)
            ahead = self.trajectory.at(time_s)
        is_there = (ahead.position - measured_motion(snapshot).position).norm() < _ARRIVAL_DISTANCE_M
        return self._point_at(LEAST_AT_FENCE_M, passed_s) if is_there else (time_s, ahead)

    def _is_free_to(self, ahead: Motion, snapshot: Snapshot) -> bool:
        assert self._is_free is not None
        return self._is_free(measured_motion(snapshot).position, ahead.position, snapshot)

    @override
    def motion(self, snapshot: Snapshot) -> Motion:
        return measured_motion(snapshot)

    @override
    def pose(self) -> Pose | None:
        return pose_of(self._ahead)
