"""The first part of a trajectory that starts in motion: from any motion to another velocity, to rest, or towards a
goal.

A start with an acceleration is continued: with one constant jerk, as fast as allowed, the acceleration changes to that
of the change of velocity. All accelerations between two allowed ones are allowed. The velocities meanwhile are checked;
if they would leave the limits (for example from a start at the speed limit), the acceleration first decreases to 0.
From any state that these plans themselves reach, this is always within the limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ual.geometry import Vector3
from ual.types import Limits
from ual_daemon.trajectory.envelope import (
    RAMP_S,
    acceleration_limit,
    acceleration_share,
    speed_limit,
    speed_share,
)
from ual_daemon.trajectory.motion import Motion
from ual_daemon.trajectory.pieces import Pieces
from ual_daemon.trajectory.pulse import Pulse, fastest_change_m_s, largest

_NONE = Vector3()
_LEAST_ACCELERATION_SHARE = 1e-9
_NO_TIME_S = 1e-9
_MOST_SPEEDS = 10
_MOST_AIMS = 60
_AIM_TOLERANCE = 1e-3
_SPEED_TOLERANCE = 0.01
_GOAL_TOLERANCE_M = 1e-9
_SAMPLES_COUNT = 16


@dataclass(frozen=True, slots=True)
class Change:
    """A change of velocity that begins with an acceleration: this changes within `blend_s` to `held`, which lasts for
    `hold_s` and decreases to 0 within `fall_s`.
    """

    velocity: Vector3
    acceleration: Vector3
    blend_s: float
    held: Vector3
    hold_s: float
    fall_s: float

    @classmethod
    def to(cls, after: Vector3, velocity: Vector3, acceleration: Vector3, limits: Limits) -> Change:
        """Plans the (almost) shortest change from a velocity with an acceleration to the velocity `after`."""
        if acceleration_share(acceleration, limits) <= _LEAST_ACCELERATION_SHARE:
            change = after - velocity
            size = change.norm()
            if size < 1e-12:
                return cls(velocity, Vector3(), 0.0, Vector3(), 0.0, 0.0)
            pulse = Pulse.shortest(size, acceleration_limit(change / size, limits))
            held = change / (pulse.ramp_s + pulse.hold_s)
            return cls(velocity, Vector3(), pulse.ramp_s, held, pulse.hold_s, pulse.ramp_s)

        def plan(blend_s: float) -> tuple[Vector3, float, float]:
            missing = after - velocity - acceleration * (blend_s / 2)
            size = missing.norm()
            if size < 1e-12:
                return Vector3(), 0.0, 0.0
            limit = acceleration_limit(missing / size, limits)
            # From share * limit * (blend_s / 2 + share * RAMP_S / 2) = size.
            share = 4 * size / limit / (blend_s + math.sqrt(blend_s**2 + 8 * size * RAMP_S / limit))
            if share < 1.0:
                return missing * (share * limit / size), 0.0, share * RAMP_S
            return missing * (limit / size), size / limit - (blend_s + RAMP_S) / 2, RAMP_S

        blend_s = _shortest(
            lambda blend_s: acceleration_share(plan(blend_s)[0] - acceleration, limits) * RAMP_S,
            acceleration_share(acceleration, limits) * RAMP_S,
        )
        return cls(velocity, acceleration, blend_s, *plan(blend_s))

    def total_displacement(self) -> Vector3:
        """Returns the displacement during the change."""
        v, a0, a1 = self.velocity, self.acceleration, self.held
        t, h, f = self.blend_s, self.hold_s, self.fall_s
        # The parts of the initial velocity, of the initial acceleration, and of the held acceleration.
        of_v = t + h + f
        of_a0 = t * t / 3 + t * (h + f) / 2
        of_a1 = t * t / 6 + t * (h + f) / 2 + h * h / 2 + h * f + f * f / 3
        return Vector3(
            v.x * of_v + a0.x * of_a0 + a1.x * of_a1,
            v.y * of_v + a0.y * of_a0 + a1.y * of_a1,
            v.z * of_v + a0.z * of_a0 + a1.z * of_a1,
        )

    def append(self, pieces: Pieces, after: Vector3) -> None:
        """Appends the change to the motion that it was planned for."""
        end = pieces.position + self.total_displacement()
        if self.blend_s > 0.0:
            pieces.add(self.blend_s, (self.held - self.acceleration) / self.blend_s)
        pieces.add(self.hold_s, Vector3())
        if self.fall_s > 0.0:
            pieces.add(self.fall_s, -self.held / self.fall_s)
        pieces.settle(end, after)

    def is_within(self, limits: Limits) -> bool:
        """Returns whether the velocities are allowed while the acceleration changes, and the velocities that would be
        reached if the acceleration decreased to 0 from then on. All other velocities are between allowed ones.
        """
        if self.acceleration == _NONE:  # all velocities are between the first and the last one
            return True
        allowed = 1.0 + 1e-9
        for sample in range(_SAMPLES_COUNT + 1):
            x = sample / _SAMPLES_COUNT
            acceleration = self.acceleration + (self.held - self.acceleration) * x
            velocity = self.velocity + (self.acceleration + acceleration) * (x * self.blend_s / 2)
            died_out = velocity + acceleration * (acceleration_share(acceleration, limits) * RAMP_S / 2)
            share = max(speed_share(velocity, limits), speed_share(died_out, limits))
            if sample == 0:  # from a start beyond the limits it must not go further beyond
                allowed = max(allowed, share)
            elif share > allowed:
                return False
        return True


def _shortest(needed_s: Callable[[float], float], die_out_s: float) -> float:
    """Returns the (almost) shortest time that is at least `needed_s` of that time."""
    if needed_s(0.0) <= _NO_TIME_S:
        return 0.0
    enough_s = die_out_s + RAMP_S  # to decrease to 0, and then to increase to the limit
    if needed_s(die_out_s) <= die_out_s + _NO_TIME_S:
        enough_s = die_out_s
    blend_s = largest(lambda blend_s: needed_s(blend_s) - blend_s, 0.0, enough_s, within=1e-6) + _NO_TIME_S
    blend_s += max(0.0, needed_s(blend_s) - blend_s)
    return blend_s if needed_s(blend_s) <= blend_s * (1.0 + 1e-7) + _NO_TIME_S else die_out_s + RAMP_S


def brake(start: Motion, limits: Limits) -> Pieces:
    """Plans the motion from a start to rest."""
    pieces = Pieces(start.position, start.velocity, start.acceleration)
    change = Change.to(Vector3(), start.velocity, start.acceleration, limits)
    if not change.is_within(limits):
        _die_out(pieces, limits)
        change = Change.to(Vector3(), pieces.velocity, Vector3(), limits)
    change.append(pieces, Vector3())
    return pieces


def aim(start: Motion, goal: Vector3, limits: Limits, fastest_m_s: float = math.inf) -> tuple[Pieces, Vector3, float]:
    """Plans the first part of a motion to a goal: it bends until it flies straight at the goal, as fast as it can still
    stop there.

    Returns this part, the direction of the straight line from its end to the goal, and the length of that line. If the
    goal is too near for this, the part ends at rest.
    """
    pieces = Pieces(start.position, start.velocity, start.acceleration)
    change, direction, speed = _Aim(pieces, goal, limits, fastest_m_s).best()
    if not change.is_within(limits):
        _die_out(pieces, limits)
        change, direction, speed = _Aim(pieces, goal, limits, fastest_m_s).best()
    change.append(pieces, direction * speed)
    return pieces, direction, (goal - pieces.position).norm()


def _die_out(pieces: Pieces, limits: Limits) -> None:
    """Appends a piece in which the acceleration decreases to 0."""
    duration_s = acceleration_share(pieces.acceleration, limits) * RAMP_S
    if duration_s > 0.0:
        pieces.add(duration_s, -pieces.acceleration / duration_s)
        pieces.settle(pieces.position, pieces.velocity)


class _Aim:
    """The search for the velocity straight at a goal to which a motion bends."""

    def __init__(self, pieces: Pieces, goal: Vector3, limits: Limits, fastest_m_s: float) -> None:
        self._velocity, self._acceleration = pieces.velocity, pieces.acceleration
        self._path = goal - pieces.position
        self._limits = limits
        self._fastest_m_s = fastest_m_s

    def best(self) -> tuple[Change, Vector3, float]:
        """Returns the change, the direction after it, and the largest speed from which it can stop at the goal, by
        false position over the share of the speed limit. The speed 0 is always possible.
        """
        stop, left, left_m = self._bend(Vector3())
        direction = left / left_m if left_m > 0.0 else Vector3(1.0, 0.0, 0.0)
        low, at_low = 0.0, self._stoppable_m_s(direction, left_m)
        # The bend is not longer than the distance to a stop and back.
        fastest = self._stoppable_m_s(direction, left_m + 2 * stop.total_displacement().norm())
        share, high, at_high = min(1.0, fastest / self._speed_limit(direction)), 1.0, -fastest
        for _ in range(_MOST_SPEEDS):
            found = self._at(share, direction, _AIM_TOLERANCE)
            spare = -1.0 if found is None else self._stoppable_m_s(found[1], found[3]) - found[2]
            if found is None or spare < 0.0:
                high, at_high = share, spare
            else:
                low, at_low, direction = share, spare, found[1]
                if share == 1.0 or spare < _SPEED_TOLERANCE * found[2]:
                    break
            share = low + (high - low) * max(0.1, min(0.9, at_low / (at_low - at_high)))
        while low > 0.0:
            found = self._at(low, direction, 0.0)
            if found is not None and found[2] <= self._stoppable_m_s(found[1], found[3]):
                return found[:3]
            low = low * 0.98 - 0.01
        left = self._path - stop.total_displacement()
        return stop, left / left_m if left_m > 0.0 else Vector3(1.0, 0.0, 0.0), 0.0

    def _bend(self, velocity: Vector3) -> tuple[Change, Vector3, float]:
        """Returns the change to a velocity, the vector from its end to the goal, and the length of that vector."""
        change = Change.to(velocity, self._velocity, self._acceleration, self._limits)
        left = self._path - change.total_displacement()
        return change, left, left.norm()

    def _at(self, share: float, direction: Vector3, miss: float) -> tuple[Change, Vector3, float, float] | None:
        """Returns the change to a share of the largest speed, straight at the goal (or up to the angle `miss` beside
        it), by fixed-point iteration. With it come its direction, speed and the distance left. Returns None if
        it finds none, or if the motion could not stop at the goal.
        """
        last_miss = math.inf
        for count in range(_MOST_AIMS):
            speed = share * self._speed_limit(direction)
            change, left, left_m = self._bend(direction * speed)
            if left_m < _GOAL_TOLERANCE_M:
                return None
            missed = (left / left_m - direction).norm()
            if missed <= max(miss, _GOAL_TOLERANCE_M / left_m, 1e-14):
                return change, direction, speed, left_m
            if count > 1 and (missed > 0.9 * last_miss or speed > 1.3 * self._stoppable_m_s(direction, left_m)):
                return None
            last_miss = missed
            direction = left / left_m
        return None

    def _stoppable_m_s(self, direction: Vector3, path_m: float) -> float:
        return fastest_change_m_s(path_m, acceleration_limit(direction, self._limits))

    def _speed_limit(self, direction: Vector3) -> float:
        return min(self._fastest_m_s, speed_limit(direction, self._limits))
