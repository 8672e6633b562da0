"""References to a goal in a frame that moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ual.errors import TaskAbortedError
from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.frames.resolver import FrameResolver, Goal
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.trajectory import Motion, PathWaypoint
from ual_daemon.vehicle.distance_limit import DistanceLimit

_WHAT = "the goal in the moving frame"


def moving_goal(
    flight: Flight,
    resolver: FrameResolver,
    distance_limit: DistanceLimit,
    goal: Goal,
    bounds: Callable[[], Limits],
    snapshot: Snapshot,
    max_speed_m_s: float | None = None,
) -> MovingGoal:
    """Returns the reference that follows a goal within the geofence and the reach. It begins with the present motion.

    `bounds` returns the limits to keep now.
    """
    start, start_s, geofence = flight.start(snapshot), flight.start_time_s(snapshot), flight.geofence

    def admit(polyline: Sequence[Vector3], now: Snapshot) -> None:
        if flight.position.waits:
            raise TaskAbortedError(f"{_WHAT} is not followed: {flight.position.waits}", {"by": "estimator"})
        geofence.require_inside(polyline, _WHAT, now)
        distance_limit.require_goal(_WHAT, goal, PathWaypoint(polyline[-1]), now)

    def goal_motion(now_s: float) -> Motion:
        return resolver.moving_to_local(goal, now_s, start.yaw_rad)

    return MovingGoal(goal_motion, start, start_s, bounds, admit, max_speed_m_s or math.inf)
