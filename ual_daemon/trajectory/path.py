"""Paths through many waypoints."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from typing_extensions import override

from ual.errors import InvalidArgumentError
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits, PathHeading
from ual_daemon.trajectory.bend import aim
from ual_daemon.trajectory.facing import Facing, free_m
from ual_daemon.trajectory.heading import Turns, turn_s
from ual_daemon.trajectory.motion import Motion, Trajectory
from ual_daemon.trajectory.pieces import Pieces
from ual_daemon.trajectory.run import CORNER_RADIUS_SHARE, Run
from ual_daemon.trajectory.simplify import kept
from ual_daemon.trajectory.stay import Stay
from ual_daemon.trajectory.straight import StraightTrajectory

_SAME_POINT_M = 1e-6
_LEAST_CUT_M = 1e-3
_SHARPEST_CORNER_COSINE = math.cos(math.radians(170.0))
_LEAST_HORIZONTAL_SHARE = 1e-3
"""A direction with a smaller horizontal part has no azimuth."""
_SAME_TURN_RAD = 0.1


@dataclass(frozen=True, slots=True)
class PathWaypoint:
    """A position to pass, in the local frame, and the heading there (None: keep the one before). With them come the
    speed limit on the leg that ends there (None: only the UAV's), and how long to hold there (0: not at all).
    """

    position: Vector3
    yaw_rad: float | None = None
    max_speed_m_s: float | None = None
    hold_s: float = 0.0


class Chain(Trajectory):
    """A sequence of trajectories, at rest in between."""

    def __init__(self, parts: Sequence[tuple[Trajectory, int, int]]) -> None:
        """Each part comes with the number of its first waypoint, and whether (1 or 0) it ends at a waypoint."""
        self._parts = parts
        self.limits = parts[0][0].limits
        self._starts = [0.0]
        for part, _, _ in parts[:-1]:
            self._starts.append(self._starts[-1] + part.duration_s)
        self.stops_s = list(self._stops())
        self.holds_s = {
            start + at_s: hold_s
            for start, (part, _, _) in zip(self._starts, parts, strict=True)
            for at_s, hold_s in part.holds_s.items()
        }
        self.duration_s = self._starts[-1] + parts[-1][0].duration_s
        self.length_m = math.fsum(part.length_m for part, _, _ in parts)
        after, left = [0.0], 0.0
        for part, _, _ in reversed(parts[1:]):
            left += part.length_m
            after.append(left)
        self._length_after = after[::-1]

    def _stops(self) -> Iterable[float]:
        """Yields the times of the stops: those of a part, and the end of a part that ends at a waypoint."""
        for index, (start, (part, _, is_stop)) in enumerate(zip(self._starts, self._parts, strict=True), start=1):
            yield from (start + at_s for at_s in part.stops_s)
            if is_stop and index < len(self._parts):
                yield self._starts[index]

    @override
    def at(self, time_s: float) -> Motion:
        if time_s >= self.duration_s:
            return self._parts[-1][0].end()  # without the rounding of a difference of times
        index = self._index(time_s)
        return self._parts[index][0].at(time_s - self._starts[index])

    @override
    def bends_s(self) -> Iterable[tuple[float, float]]:
        for start_s, (part, _, _) in zip(self._starts, self._parts, strict=True):
            yield start_s, start_s  # at rest
            for begin_s, end_s in part.bends_s():
                yield start_s + begin_s, start_s + end_s

    @override
    def waypoint_at(self, time_s: float) -> int:
        index = self._index(time_s)
        part, first, _ = self._parts[index]
        return first + part.waypoint_at(time_s - self._starts[index])

    @override
    def length_left_m(self, time_s: float) -> float:
        index = self._index(time_s)
        return self._parts[index][0].length_left_m(time_s - self._starts[index]) + self._length_after[index]

    def _index(self, time_s: float) -> int:
        return max(0, bisect.bisect_right(self._starts, time_s) - 1)


def path(
    start: Motion,
    goals: Sequence[PathWaypoint],
    corner_radius_m: float,
    limits: Limits,
    heading: PathHeading = PathHeading.WAYPOINTS,
    point_of_interest: Vector3 | None = None,
) -> Trajectory:
    """Plans a trajectory from `start` through the waypoints to rest at the last one.

    Corners are rounded: the trajectory leaves a leg at most `corner_radius_m` before the waypoint. It stops at a
    waypoint if the radius is 0, if the corner is (almost) a reversal, if it has to turn there, and to hold. Waypoints
    within a tenth of the radius from a straight line between others (a recorded track) count as points on that line. A
    start in motion bends towards the first waypoint.

    The heading, always within its limits:

    - `WAYPOINTS`: turns from the heading of each waypoint to that of the next one during the leg between them, by the
      smaller angle. A leg that is too short for its turn is flown slower.
    - `FIXED`: stays as it is at the start.
    - `ALONG_PATH`: points along the leg; vertical legs keep the heading before. It turns at rest at the start and at
      stops, and during rounded corners. Legs that are too short for these turns are flown slower.
    - `POINT_OF_INTEREST`: faces the point. From a start with another heading, and very near to the point, it makes
      smooth turns (see `facing`). Requires `point_of_interest`.
    """
    if not goals:
        raise InvalidArgumentError("goals: there are none", {"field": "goals"})
    if heading is PathHeading.POINT_OF_INTEREST and point_of_interest is None:
        raise InvalidArgumentError("point_of_interest: this heading needs one", {"field": "point_of_interest"})
    return _Planner(start, goals, corner_radius_m, limits, heading, point_of_interest).plan()


class _Planner:
    """Cuts a path at its stops, and plans the parts in between."""

    def __init__(
        self,
        start: Motion,
        goals: Sequence[PathWaypoint],
        corner_radius_m: float,
        limits: Limits,
        heading: PathHeading,
        point_of_interest: Vector3 | None,
    ) -> None:
        self._radius_m, self._limits = corner_radius_m, limits
        self._heading, self._point = heading, point_of_interest
        self._start = start
        self._points = [start.position, *(goal.position for goal in goals)]
        self._holds_s = [0.0, *(goal.hold_s for goal in goals)]
        self._fastest = [math.inf if goal.max_speed_m_s is None else goal.max_speed_m_s for goal in goals]
        self._yaws = [start.yaw_rad]
        for goal in goals:
            self._yaws.append(self._yaws[-1] if goal.yaw_rad is None else goal.yaw_rad)

    def plan(self) -> Trajectory:
        points = self._points
        parts: list[tuple[Trajectory, int, int]] = []
        now, first = self._start, 0
        for last in range(1, len(points)):
            if last + 1 < len(points) and self._is_rounded(last):
                continue
            for part in self._between(now, first, last):
                parts.append((part, first, 0))
                now = part.end()
            parts[-1] = (*parts[-1][:2], 1)
            if self._holds_s[last] > 0.0:
                parts.append((Stay(now, self._holds_s[last], self._limits), last - 1, 0))
            first = last
        return parts[0][0] if len(parts) == 1 else Chain(parts)

    def _is_rounded(self, index: int) -> bool:
        if self._holds_s[index] > 0.0:
            return False
        into = self._points[index] - self._points[index - 1]
        out = self._points[index + 1] - self._points[index]
        before_m, after_m = into.norm(), out.norm()
        if min(self._radius_m, before_m / 2, after_m / 2) < _LEAST_CUT_M:
            return False
        return into.dot(out) >= _SHARPEST_CORNER_COSINE * before_m * after_m

    def _between(self, now: Motion, first: int, last: int) -> list[Trajectory]:
        """Plans the part from one stop to the next."""
        if self._heading is PathHeading.POINT_OF_INTEREST:
            if (self._points[last] - now.position).norm() < _SAME_POINT_M and last - first == 1:
                return [StraightTrajectory(now, self._points[last], now.yaw_rad, self._limits)]
            return [self._run(now, first, last)]
        if self._heading is PathHeading.ALONG_PATH and _is_resting(now):
            yaw_rad = _azimuth(self._points[last if last - first == 1 else first + 1] - now.position, now.yaw_rad)
            turned = Motion(now.position, yaw_rad)
            onward: Trajectory = (
                self._run(turned, first, last) if last - first > 1 else self._straight(turned, last, yaw_rad)
            )
            if wrap_angle(yaw_rad - now.yaw_rad) == 0.0:
                return [onward]
            return [StraightTrajectory(now, now.position, yaw_rad, self._limits), onward]
        if last - first > 1:
            return [self._run(now, first, last)]
        if self._heading is PathHeading.WAYPOINTS:
            return [self._straight(now, last, self._yaws[last])]
        if self._heading is PathHeading.FIXED:
            turns = Turns(now, self._limits)
            turns.turn_to(None, 0.0, 0.0)
            return [self._straight(now, last, turns.end_rad)]
        return [self._straight(now, last, _azimuth(self._points[last] - now.position, now.yaw_rad))]

    def _straight(self, now: Motion, last: int, yaw_rad: float) -> StraightTrajectory:
        return StraightTrajectory(now, self._points[last], yaw_rad, self._limits, self._fastest[last - 1])

    def _run(self, now: Motion, first: int, last: int) -> Run:
        """Plans the legs from waypoint `first` to `last`, without a stop."""
        limits = self._limits
        bend = Pieces(now.position, now.velocity, now.acceleration)
        if not _is_resting(now):
            bend, _, _ = aim(now, self._points[first + 1], limits, self._fastest[first])
        # The bend ends towards the first waypoint, so this waypoint must not be left out.
        numbers = self._kept(first, last) if _is_resting(now) else [first, *self._kept(first + 1, last)]
        points = [bend.position, *(self._points[number] for number in numbers[1:])]
        if (points[1] - points[0]).norm() < _SAME_POINT_M:  # the bend ends at rest at the first waypoint
            del points[0], numbers[0]
        fastest = [self._fastest[number - 1] for number in numbers[1:]]
        yaws = [self._yaws[number] for number in numbers]
        azimuths = _azimuths(points, now.yaw_rad)
        # Only a leg between neighbours must be left within the radius from its ends.
        reach = [self._radius_m if there == here + 1 else math.inf for here, there in itertools.pairwise(numbers)]
        run = Run(bend, points, fastest, self._least_s(yaws, azimuths), reach, self._radius_m, limits)
        run.passes_s = self._passes(run, first, numbers)
        self._turn(run, now, yaws, azimuths)
        return run

    def _kept(self, first: int, last: int) -> list[int]:
        """Returns the waypoints, from one to another, that are not just points on a straight line between others."""
        yaws = _unwrapped(self._yaws[first : last + 1]) if self._heading is PathHeading.WAYPOINTS else None
        within_m = self._radius_m * CORNER_RADIUS_SHARE
        numbers = kept(self._points[first : last + 1], self._fastest[first:last], yaws, within_m, _SAME_TURN_RAD)
        return [first + number for number in numbers]

    def _passes(self, run: Run, first: int, numbers: Sequence[int]) -> list[float]:
        """Returns the times at which the waypoints after `first` are passed."""
        passes: list[float] = [run.bend_s] if numbers[0] > first else []
        ends_s = [*run.corners_s, run.motion_s]
        for index, (here, there) in enumerate(itertools.pairwise(numbers)):
            begin, direction = self._points[here], self._points[there] - self._points[here]
            shares = [
                (point - begin).dot(direction) / direction.dot(direction) for point in self._points[here + 1 : there]
            ]
            passes += [*(run.when(index, share) for share in shares), ends_s[index]]
        return passes

    def _least_s(self, yaws: Sequence[float], azimuths: Sequence[float]) -> list[float]:
        """Returns how long each leg must at least take, so that the heading can turn in that time."""
        if self._heading is PathHeading.WAYPOINTS:
            return [turn_s(wrap_angle(b - a), self._limits) for a, b in itertools.pairwise(yaws)]
        if self._heading is PathHeading.ALONG_PATH:
            turns = [turn_s(wrap_angle(b - a), self._limits) for a, b in itertools.pairwise(azimuths)]
            return [(a + b) / 2 for a, b in zip([0.0, *turns], [*turns, 0.0], strict=True)]
        return [0.0] * len(azimuths)

    def _turn(self, run: Run, now: Motion, yaws: Sequence[float], azimuths: Sequence[float]) -> None:
        if self._heading is PathHeading.POINT_OF_INTEREST:
            assert self._point is not None
            far_m = free_m(self._limits.horizontal_speed_m_s, self._limits)
            is_far = run.bend_s == 0.0 and run.distance_m(self._point) > far_m
            facing = Facing(now, self._point, run.body, run.motion_s, self._limits, is_far=is_far)
            end_rad, _, _ = facing.at(facing.end_s, *run.body(facing.end_s))
            run.turn(facing, end_rad)
            return
        turns = Turns(now, self._limits)
        if self._heading is PathHeading.WAYPOINTS:
            begin_s = 0.0
            for yaw_rad, end_s in zip(yaws[1:], [*run.corners_s, run.motion_s], strict=True):
                turns.turn_to(yaw_rad, begin_s, end_s)
                begin_s = end_s
        elif self._heading is PathHeading.FIXED:
            turns.turn_to(None, 0.0, 0.0)
        else:
            turns.turn_to(azimuths[0], 0.0, run.bend_s)
            for middle_s, leg, yaw_rad in zip(run.corners_s, run.legs, azimuths[1:], strict=False):
                half_s = max(leg.corner.duration_s, turn_s(wrap_angle(yaw_rad - turns.end_rad), self._limits)) / 2
                turns.turn_to(yaw_rad, middle_s - half_s, middle_s + half_s)
        run.turn(turns, wrap_angle(turns.end_rad))


def _is_resting(motion: Motion) -> bool:
    return motion.velocity == motion.acceleration == Vector3()


def _azimuth(direction: Vector3, otherwise_rad: float) -> float:
    if direction.horizontal_norm() <= _LEAST_HORIZONTAL_SHARE * direction.norm():
        return otherwise_rad
    return math.atan2(direction.y, direction.x)


def _azimuths(points: Sequence[Vector3], before_rad: float) -> list[float]:
    """Returns the azimuth of each leg; a vertical leg has the azimuth of the leg before."""
    found = []
    for begin, end in itertools.pairwise(points):
        before_rad = _azimuth(end - begin, before_rad)
        found.append(before_rad)
    return found


def _unwrapped(yaws: Sequence[float]) -> list[float]:
    result = [yaws[0]]
    for yaw in yaws[1:]:
        result.append(result[-1] + wrap_angle(yaw - result[-1]))
    return result
