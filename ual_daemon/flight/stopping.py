"""Start of the next motion, and a stop of the UAV, given the reference that it follows now."""

from __future__ import annotations

import logging
from itertools import islice

from ual.errors import WrongStateError
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import (
    Hold,
    Reference,
    StopOnTrajectory,
    TrajectoryReference,
    brake,
    measured_motion,
)
from ual_daemon.trajectory import Motion, Trajectory

_log = logging.getLogger(__name__)

_NEAR_REFERENCE_M = 1.0
_NEAR_REFERENCE_S = 0.5
_CHECKED_POINTS_COUNT = 60
"""Points of a trajectory that are checked: farther ahead than it takes to stop."""


def next_start(current: Reference | None, snapshot: Snapshot) -> Motion:
    """Returns the motion in which the next trajectory begins.

    This is the motion of the current reference, so that references do not jump. If the UAV is far from the reference,
    or follows none, it is the measured motion.
    """
    return motion_if_near(current, snapshot) or measured_motion(snapshot)


def motion_if_near(reference: Reference | None, snapshot: Snapshot) -> Motion | None:
    """Returns the motion of a reference; None if there is no reference, or if the UAV is far from it."""
    if reference is None:
        return None
    motion = reference.motion(snapshot)
    near_m = _NEAR_REFERENCE_M + _NEAR_REFERENCE_S * motion.velocity.norm()  # the UAV may lag behind a fast reference
    return motion if (motion.position - measured_motion(snapshot).position).norm() <= near_m else None


class Stopping:
    """Stops of one UAV within its limits and its geofence."""

    def __init__(self, limits: CurrentLimits, geofence: GeofencePolicy) -> None:
        self._limits = limits
        self._geofence = geofence

    def stop(self, current: Reference | None, snapshot: Snapshot) -> Reference:
        """Returns the reference that brings the UAV to rest.

        It begins with the motion of the current reference, except where that is only a pose. The UAV may be anywhere on
        its way there, so it then begins with the measured motion. It brakes straight ahead, or along the current
        trajectory, or at the current pose, where only straight ahead would leave the geofence. A stop may follow
        another one. Where nothing else is known, it holds where it is then: an autopilot brakes for that as hard as it
        can. So it does where the current reference has a defect.
        """
        try:
            return self._stop(current, snapshot)
        except Exception:
            if current is None:
                raise
            _log.exception("a reference failed as it was to stop; this is a defect of UAL, please report it")
            return self._stop(None, snapshot)

    def stop_after_jump(self, current: Reference | None, jump: EstimateJump, snapshot: Snapshot) -> Reference:
        """Returns the same as `stop_here`, after the estimate has jumped."""
        if isinstance(current, StopOnTrajectory):
            current = current.followed
        if isinstance(current, TrajectoryReference):
            current.move(jump.offset, jump.yaw_rad)
        return self.stop_here(current, snapshot)

    def stop_here(self, current: Reference | None, snapshot: Snapshot) -> Reference:
        """Returns the stop from the motion that the UAV has; one that makes no way must not be led on. Where straight
        ahead would leave the geofence, it is the stop along the trajectory.
        """
        here = self.stop(None, snapshot)
        if isinstance(here, Hold) and isinstance(along := self.stop(current, snapshot), StopOnTrajectory):
            return along
        return here

    def _stop(self, current: Reference | None, snapshot: Snapshot) -> Reference:
        if isinstance(current, StopOnTrajectory):
            current = current.followed
        start = None if isinstance(current, Hold) else motion_if_near(current, snapshot)
        if (
            start is not None
            and isinstance(current, TrajectoryReference)
            and self._straight_stop(start, snapshot) is None
            and not self._leads_out(current, start, snapshot)
        ):
            return StopOnTrajectory(current, self._straight_stop)
        start_s = None if start is None or current is None else current.motion_time_s(snapshot)
        stop = brake(snapshot, self._limits.stop(), start, start_s)
        if not self._leaves_geofence(stop.trajectory, snapshot):
            return stop
        if isinstance(current, Hold) and self._rests_sooner(current, stop, snapshot):
            return current
        here = measured_motion(snapshot)
        return Hold(here.position, here.yaw_rad)

    def _rests_sooner(self, hold: Hold, stop: TrajectoryReference, snapshot: Snapshot) -> bool:
        """Returns whether the UAV rests sooner at a pose inside the geofence than straight ahead, outside of it.

        An autopilot approaches a pose with more deceleration than UAL may use.
        """
        here = measured_motion(snapshot).position
        is_near = (hold.position - here).norm() < stop.trajectory.length_m
        return is_near and self._geofence.fence(snapshot).exit((here, hold.position)) is None

    def _straight_stop(self, start: Motion, snapshot: Snapshot) -> TrajectoryReference | None:
        """Returns the reference that brakes straight ahead from a motion; None if it would leave the geofence."""
        stop = brake(snapshot, self._limits.stop(), start)
        return None if self._leaves_geofence(stop.trajectory, snapshot) else stop

    def _leads_out(self, current: TrajectoryReference, start: Motion, snapshot: Snapshot) -> bool:
        """Returns whether the trajectory that is followed soon leaves the geofence, too, which may be a new one."""
        trajectory, limits = current.trajectory, self._limits.get()
        points = self._geofence.outline(trajectory, current.time_s, start.position, limits, snapshot)
        fence = self._geofence.fence(snapshot)
        return fence.is_inside(start.position) and fence.exit(islice(points, _CHECKED_POINTS_COUNT)) is not None

    def _leaves_geofence(self, trajectory: Trajectory, snapshot: Snapshot) -> bool:
        """Returns whether a trajectory leaves the geofence; no if it is not known where the geofence lies."""
        try:
            return self._geofence.is_left_by(trajectory, self._limits.get(), snapshot)
        except WrongStateError:
            return False
