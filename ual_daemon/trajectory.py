"""Smooth references in time: straight lines, rounded paths and braking, within limits. Pure mathematics.

Jerk-limited, time-optimal and synchronized motion comes from Ruckig (Berscheid & Kroeger, "Jerk-limited Real-time
Trajectory Generation with Arbitrary Target States", RSS 2021).
"""

from __future__ import annotations

import bisect
import itertools
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import ruckig

from ual.errors import UalError
from ual.geometry import Vector3, wrap_angle
from ual.types import Limits

_RAMP_S = 0.4
"""How long the acceleration takes to its limit; sets the jerk limit. PX4's default (MPC_JERK_AUTO 4 m/s^3 for
MPC_ACC_HOR 3 m/s^2) is 0.75; a multirotor tilts to its limit within 0.3 s."""
_TURN_RAMP_S = 0.5
"""How long a turn takes to its full rate."""
_SAME_PLACE_M = 1e-6
_TURN_SHARE = 0.9
"""How much of the acceleration a corner may take for the turn: the rest lets it speed up and slow down on arcs, too."""
_SHARPEST_ROUNDED_CORNER_RAD = math.radians(170.0)


@dataclass(frozen=True, slots=True)
class Motion:
    """A moment of a reference in the local frame: where, how fast, and heading."""

    position: Vector3
    yaw_rad: float
    velocity: Vector3 = field(default_factory=Vector3)
    acceleration: Vector3 = field(default_factory=Vector3)
    yaw_rate_rad_s: float = 0.0


class Trajectory(ABC):
    """A reference from its start (0) to its end (`duration_s`), where it stands still."""

    duration_s: float
    length_m: float
    stops_s: Sequence[float] = ()
    """When it stands still at a waypoint on the way."""

    @abstractmethod
    def at(self, time_s: float) -> Motion:
        """The reference at a time; before the start and after the end, that at the start and the end."""

    def end(self) -> Motion:
        """Where it ends."""
        return self.at(self.duration_s)

    def waypoint_at(self, time_s: float) -> int:
        """The number of the waypoint it is flying to at a time."""
        del time_s
        return 0

    def length_left_m(self, time_s: float) -> float:
        """The way left at a time."""
        return (self.end().position - self.at(time_s).position).norm()


def speed_limit(direction: Vector3, limits: Limits) -> float:
    """The largest speed along a unit vector that keeps both the horizontal and the vertical limit."""
    vertical = limits.climb_speed_m_s if direction.z > 0 else limits.descent_speed_m_s
    return _along(direction, limits.horizontal_speed_m_s, vertical)


def acceleration_limit(direction: Vector3, limits: Limits) -> float:
    """The largest acceleration along a unit vector; see `speed_limit`."""
    return _along(direction, limits.horizontal_acceleration_m_s2, limits.vertical_acceleration_m_s2)


def _along(direction: Vector3, horizontal: float, vertical: float) -> float:
    h, v = direction.horizontal_norm(), abs(direction.z)
    return min(horizontal / h if h > 1e-9 else math.inf, vertical / v if v > 1e-9 else math.inf)


