"""The interface of trajectories: a motion at each time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from ual.geometry import Vector3
from ual.shared.immutable import immutable
from ual.types import Limits

_ZERO = Vector3()


@immutable
class Motion:
    """The state of a trajectory at one time, in the local frame: position, heading, and their derivatives by time."""

    position: Vector3
    yaw_rad: float
    velocity: Vector3 = _ZERO
    acceleration: Vector3 = _ZERO
    yaw_rate_rad_s: float = 0.0
    yaw_acceleration_rad_s2: float = 0.0


class Trajectory(ABC):
    """A motion from its start (time 0) to its end (`duration_s`), where it is at rest."""

    duration_s: float
    length_m: float
    limits: Limits
    """The limits that it keeps."""
    stops_s: Sequence[float] = ()
    """The times at which it is at rest at a waypoint before the end."""
    holds_s: Mapping[float, float] = MappingProxyType({})
    """Duration in s of the hold at each stop, by the time of that stop; stops without a hold are left out."""

    @abstractmethod
    def at(self, time_s: float) -> Motion:
        """Returns the state at a time; before the start that of the start, after the end that of the end."""

    def end(self) -> Motion:
        """Returns the position of the end."""
        return self.at(self.duration_s)

    def bends_s(self) -> Iterable[tuple[float, float]]:
        """Yields, in order, the spans of time in which it may bend, reverse, or (without duration) stop for a corner.
        Between two spans it flies straight, so that the positions at their ends define the line.
        """
        return ((0.0, self.duration_s),)

    def waypoint_at(self, time_s: float) -> int:
        """Returns the number of the waypoint that it is flying to at a time."""
        del time_s
        return 0

    def length_left_m(self, time_s: float) -> float:
        """Returns the distance left along the path at a time."""
        return (self.end().position - self.at(time_s).position).norm()
