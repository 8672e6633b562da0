"""A trajectory as a line of points, for drawing."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from ual.geometry import Vector3
from ual_daemon.trajectory.motion import Trajectory
from ual_daemon.trajectory.simplify import kept

MOST_POINTS = 2_000
_SAMPLE_PERIOD_S = 0.2
"""On a bend. A chord of this time is off the way by an eighth of its square times the acceleration. That is 0.05 m at
10 m/s^2, and as much as `_LINE_TOLERANCE_M` again when points on a straight line are left out."""
_LINE_TOLERANCE_M = 0.05
_SAME_POINT_M = 1e-6


def outline(trajectory: Trajectory) -> list[Vector3]:
    """Returns points on a trajectory, in order, with its start and its end; at most `MOST_POINTS` and one.

    The lines between them are within 0.1 m of the way, unless that would need more points.
    """
    times_s = list(_times_s(trajectory))
    every = -(-len(times_s) // MOST_POINTS)
    points = [trajectory.at(time_s).position for time_s in times_s[::every]]
    points.append(trajectory.end().position)
    points = [points[0], *(point for before, point in pairwise(points) if (point - before).norm() > _SAME_POINT_M)]
    return [points[number] for number in kept(points, [0.0] * len(points), None, _LINE_TOLERANCE_M, 0.0)]


def _times_s(trajectory: Trajectory) -> Iterator[float]:
    """Yields times in order: the start, and those at which a bend begins, and goes on, and ends."""
    spans = list(trajectory.bends_s())
    period_s = max(_SAMPLE_PERIOD_S, sum(end_s - begin_s for begin_s, end_s in spans) / MOST_POINTS)
    yield 0.0
    for begin_s, end_s in spans:
        count = int((end_s - begin_s) / period_s) + 1
        yield from (begin_s + (end_s - begin_s) * number / count for number in range(count + 1))
