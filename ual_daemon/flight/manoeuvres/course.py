"""Course of a trajectory, from which the rest of it can be planned again when the world has changed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, NamedTuple

from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.frames.fence import Fence
from ual_daemon.trajectory import Motion, Trajectory

if TYPE_CHECKING:
    from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre


class CourseProgress(NamedTuple):
    """Position in a trajectory: its time, the motion that is sent now, and whether it waits or holds at a stop."""

    trajectory: Trajectory
    time_s: float
    motion: Motion
    is_waiting: bool = False


class Onward(NamedTuple):
    """The rest of a way, planned again: `passed_count` waypoints of the trajectory before it are not in it any more.

    `why` says, human-readable, what has changed.
    """

    trajectory: Trajectory
    passed_count: int
    why: str


class Course(ABC):
    """Basis of a trajectory's plan: goals, limits, home, frames. Belongs to the update thread, except `plan`."""

    fence: Fence | None = None
    """The geofence in which the way was found to be inside; None: in none yet."""

    @property
    def is_long(self) -> bool:
        """Whether planning takes so long that it must not be done between two updates."""
        return False

    @abstractmethod
    def is_outdated(self, flown: CourseProgress, snapshot: Snapshot) -> bool:
        """Returns whether the trajectory would be planned otherwise now.

        Raises:
            UalError: It is not known any more where it is to lead.

        """

    @abstractmethod
    def plan(self, flown: CourseProgress, snapshot: Snapshot) -> Onward:
        """Plans the rest of the way from the motion that is sent now.

        Raises:
            UalError: There is no such way, or it would leave the geofence.

        """

    def successor(self, task: VehicleTask, snapshot: Snapshot) -> Manoeuvre | None:
        """Returns the manoeuvre that is to go on with the task, as the goal moves now; None if it does not."""
        del task, snapshot
        return None
