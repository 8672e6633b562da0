"""Duties of a daemon's process to the program that started it: reports of readiness and life, and the end on
request.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

from typing_extensions import override

from ual_daemon import logs
from ual_daemon.program import signals

if TYPE_CHECKING:
    from ual.interface import Simulation
    from ual_daemon.program.recording.audit_writer import AuditReport
    from ual_daemon.server.simulation_service import SimulatedTime

_log = logging.getLogger(__name__)


class Supervision(Protocol):
    """See `Unsupervised`, and `ual_daemon.program.worker.Worker`."""

    def watch(self, stop: Callable[[], None]) -> None:
        """Calls `stop` on the running event loop when the process is to end."""

    async def may_serve(self) -> bool:
        """Waits until what was opened may be served. Returns False if the process is to end instead."""

    def serves(self, names: Sequence[str]) -> None:
        """Takes note that all UAVs of this process are served."""

    def time_of(self, simulation: Simulation) -> SimulatedTime:
        """Returns the time of a simulated UAV of this process, as callers change it."""

    def watch_audit(self, on_report: Callable[[AuditReport], object]) -> None:
        """Calls back, on the event loop, when the parent process reports that the audit's state has changed."""
        return

    def ended(self) -> None:
        """Takes note of a clean end."""


class Unsupervised(Supervision):
    """A process that flies all UAVs by itself, until a signal comes."""

    @override
    def watch(self, stop: Callable[[], None]) -> None:
        signals.on_first(stop)

    @override
    async def may_serve(self) -> bool:
        return True

    @override
    def serves(self, names: Sequence[str]) -> None:
        if len(names) > 1:
            log_serving(names, workers_count=1)

    @override
    def time_of(self, simulation: Simulation) -> SimulatedTime:
        return simulation

    @override
    def watch_audit(self, on_report: Callable[[AuditReport], object]) -> None:
        return None

    @override
    def ended(self) -> None:
        logs.event(_log, logging.INFO, "ended")


def log_serving(names: Sequence[str], workers_count: int) -> None:
    """Logs that a fleet is served."""
    logs.event(_log, logging.INFO, "serving", count=len(names), uavs=span(names), workers=workers_count)


def span(names: Sequence[str]) -> str:
    """Returns the names of UAVs that are counted up, as text."""
    return names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"
