"""One flight along a straight line, and its figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ual.geometry import Vector3

NEAR_M = 0.5
"""As near as the goal is called reached in the figures."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where the UAV was, by the autopilot's own estimate, and where it was told to be (None: nowhere); metres."""

    time_s: float
    position: Vector3
    speed_m_s: float
    wanted: Vector3 | None


@dataclass(frozen=True)
class Flown:
    """A flight from `start` to `goal`: all places since the command, until some seconds after the goal was reached."""

    start: Vector3
    goal: Vector3
    places: Sequence[Place]

    def within_s(self, near_m: float = NEAR_M) -> float:
        """From the command until it was first so near to the goal; infinity where it never was."""
        near = (place.time_s for place in self.places if (place.position - self.goal).norm() <= near_m)
        return next(near, math.inf) - self.places[0].time_s

    def settled_s(self, near_m: float) -> float:
        """From the command until it was so near to the goal for good; infinity where it was not at the end."""
        far = [place.time_s for place in self.places if (place.position - self.goal).norm() > near_m]
        if not far:
            return 0.0
        return math.inf if far[-1] == self.places[-1].time_s else far[-1] - self.places[0].time_s

    @property
    def off_line_m(self) -> list[float]:
        """How far each place until the goal was reached lies from the line."""
        until_s = self.places[0].time_s + self.within_s()
        return [self._split(place.position)[1] for place in self.places if place.time_s <= until_s]

    @property
    def widest_m(self) -> float:
        return max(self.off_line_m)

    @property
    def widest_ever_m(self) -> float:
        """The same, while it hovers at the goal, too."""
        return max(self.along_and_off_m()[1])

    @property
    def rms_m(self) -> float:
        off = self.off_line_m
        return math.sqrt(math.fsum(each * each for each in off) / len(off))

    @property
    def overshoot_m(self) -> float:
        """How far it was ever beyond the goal, along the line."""
        length_m = (self.goal - self.start).norm()
        return max(0.0, *(self._split(place.position)[0] - length_m for place in self.places))

    @property
    def peak_m_s(self) -> float:
        return max(place.speed_m_s for place in self.places)

    @property
    def lag_m(self) -> float:
        """How far it was ever from where it was told to be at that moment."""
        return max((place.position - place.wanted).norm() for place in self.places if place.wanted is not None)

    def along_and_off_m(self) -> tuple[list[float], list[float]]:
        """The way along the line and the distance from it, of each place."""
        split = [self._split(place.position) for place in self.places]
        return [along for along, _ in split], [off for _, off in split]

    def _split(self, position: Vector3) -> tuple[float, float]:
        way = self.goal - self.start
        along_m = (position - self.start).dot(way) / way.norm()
        return along_m, (position - self.start - way * (along_m / way.norm())).norm()
