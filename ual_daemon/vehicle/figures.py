"""Present measurements of one UAV for monitoring from outside (``--metrics``)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from ual.types import State, TaskKind, TaskStatus
from ual_daemon.backends.values import LandedState, LinkReport, Snapshot


class VehicleFigures(NamedTuple):
    """Read at one moment.

    Attributes:
        state: The state.
        is_link_up: Whether the autopilot is received.
        snapshot: The newest data of the autopilot.
        is_ours: Whether UAL flies the present flight.
        is_leased: Whether a program holds the lease.
        link: How the link has been of late.
        setpoint_rate_hz: How often setpoints are due.
        task: The kind of the task that runs.
        tasks_ended: How many tasks have ended since the start, by kind and by how they ended.

    """

    state: State
    is_link_up: bool
    snapshot: Snapshot
    is_ours: bool = False
    is_leased: bool = False
    link: LinkReport = LinkReport()
    setpoint_rate_hz: float = 50.0
    task: TaskKind | None = None
    tasks_ended: Mapping[tuple[TaskKind, TaskStatus], int] = MappingProxyType({})

    @property
    def is_armed(self) -> bool:
        """Whether the autopilot last said that it is armed: also while the link is lost, until it is received again."""
        armed = self.snapshot.control.armed
        return armed is not None and armed.value

    @property
    def is_airborne(self) -> bool:
        """Whether it was last said to be armed, and not to stand on the ground: also while the link is lost."""
        landed = self.snapshot.control.landed
        return self.is_armed and (landed is None or landed.value is not LandedState.ON_GROUND)
