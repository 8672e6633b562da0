"""Several legs without a stop, with rounded corners."""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from typing_extensions import override

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.trajectory.envelope import acceleration_limit, speed_limit
from ual_daemon.trajectory.heading import HeadingPlan
from ual_daemon.trajectory.leg import Leg
from ual_daemon.trajectory.motion import Motion, Trajectory
from ual_daemon.trajectory.pieces import Pieces
from ual_daemon.trajectory.pulse import Pulse, change_m, change_s, fastest_change_m_s, largest, peak_m_s

_BEND_NORM = 1e-9
CORNER_RADIUS_SHARE = 0.1
"""A point that is this near to a leg, as a share of the corner radius, counts as on the leg."""


@dataclass(frozen=True, slots=True)
class _Corner:
    """Corner between two legs: the change of direction (a difference of unit vectors), and the largest acceleration."""

    change: float
    acceleration_m_s2: float

    def duration_s(self, speed_m_s: float) -> float:
        """Returns the duration at a speed."""
        return change_s(self.change * speed_m_s, self.acceleration_m_s2) if self.change > _BEND_NORM else 0.0

    def cut_m(self, speed_m_s: float) -> float:
        """Returns the distance from the corner at which it leaves the leg, and joins the next one."""
        return speed_m_s * self.duration_s(speed_m_s) / 2

    def close_m(self, corner_radius_m: float) -> float:
        """Returns the distance from the corner at which it may leave the leg to stay close to both legs. It passes the
        corner at a quarter of this distance times the change of direction, at most.
        """
        return 4 * CORNER_RADIUS_SHARE * corner_radius_m / self.change if self.change > _BEND_NORM else math.inf

    def fastest_m_s(self, cut_m: float) -> float:
        """Returns the speed at which it leaves the leg at a distance from the corner."""
        if self.change <= _BEND_NORM:
            return math.inf
        return fastest_change_m_s(cut_m * self.change, self.acceleration_m_s2) / self.change