class Line(Trajectory):
    """A straight line to a goal, heading in step, time-optimal and jerk-limited.

    Where it starts in motion across the line, that motion dies out on the way (perpendicular axes of the same
    synchronized problem): from rest the line is exactly straight.
    """

    def __init__(self, start: Motion, goal: Vector3, goal_yaw_rad: float, limits: Limits) -> None:
        way = goal - start.position
        self.length_m = way.norm()
        self._origin = start.position
        self._yaw_rad = start.yaw_rad
        self._axes = _axes_along(way if self.length_m > _SAME_PLACE_M else start.velocity)
        turn = wrap_angle(goal_yaw_rad - start.yaw_rad)
        accelerations = [acceleration_limit(axis, limits) for axis in self._axes]
        self._solution = _Solution(
            _Problem(
                velocity=[*self._split(start.velocity), start.yaw_rate_rad_s],
                acceleration=[*self._split(start.acceleration), 0.0],
                max_velocity=[
                    speed_limit(self._axes[0], limits),
                    *(_both_ways(axis, limits) for axis in self._axes[1:]),
                    limits.yaw_rate_rad_s,
                ],
                max_acceleration=[*accelerations, _turn_acceleration(limits)],
                max_jerk=[*(a / _RAMP_S for a in accelerations), _turn_jerk(limits)],
                target_position=[*self._split(way), turn],
            )
        )
        self.duration_s = self._solution.duration_s
        self._goal = goal

    def at(self, time_s: float) -> Motion:
        if time_s >= self.duration_s:
            # Exactly the goal, not the sum of many roundings.
            yaw = self._yaw_rad + self._solution.at(self.duration_s)[0][3]
            return Motion(self._goal, wrap_angle(yaw))
        p, v, a = self._solution.at(time_s)
        return Motion(
            self._origin + self._join(p), wrap_angle(self._yaw_rad + p[3]), self._join(v), self._join(a), v[3]
        )

    def _split(self, v: Vector3) -> list[float]:
        return [v.dot(axis) for axis in self._axes]

    def _join(self, components: Sequence[float]) -> Vector3:
        e1, e2, e3 = self._axes
        return e1 * components[0] + e2 * components[1] + e3 * components[2]


class Brake(Trajectory):
    """From motion to rest along the direction of motion, within the limits."""

    def __init__(self, start: Motion, limits: Limits) -> None:
        speed = start.velocity.norm()
        self._start = start
        self._direction = start.velocity / speed if speed > 1e-9 else Vector3(1.0, 0.0, 0.0)
        acceleration = acceleration_limit(self._direction, limits)
        self._solution = _Solution(
            _Problem(
                velocity=[speed, start.yaw_rate_rad_s],
                acceleration=[0.0, 0.0],
                max_velocity=[max(speed, 1.0), max(abs(start.yaw_rate_rad_s), 1.0)],
                max_acceleration=[acceleration, _turn_acceleration(limits)],
                max_jerk=[acceleration / _RAMP_S, _turn_jerk(limits)],
            )
        )
        self.duration_s = self._solution.duration_s
        self.length_m = self._solution.at(self.duration_s)[0][0]

    def at(self, time_s: float) -> Motion:
        p, v, a = self._solution.at(time_s)
        if time_s >= self.duration_s:
            v = a = [0.0, 0.0]
        return Motion(
            self._start.position + self._direction * p[0],
            wrap_angle(self._start.yaw_rad + p[1]),
            self._direction * v[0],
            self._direction * a[0],
            v[1],
        )


