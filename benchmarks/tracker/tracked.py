"""One flight along a straight line, and its figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ual.geometry import Vector3

NEAR_M = 0.5
"""The goal counts as reached within this distance."""
_SAME_M = 0.01


@dataclass(frozen=True, slots=True)
class TrackedPosition:
    """Position of the UAV by the autopilot's estimate, and position of its reference (None: no reference); metres.

    `true_position` is where its simulator says that it was (None: it does not say so), in axes of its own.
    """

    time_s: float
    position: Vector3
    speed_m_s: float
    wanted: Vector3 | None
    true_position: Vector3 | None = None
    has_task: bool = False


@dataclass(frozen=True)
class TrackedFlight:
    """A flight from `start` to `goal`: all places from the command until some seconds after the goal was reached."""

    start: Vector3
    goal: Vector3
    places: Sequence[TrackedPosition]

    def within_s(self, near_m: float = NEAR_M) -> float:
        """Returns the time from the command until it was first this near to the goal; infinity if it never was."""
        near = (place.time_s for place in self.places if (place.position - self.goal).norm() <= near_m)
        return next(near, math.inf) - self.places[0].time_s

    def settled_s(self, near_m: float) -> float:
        """Returns the time from the command until it stayed this near to the goal; infinity if it did not stay."""
        far = [place.time_s for place in self.places if (place.position - self.goal).norm() > near_m]
        if not far:
            return 0.0
        return math.inf if far[-1] == self.places[-1].time_s else far[-1] - self.places[0].time_s

    @property
    def cross_track_m(self) -> list[float]:
        """Returns how far each place is from the line, until the goal was reached."""
        until_s = self.places[0].time_s + self.within_s()
        return [self._split(place.position)[1] for place in self.places if place.time_s <= until_s]

    @property
    def widest_m(self) -> float:
        return max(self.cross_track_m)

    @property
    def widest_ever_m(self) -> float:
        """Returns the same, including the hover at the goal."""
        return max(self.along_and_off_m()[1])

    @property
    def rms_m(self) -> float:
        off = self.cross_track_m
        return math.sqrt(math.fsum(each * each for each in off) / len(off))

    @property
    def overshoot_m(self) -> float:
        """Returns how far it was beyond the goal at most, along the line."""
        length_m = (self.goal - self.start).norm()
        return max(0.0, *(self._split(place.position)[0] - length_m for place in self.places))

    @property
    def peak_m_s(self) -> float:
        return max(place.speed_m_s for place in self.places)

    @property
    def lag_m(self) -> float:
        """Returns how far it was from its reference at most."""
        return max((place.position - place.wanted).norm() for place in self.places if place.wanted is not None)

    def along_and_off_m(self) -> tuple[list[float], list[float]]:
        """Returns for each place the distance along the line and from the line."""
        split = [self._split(place.position) for place in self.places]
        return [along for along, _ in split], [off for _, off in split]

    def true(self) -> TrackedFlight | None:
        """Returns the same flight by the simulator's truth, as if the estimate had been right at its begin."""
        first = self.places[0]
        if first.true_position is None:
            return None
        offset = first.true_position - first.position
        places = [
            replace(place, position=place.true_position - offset)
            for place in self.places
            if place.true_position is not None
        ]
        return TrackedFlight(self.start, self.goal, places)

    @property
    def waited_s(self) -> float:
        """Returns how long the task went on after its reference had come to the goal; 0 without a task."""
        at_goal = [place for place in self.places if place.wanted is not None and place.has_task]
        waiting = [place.time_s for place in at_goal if _is_at(place.wanted, self.goal)]
        return waiting[-1] - waiting[0] if waiting else 0.0

    def _split(self, position: Vector3) -> tuple[float, float]:
        way = self.goal - self.start
        along_m = (position - self.start).dot(way) / way.norm()
        return along_m, (position - self.start - way * (along_m / way.norm())).norm()


def _is_at(position: Vector3 | None, goal: Vector3) -> bool:
    return position is not None and (position - goal).norm() < _SAME_M
