"""References that follow a goal in a frame that moves."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.flight import Flight
from ual_daemon.frames.resolver import FrameResolver, Goal
from ual_daemon.tracker.moving_goal import MovingGoal
from ual_daemon.trajectory import Motion


def moving_goal(
    flight: Flight,
    resolver: FrameResolver,
    goal: Goal,
    bounds: Limits,
    snapshot: Snapshot,
    max_speed_m_s: float | None = None,
) -> MovingGoal:
    """Returns what follows a goal from the motion that is flown now, within the geofence."""
    start, geofence = flight.start(snapshot), flight.geofence

    def admit(way: Sequence[Vector3], now: Snapshot) -> None:
        if geofence is not None:
            geofence.require_inside(way, "the goal in the moving frame", now)

    def where(now_s: float) -> Motion:
        return resolver.moving_to_local(goal, now_s, start.yaw_rad)

    return MovingGoal(where, start, snapshot.time_s, bounds, admit, max_speed_m_s or math.inf)