class Run(Trajectory):
    """A motion from rest, or from a bend in motion, along straight legs with rounded corners to rest.

    Speed and acceleration are continuous everywhere. The speed changes on the legs, between corners; a corner changes
    the direction at constant speed. So each part keeps the limits by itself. The speeds at the corners are the largest
    ones that a backward and a forward pass over the legs allow.
    """

    def __init__(
        self,
        bend: Pieces,
        points: Sequence[Vector3],
        fastest_m_s: Sequence[float],
        least_s: Sequence[float],
        range_m: Sequence[float],
        corner_radius_m: float,
        limits: Limits,
    ) -> None:
        """`points` begin where the bend ends; the bend must end towards the second point, or at rest. For each leg,
        `fastest_m_s` is its speed limit (infinity: none of its own), `least_s` its shortest duration, and `range_m` how
        far from its ends it may be left. If that is more than the radius, the corner must stay within
        `CORNER_RADIUS_SHARE` of the radius from the legs.
        """
        self.limits = limits
        self._bend = bend
        self._points = points
        self._make_legs(fastest_m_s, least_s, range_m, corner_radius_m, limits)
        self.bend_s = bend.duration_s
        self._times = [self.bend_s]
        for leg in self.legs:
            self._times.append(self._times[-1] + leg.duration_s)
        self.motion_s = self._times.pop()
        self.duration_s = self.motion_s
        self._bend_m = (bend.position - bend.at(0.0)[0]).norm()
        self.length_m = self._bend_m + self._left_m[0]
        self.passes_s: Sequence[float] = [*self.corners_s, self.motion_s]
        """Returns the times at which the waypoints are passed."""
        self._heading: HeadingPlan | None = None
        self._end: Motion | None = None

    def _make_legs(
        self,
        fastest_m_s: Sequence[float],
        least_s: Sequence[float],
        range_m: Sequence[float],
        corner_radius_m: float,
        limits: Limits,
    ) -> None:
        points = self._points
        sides = [b - a for a, b in itertools.pairwise(points)]
        lengths = [side.norm() for side in sides]
        directions = [side / length for side, length in zip(sides, lengths, strict=True)]
        accelerations = [acceleration_limit(direction, limits) for direction in directions]
        caps = [
            min(speed_limit(direction, limits), fastest, length / least if least > 0.0 else math.inf)
            for direction, fastest, length, least in zip(directions, fastest_m_s, lengths, least_s, strict=True)
        ]
        corners = [_NO_CORNER, *(_corner(a, b, limits) for a, b in itertools.pairwise(directions)), _NO_CORNER]
        speeds = [self._bend.velocity.norm()]
        for i in range(1, len(corners) - 1):
            cut_m = min(range_m[i - 1], range_m[i], max(corner_radius_m, corners[i].close_m(corner_radius_m)))
            cut_m = min(cut_m, lengths[i - 1] / 2, lengths[i] / 2)
            speeds.append(min(caps[i - 1], caps[i], corners[i].fastest_m_s(cut_m)))
        speeds.append(0.0)
        _pass(speeds, lengths, accelerations, corners)
        self.legs: list[Leg] = []
        self.corners_s: list[float] = []
        """Returns the times at which the middles of the corners are reached."""
        self._left_m = list(itertools.accumulate(reversed(lengths), initial=0.0))[::-1]
        self._cuts_m: list[float] = []
        begin, time_s = points[0], self._bend.duration_s
        for i, direction in enumerate(directions):
            before, after = speeds[i], speeds[i + 1]
            cut_m, next_cut_m = corners[i].cut_m(before) if i else 0.0, corners[i + 1].cut_m(after)
            self._cuts_m.append(cut_m)
            path_m = lengths[i] - cut_m - next_cut_m
            peak = peak_m_s(before, after, path_m, max(caps[i], after), accelerations[i])
            last = i + 1 == len(directions)
            corner = Pulse() if last else _pulse(corners[i + 1], after)
            onward = direction if last else directions[i + 1]
            leg = Leg.along(begin, direction, path_m, (before, peak, after), accelerations[i], corner, onward)
            self.legs.append(leg)
            time_s += leg.duration_s
            if not last:
                self.corners_s.append(time_s - corner.duration_s / 2)
                begin = points[i + 1] + onward * next_cut_m

    def turn(self, heading: HeadingPlan, end_rad: float) -> None:
        """Sets the heading, which ends at rest at `end_rad`."""
        self._heading = heading
        self.duration_s = max(self.motion_s, heading.end_s)
        self._end = Motion(self._points[-1], end_rad)

    def body(self, time_s: float) -> tuple[Vector3, Vector3, Vector3]:
        """Returns position, velocity and acceleration at a time."""
        if time_s >= self.motion_s:
            return self._points[-1], Vector3(), Vector3()
        if time_s < self.bend_s:
            return self._bend.at(time_s)
        index = self._index(time_s)
        return self.legs[index].at(max(0.0, time_s - self._times[index]))

    @override
    def at(self, time_s: float) -> Motion:
        assert self._heading is not None
        assert self._end is not None
        if time_s >= self.duration_s:
            return self._end
        time_s = max(0.0, time_s)
        position, velocity, acceleration = self.body(time_s)
        yaw, yaw_rate, yaw_acceleration = self._heading.at(time_s, position, velocity, acceleration)
        return Motion(position, yaw, velocity, acceleration, yaw_rate, yaw_acceleration)

    @override
    def bends_s(self) -> Iterable[tuple[float, float]]:
        yield 0.0, self.bend_s
        for begin_s, leg in zip(self._times[:-1], self.legs[:-1], strict=True):
            yield begin_s + leg.straight_s, begin_s + leg.duration_s

    def distance_m(self, point: Vector3) -> float:
        """Returns a lower bound of the horizontal distance between its legs and corners and a point."""
        cuts_m = [*self._cuts_m[1:], 0.0]
        return min(
            _horizontal_distance_m(point, begin, end) - cut_m
            for (begin, end), cut_m in zip(itertools.pairwise(self._points), cuts_m, strict=True)
        )

    def when(self, index: int, share: float) -> float:
        """Returns about when a share of a leg (from corner to corner) is flown, as if by one change of speed."""
        leg, begin_s = self.legs[index], self._times[index]
        straight_s = leg.up.duration_s, leg.cruise_s, leg.down.duration_s
        marks_s = [begin_s, *(begin_s + passed_s for passed_s in itertools.accumulate(straight_s))]
        marks_m = [self._cuts_m[index] + leg.along_m(mark_s - begin_s) for mark_s in marks_s]
        passed_m = share * (self._left_m[index] - self._left_m[index + 1])
        after = bisect.bisect_left(marks_m, passed_m)
        if after in (0, len(marks_m)):
            return marks_s[min(after, len(marks_s) - 1)]
        before_m, after_m = marks_m[after - 1], marks_m[after]
        part = (passed_m - before_m) / (after_m - before_m)
        return marks_s[after - 1] + part * (marks_s[after] - marks_s[after - 1])

    def _index(self, time_s: float) -> int:
        return max(0, bisect.bisect_right(self._times, time_s) - 1)

    @override
    def waypoint_at(self, time_s: float) -> int:
        return min(bisect.bisect_right(self.passes_s, time_s), len(self.passes_s) - 1)

    @override
    def length_left_m(self, time_s: float) -> float:
        if time_s >= self.motion_s:
            return 0.0
        if time_s < self.bend_s:
            return self._left_m[0] + self._bend_m * (1.0 - max(0.0, time_s) / self.bend_s)
        index = self._index(time_s)
        leg, t = self.legs[index], time_s - self._times[index]
        passed_m = self._cuts_m[index] + leg.along_m(t) + max(0.0, t - leg.straight_s) * leg.after_m_s
        return max(0.0, self._left_m[index] - passed_m)


