"""The gimbal as programs see it: in the process, and through the daemon."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass

from ual.geometry import PointStamped


@dataclass(frozen=True)
class Attitude:
    """Where the gimbal points, in radians: above the horizon, and from the nose of the UAV to the left."""

    pitch_rad: float
    yaw_rad: float


class Gimbal(ABC):
    """The gimbal of one UAV. Whoever may fly may point it, also while another program holds the lease."""

    @abstractmethod
    def attitude(self) -> Attitude:
        """Returns where it points, as it says itself.

        Raises:
            WrongStateError: It has not said anything lately.

        """

    @abstractmethod
    def watch(self, rate_hz: float = 10.0) -> Iterator[Attitude]:
        """Yields where it points, so many times a second, for ever. Raises as `attitude` does."""

    @abstractmethod
    def point(self, pitch_rad: float, yaw_rad: float) -> None:
        """Points in a direction relative to the UAV, and returns when the gimbal has accepted it.

        Raises:
            InvalidArgumentError: An angle is beyond the limits.
            RejectedByAutopilotError: The autopilot refused.
            UalTimeoutError: The autopilot did not answer.

        """

    @abstractmethod
    def point_at(self, point: PointStamped) -> None:
        """Points at a position in any frame, and keeps pointing at it until `point` or the next `point_at`.

        Raises:
            UnknownFrameError: There is no such frame.
            WrongStateError: The position of the UAV is not known.

        """
