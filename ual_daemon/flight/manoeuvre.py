"""What a UAV can be busy with: the base of take-off, landing, following a trajectory, taking control back.

A manoeuvre is stepped at each update, by the update thread, with the newest snapshot; it answers with a setpoint to
send and, once, with how it ended. It never blocks and sends nothing itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from concurrent.futures import Future
from dataclasses import dataclass

from ual.errors import LinkLostError, TaskAbortedError, UalError
from ual.types import State
from ual_daemon.backends.values import Control, Setpoint, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.references import Reference

TIMEOUT_FACTOR = 3.0
"""A manoeuvre may take so many times as long as planned, ..."""
TIMEOUT_MARGIN_S = 20.0
"""... and so much longer."""


@dataclass(frozen=True, slots=True)
class Step:
    """What a manoeuvre says at an update: a setpoint (or none), and, when it `has_ended`, with which error (or none)
    and what is to be flown then (None: stop where it is).
    """

    setpoint: Setpoint | None = None
    has_ended: bool = False
    error: UalError | None = None
    then: Reference | None = None


def failed(error: UalError) -> Step:
    """The end, by an error."""
    return Step(has_ended=True, error=error)


class Manoeuvre(ABC):
    """Something that the UAV is busy with.

    `declares` is the state that it means for the estimator; `is_replaceable` says whether a new command may end it.
    `task` is None for what is not a task of the interface.
    """

    declares: State | None = None
    is_replaceable = True

    def __init__(self, name: str, task: VehicleTask | None) -> None:
        self.name = name
        self.task = task
        self.command: AutopilotCommand | None = None
        self.future: Future[None] = Future() if task is None else task.future
        if task is None:
            self.future.set_running_or_notify_cancel()  # nobody but `end` ends it

    @abstractmethod
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        """One update; `estimate` is what the data say without this manoeuvre."""

    def pose_reference(self) -> Reference | None:
        """What it flies by now, if it does by references of ours."""
        return None

    def end(self, error: UalError | None) -> None:
        """Withdraws its command, and tells those who wait. No lock may be held."""
        if self.command is not None:
            self.command.withdraw()
        if self.task is not None:
            self.task.end(error)
        elif error is None:
            self.future.set_result(None)
        else:
            self.future.set_exception(error)


def why_not_ours(snapshot: Snapshot, estimate: Estimate, during: str) -> UalError | None:
    """Why a manoeuvre cannot go on, if so: link or position lost, disarmed, or not flown by our references."""
    blind = why_blind(estimate, during)
    if blind is not None:
        return blind
    if estimate.state is State.LANDED_DISARMED:
        return TaskAbortedError(f"{during}: the motors were disarmed", {"by": "autopilot", "state": "LANDED_DISARMED"})
    assert snapshot.mode is not None
    if snapshot.mode.value.control is not Control.REFERENCES:
        return taken(snapshot, during)
    return None


def why_blind(estimate: Estimate, during: str) -> UalError | None:
    """Why a manoeuvre cannot go on without data, if so: the link or the position is lost."""
    if not estimate.is_link_up:
        return LinkLostError(f"{during}: {estimate.why}", {"state": State.UNINITIALIZED.name})
    if estimate.state is State.UNINITIALIZED:
        return TaskAbortedError(f"{during}: {estimate.why}", {"by": "autopilot", "state": State.UNINITIALIZED.name})
    return None


def taken(snapshot: Snapshot, during: str) -> TaskAbortedError:
    """The end of a manoeuvre whose UAV the safety pilot took."""
    mode = snapshot.mode.value.name if snapshot.mode is not None else "unknown"
    return TaskAbortedError(
        f"{during}: taken by the safety pilot (the autopilot is in mode {mode}); "
        "recover_from_manual takes control back",
        {"by": "safety pilot", "state": State.FLYING_MANUAL.name, "mode": mode},
    )