def _horizontal_distance_m(point: Vector3, begin: Vector3, end: Vector3) -> float:
    px, py = point.x - begin.x, point.y - begin.y
    dx, dy = end.x - begin.x, end.y - begin.y
    square = dx * dx + dy * dy
    along = max(0.0, min(1.0, (px * dx + py * dy) / square)) if square > 0.0 else 0.0
    return math.hypot(px - along * dx, py - along * dy)


_NO_CORNER = _Corner(0.0, 1.0)


def _corner(before: Vector3, after: Vector3, limits: Limits) -> _Corner:
    change = after - before
    size = change.norm()
    return _Corner(size, acceleration_limit(change / size, limits)) if size > _BEND_NORM else _NO_CORNER


def _pulse(corner: _Corner, speed_m_s: float) -> Pulse:
    if corner.change <= _BEND_NORM:
        return Pulse()
    return Pulse.shortest(corner.change * speed_m_s, corner.acceleration_m_s2)


def _pass(
    speeds: list[float], lengths: Sequence[float], accelerations: Sequence[float], corners: Sequence[_Corner]
) -> None:
    """Reduces the speeds at the corners until each leg is long enough for its change of speed."""
    legs = range(len(lengths))
    for i in reversed(legs[1:]):
        if speeds[i] > speeds[i + 1]:
            room_m = lengths[i] - corners[i + 1].cut_m(speeds[i + 1])
            speeds[i] = _fitting_m_s(speeds[i + 1], speeds[i], room_m, accelerations[i], corners[i])
    if speeds[1] < speeds[0]:
        # From the speed at the start it can stop within the first leg. So there is a possible speed at the first
        # corner.
        shares = (share / 64 for share in range(64, -1, -1))
        speeds[1] = next(
            speed
            for speed in (speeds[1] * share for share in shares)
            if speed == 0.0 or corners[1].cut_m(speed) + change_m(speeds[0], speed, accelerations[0]) <= lengths[0]
        )
    for i in legs:
        if speeds[i + 1] > speeds[i]:
            room_m = lengths[i] - (corners[i].cut_m(speeds[i]) if i else 0.0)
            speeds[i + 1] = _fitting_m_s(speeds[i], speeds[i + 1], room_m, accelerations[i], corners[i + 1])


def _fitting_m_s(lower: float, higher: float, room_m: float, acceleration: float, corner: _Corner) -> float:
    """Returns the larger speed of a leg's two ends: the largest one that, with its corner, fits into the length."""

    def spare_m(speed: float) -> float:
        return room_m - corner.cut_m(speed) - change_m(lower, speed, acceleration)

    return higher if spare_m(higher) >= 0.0 else largest(spare_m, lower, higher)
