"""What a trajectory is: a motion at each moment."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from ual.geometry import Vector3
from ual.types import Limits


@dataclass(frozen=True, slots=True)
class Motion:
    """A moment of a reference in the local frame: where, how fast, and heading. Derivatives are by time, in s."""

    position: Vector3
    yaw_rad: float
    velocity: Vector3 = field(default_factory=Vector3)
    acceleration: Vector3 = field(default_factory=Vector3)
    yaw_rate_rad_s: float = 0.0
    yaw_acceleration_rad_s2: float = 0.0


class Trajectory(ABC):
    """A reference from its start (0) to its end (`duration_s`), where it stands still."""

    duration_s: float
    length_m: float
    limits: Limits
    """What it keeps."""
    stops_s: Sequence[float] = ()
    """When it stands still at a waypoint on the way."""

    @abstractmethod
    def at(self, time_s: float) -> Motion:
        """The reference at a time; before the start and after the end, that at the start and the end."""

    def end(self) -> Motion:
        """Where it ends."""
        return self.at(self.duration_s)

    def bends_s(self) -> Iterable[tuple[float, float]]:
        """From when to when, in order, it may bend, turn back, or (of no duration) stop for a corner. From one to the
        next it flies straight on, so that the two places tell where it goes.
        """
        return ((0.0, self.duration_s),)

    def waypoint_at(self, time_s: float) -> int:
        """The number of the waypoint it is flying to at a time."""
        del time_s
        return 0

    def length_left_m(self, time_s: float) -> float:
        """The way left at a time."""
        return (self.end().position - self.at(time_s).position).norm()