class Chain(Trajectory):
    """One trajectory after the other, standing still in between."""

    def __init__(self, parts: Sequence[tuple[Trajectory, int]]) -> None:
        """`parts` come with the number of the first waypoint of each."""
        self._parts = parts
        self._starts = [0.0]
        for part, _ in parts[:-1]:
            self._starts.append(self._starts[-1] + part.duration_s)
        self.stops_s = self._starts[1:]
        self.duration_s = self._starts[-1] + parts[-1][0].duration_s
        self.length_m = math.fsum(part.length_m for part, _ in parts)
        self._length_after = [0.0]
        for part, _ in reversed(parts[1:]):
            self._length_after.insert(0, self._length_after[0] + part.length_m)

    def at(self, time_s: float) -> Motion:
        if time_s >= self.duration_s:
            return self._parts[-1][0].end()  # exactly, not by a difference of times
        index = self._index(time_s)
        return self._parts[index][0].at(time_s - self._starts[index])

    def waypoint_at(self, time_s: float) -> int:
        index = self._index(time_s)
        part, first = self._parts[index]
        return first + part.waypoint_at(time_s - self._starts[index])

    def length_left_m(self, time_s: float) -> float:
        index = self._index(time_s)
        return self._parts[index][0].length_left_m(time_s - self._starts[index]) + self._length_after[index]

    def _index(self, time_s: float) -> int:
        return max(0, bisect.bisect_right(self._starts, time_s) - 1)


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A place to pass, in the local frame, and the heading there (None: the one before)."""

    position: Vector3
    yaw_rad: float | None = None


@dataclass(frozen=True, slots=True)
class _Corner:
    """A rounded corner: an arc that leaves and rejoins the legs `cut_m` from the corner, turning by `turn_rad`."""

    cut_m: float
    turn_rad: float
    radius_m: float

    @property
    def length_m(self) -> float:
        """The length of the arc."""
        return self.radius_m * self.turn_rad if self.turn_rad else 0.0


class RoundedRun(Trajectory):
    """Two or more legs whose corners are rounded by arcs, from rest to rest without a stop.

    Each straight and each arc keeps the limits of speed, acceleration and yaw rate; on an arc, what the turn leaves of
    the acceleration is for speeding up and slowing down. A forward and a backward pass join them. The heading turns
    smoothly (cubic) along each leg.
    """

    def __init__(
        self, points: Sequence[Vector3], yaws_rad: Sequence[float], corners: Sequence[_Corner], limits: Limits
    ) -> None:
        self._points, self._yaws, self._corners = points, yaws_rad, corners
        legs = [b - a for a, b in itertools.pairwise(points)]
        self._directions = [leg / leg.norm() for leg in legs]
        cuts = [0.0, *(corner.cut_m for corner in corners), 0.0]
        # Boundaries along the path: straight 0, arc 0, straight 1, arc 1, ..., straight n.
        self._bounds = [0.0]
        for index, leg in enumerate(legs):
            straight = max(0.0, leg.norm() - cuts[index] - cuts[index + 1])
            self._bounds.append(self._bounds[-1] + straight)
            if index < len(corners):
                self._bounds.append(self._bounds[-1] + corners[index].length_m)
        self.length_m = self._bounds[-1]
        # Leg i, for the heading, ends in the middle of the arc behind it.
        self._leg_ends = [
            *((self._bounds[2 * i + 1] + self._bounds[2 * i + 2]) / 2 for i in range(len(corners))),
            self.length_m,
        ]
        self._make_profile(limits)

    def _make_profile(self, limits: Limits) -> None:
        pieces = len(self._bounds) - 1
        caps, accelerations = zip(*(self._limits_on(index, limits) for index in range(pieces)), strict=True)
        gains = [2 * a * (e - b) for a, (b, e) in zip(accelerations, itertools.pairwise(self._bounds), strict=True)]
        speeds = [0.0, *(min(pair) for pair in itertools.pairwise(caps)), 0.0]
        for i in range(1, pieces + 1):
            speeds[i] = min(speeds[i], math.sqrt(speeds[i - 1] ** 2 + gains[i - 1]))
        for i in range(pieces - 1, -1, -1):
            speeds[i] = min(speeds[i], math.sqrt(speeds[i + 1] ** 2 + gains[i]))
        self._pieces = [
            _Piece(e - b, speeds[i], speeds[i + 1], caps[i], accelerations[i])
            for i, (b, e) in enumerate(itertools.pairwise(self._bounds))
        ]
        self._times = [0.0, *itertools.accumulate(piece.duration_s for piece in self._pieces)]
        self.duration_s = self._times[-1]

    def _limits_on(self, index: int, limits: Limits) -> tuple[float, float]:
        """The largest speed anywhere on a straight (even) or an arc (odd), and acceleration along it at that speed."""
        places = [self._place(index, s) for s in self._steepest(index)]
        cap = min(speed_limit(tangent, limits) for _, tangent, _, _ in places)
        for leg in {index // 2, (index + 1) // 2}:
            # The steepest part of the cubic turns 1.5 times as fast as its mean.
            turn = abs(wrap_angle(self._yaws[leg + 1] - self._yaws[leg]))
            if turn > 1e-9:
                cap = min(cap, limits.yaw_rate_rad_s * self._leg_length(leg) / (1.5 * turn))
        acceleration = min(acceleration_limit(tangent, limits) for _, tangent, _, _ in places)
        curvature = places[0][3]
        if curvature > 0.0:
            centripetal = min(acceleration_limit(normal, limits) for _, _, normal, _ in places)
            cap = min(cap, math.sqrt(_TURN_SHARE * centripetal / curvature))
            acceleration *= 1.0 - cap * cap * curvature / centripetal
        return cap, acceleration

    def _steepest(self, index: int) -> list[float]:
        """The ways along the path at which limits are tightest on a piece: its ends, and, where tangent and normal turn
        through the vertical, their highest and lowest places and those where they are level.
        """
        begin, end = self._bounds[index], self._bounds[index + 1]
        if begin == end or index % 2 == 0:
            return [begin]
        _, tangent, normal, curvature = self._place(index, begin)
        highest = begin + math.atan2(normal.z, tangent.z) / curvature
        quarter = math.pi / 2 / curvature
        between = (highest + i * quarter for i in range(-2, 5))
        return [begin, end, *(s for s in between if begin < s < end)]

    def _leg_at(self, s: float) -> tuple[int, float]:
        leg = min(bisect.bisect_left(self._leg_ends, s), len(self._leg_ends) - 1)
        start = self._leg_ends[leg - 1] if leg else 0.0
        return leg, min(1.0, max(0.0, (s - start) / self._leg_length(leg)))

    def _leg_length(self, leg: int) -> float:
        return self._leg_ends[leg] - (self._leg_ends[leg - 1] if leg else 0.0)

    def _place(self, index: int, s: float) -> tuple[Vector3, Vector3, Vector3, float]:
        """Position, unit tangent, unit normal (to the inside) and curvature at a way along the path, in a piece."""
        leg, is_arc = divmod(index, 2)
        offset = s - self._bounds[index]
        tangent = self._directions[leg]
        if not is_arc:
            cut = self._corners[leg - 1].cut_m if leg else 0.0
            return self._points[leg] + tangent * (cut + offset), tangent, Vector3(), 0.0
        corner = self._corners[leg]
        after = self._directions[leg + 1]
        if not corner.turn_rad:
            return self._points[leg + 1], tangent, Vector3(), 0.0
        inside = after - tangent * tangent.dot(after)
        normal = inside / inside.norm()
        angle = offset / corner.radius_m
        begin = self._points[leg + 1] - tangent * corner.cut_m
        sine, cosine = math.sin(angle), math.cos(angle)
        position = begin + (tangent * sine + normal * (1 - cosine)) * corner.radius_m
        return (
            position,
            tangent * cosine + normal * sine,
            normal * cosine - tangent * sine,
            1.0 / corner.radius_m,
        )

    def at(self, time_s: float) -> Motion:
        if time_s >= self.duration_s:
            return Motion(self._points[-1], wrap_angle(self._yaws[-1]))
        index, s, speed, acceleration = self._progress(time_s)
        position, tangent, normal, curvature = self._place(index, s)
        leg, along = self._leg_at(s)
        turn = wrap_angle(self._yaws[leg + 1] - self._yaws[leg])
        yaw = self._yaws[leg] + turn * along * along * (3 - 2 * along)
        yaw_rate = turn * 6 * along * (1 - along) / self._leg_length(leg) * speed
        return Motion(
            position,
            wrap_angle(yaw),
            tangent * speed,
            tangent * acceleration + normal * (curvature * speed * speed),
            yaw_rate,
        )

    def _progress(self, time_s: float) -> tuple[int, float, float, float]:
        """The piece, the way along the whole path, speed and acceleration at a time."""
        index = min(max(0, bisect.bisect_right(self._times, time_s) - 1), len(self._pieces) - 1)
        way, speed, acceleration = self._pieces[index].at(time_s - self._times[index])
        return index, self._bounds[index] + way, speed, acceleration

    def waypoint_at(self, time_s: float) -> int:
        return self._leg_at(self._progress(time_s)[1])[0]

    def length_left_m(self, time_s: float) -> float:
        return self.length_m - self._progress(time_s)[1]


class _Piece:
    """A piece of a way: speeds up to a cap, cruises, slows down; all at one acceleration."""

    def __init__(self, length_m: float, begin_m_s: float, end_m_s: float, cap_m_s: float, acceleration: float) -> None:
        self._v0, self._a = begin_m_s, acceleration
        if length_m == 0.0:
            self._up_s = self._cruise_s = self._down_s = 0.0
            self._peak = begin_m_s
        else:
            self._peak = min(cap_m_s, math.sqrt(acceleration * length_m + (begin_m_s**2 + end_m_s**2) / 2))
            self._up_s = max(0.0, self._peak - begin_m_s) / acceleration
            self._down_s = max(0.0, self._peak - end_m_s) / acceleration
            ramps_m = (begin_m_s + self._peak) / 2 * self._up_s + (end_m_s + self._peak) / 2 * self._down_s
            self._cruise_s = max(0.0, length_m - ramps_m) / self._peak
        self.duration_s = self._up_s + self._cruise_s + self._down_s

    def at(self, time_s: float) -> tuple[float, float, float]:
        """Way, speed and acceleration at a time within the piece."""
        t = max(0.0, min(time_s, self.duration_s))
        if t < self._up_s:
            return (self._v0 + self._a * t / 2) * t, self._v0 + self._a * t, self._a
        way = (self._v0 + self._peak) / 2 * self._up_s
        t -= self._up_s
        if t < self._cruise_s:
            return way + self._peak * t, self._peak, 0.0
        way += self._peak * self._cruise_s
        t -= self._cruise_s
        return way + (self._peak - self._a * t / 2) * t, self._peak - self._a * t, -self._a if self._down_s else 0.0


def path(start: Motion, waypoints: Sequence[Waypoint], corner_radius_m: float, limits: Limits) -> Trajectory:
    """A trajectory from `start` through the waypoints to rest at the last one.

    Corners are rounded within `corner_radius_m`; it stops where that is 0, where the corner is (almost) a reversal, and
    where it turns on the spot. A start in motion goes to the first waypoint by a `Line`.
    """
    points = [start.position, *(waypoint.position for waypoint in waypoints)]
    yaws = [start.yaw_rad]
    for waypoint in waypoints:
        yaws.append(yaws[-1] if waypoint.yaw_rad is None else waypoint.yaw_rad)
    moving = start.velocity.norm() > 0.01
    corners = [
        None if index == 1 and moving else _round(points[index - 1], points[index], points[index + 1], corner_radius_m)
        for index in range(1, len(points) - 1)
    ]
    parts: list[tuple[Trajectory, int]] = []
    first = 0
    for last in range(1, len(points)):
        if last < len(points) - 1 and corners[last - 1] is not None:
            continue
        if last - first == 1:
            begin = start if first == 0 else Motion(points[first], yaws[first])
            parts.append((Line(begin, points[last], yaws[last], limits), first))
        else:
            inner = [corner for corner in corners[first : last - 1] if corner is not None]
            run = RoundedRun(points[first : last + 1], yaws[first : last + 1], inner, limits)
            parts.append((run, first))
        first = last
    return parts[0][0] if len(parts) == 1 else Chain(parts)


def _round(before: Vector3, corner: Vector3, after: Vector3, radius_m: float) -> _Corner | None:
    into, out = corner - before, after - corner
    cut = min(radius_m, into.norm() / 2, out.norm() / 2)
    if cut < 1e-3:
        return None
    cosine = into.dot(out) / (into.norm() * out.norm())
    turn = math.acos(max(-1.0, min(1.0, cosine)))
    if turn > _SHARPEST_ROUNDED_CORNER_RAD:
        return None
    if turn < 1e-6:  # straight on: no arc
        return _Corner(0.0, 0.0, math.inf)
    return _Corner(cut, turn, cut / math.tan(turn / 2))


def _axes_along(way: Vector3) -> tuple[Vector3, Vector3, Vector3]:
    length = way.norm()
    e1 = way / length if length > _SAME_PLACE_M else Vector3(1.0, 0.0, 0.0)
    h = e1.horizontal_norm()
    e2 = Vector3(-e1.y / h, e1.x / h, 0.0) if h > 1e-9 else Vector3(0.0, 1.0, 0.0)
    return e1, e2, e1.cross(e2)


def _turn_acceleration(limits: Limits) -> float:
    return limits.yaw_rate_rad_s / _TURN_RAMP_S


def _turn_jerk(limits: Limits) -> float:
    return _turn_acceleration(limits) / (_TURN_RAMP_S / 2)


def _both_ways(axis: Vector3, limits: Limits) -> float:
    return min(speed_limit(axis, limits), speed_limit(-axis, limits))


@dataclass(frozen=True, slots=True)
class _Problem:
    """A point-to-point (or, without `target_position`, come-to-rest) problem, one number per axis."""

    velocity: list[float]
    acceleration: list[float]
    max_velocity: list[float]
    max_acceleration: list[float]
    max_jerk: list[float]
    target_position: list[float] | None = None


class _Solution:
    """The time-optimal solution of a problem, from position 0; the first and the last axis arrive together.

    Ruckig's numbers fail for what lasts hours, so the first axis of a long problem is solved for a shorter way, and its
    cruise, in the middle, is drawn out; the other axes then end when they can.
    """

    LONGEST_S = 600.0

    def __init__(self, problem: _Problem) -> None:
        axes = len(problem.velocity)
        given = ruckig.InputParameter(axes)
        given.current_position = [0.0] * axes
        given.current_velocity = problem.velocity
        # Ruckig asks that the start can be: an acceleration beyond the limits starts at them.
        given.current_acceleration = [
            max(-limit, min(limit, a)) for a, limit in zip(problem.acceleration, problem.max_acceleration, strict=True)
        ]
        given.max_velocity = problem.max_velocity
        given.max_acceleration = problem.max_acceleration
        given.max_jerk = problem.max_jerk
        self._speed = problem.max_velocity[0]
        self._cruise_s = 0.0
        if problem.target_position is None:
            given.control_interface = ruckig.ControlInterface.Velocity
            given.synchronization = ruckig.Synchronization.No
        else:
            way = problem.target_position[0]
            self._cruise_s = max(0.0, way / self._speed - self.LONGEST_S)
            given.target_position = [way - self._cruise_s * self._speed, *problem.target_position[1:]]
            together = ruckig.Synchronization.No if self._cruise_s else ruckig.Synchronization.Time
            alone = [ruckig.Synchronization.No] * (axes - 2)
            given.per_dof_synchronization = [together, *alone, together]
        self._trajectory = _calculate(given)
        self._cruise_from_s = self._trajectory.duration / 2
        self.duration_s: float = self._trajectory.duration + self._cruise_s

    def at(self, time_s: float) -> tuple[list[float], list[float], list[float]]:
        """Position, velocity and acceleration per axis at a time from 0 to `duration_s`."""
        time_s = max(0.0, min(time_s, self.duration_s))
        cruised_s = max(0.0, min(time_s - self._cruise_from_s, self._cruise_s))
        p, v, a = self._trajectory.at_time(time_s - cruised_s)
        return [p[0] + cruised_s * self._speed, *p[1:]], v, a


def _calculate(problem: ruckig.InputParameter) -> ruckig.Trajectory:
    axes = problem.degrees_of_freedom
    trajectory = ruckig.Trajectory(axes)
    try:
        result = ruckig.Ruckig(axes).calculate(problem, trajectory)
    except (ruckig.RuckigError, ValueError) as error:  # ValueError: a result that its binding does not name
        raise UalError(f"no trajectory could be planned ({str(error).splitlines()})") from None
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise UalError(f"no trajectory could be planned (ruckig: {result})")
    return trajectory
