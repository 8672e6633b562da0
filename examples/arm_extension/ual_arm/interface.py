"""The arm as programs see it: in the process, and through the daemon."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

from ual_arm.values import Joints


class Arm(ABC):
    """The arm of one UAV."""

    @abstractmethod
    def joints(self) -> Joints:
        """Returns where the joints are."""

    @abstractmethod
    def watch(self, rate_hz: float = 10.0) -> Iterator[Joints]:
        """Yields where the joints are, so many times a second, for ever."""

    @abstractmethod
    def move(self, shoulder_rad: float, elbow_rad: float) -> Joints:
        """Moves both joints, and returns when they are there.

        Raises:
            InvalidArgumentError: An angle is beyond the limits.
            TaskAbortedError: A newer movement has replaced it.
            LeaseHeldError: Another program holds the lease of the UAV.

        """
