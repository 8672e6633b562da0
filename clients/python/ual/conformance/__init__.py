"""Checks of what every UAV must do, whatever its autopilot. They use only `ual.interface.Uav`.

``ual check`` and the tests run the same list of checks, with the class interface and with the client.
"""

from __future__ import annotations

from ual.conformance import (
    dry_runs,
    flying,
    grounded,
    missions,
    own,
    paths,
    piloted,
    refusals,
    reports,
    tasks,
    velocities,
)
from ual.conformance.check import Check, Need, Outcome, Result
from ual.conformance.flight import CannotRunError, CheckFailedError, Flight, Tolerances
from ual.conformance.runner import run, run_check

CHECKS: tuple[Check, ...] = (
    *reports.CHECKS,
    *own.ON_GROUND,
    *grounded.CHECKS,
    *dry_runs.CHECKS,
    *flying.CHECKS,
    *paths.CHECKS,
    *velocities.CHECKS,
    *tasks.CHECKS,
    *refusals.CHECKS,
    *own.IN_FLIGHT,
    *piloted.CHECKS,
    *missions.CHECKS,
)
"""In an order that changes the UAV's state as rarely as possible: checks on the ground come first."""

__all__ = [
    "CHECKS",
    "CannotRunError",
    "Check",
    "CheckFailedError",
    "Flight",
    "Need",
    "Outcome",
    "Result",
    "Tolerances",
    "run",
    "run_check",
]
