"""Waiting until a mission can be stopped: while the autopilot takes off in it, or is not seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from typing_extensions import override

from ual.errors import UalError
from ual.types import State
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre, Step, failed, taken, why_blind
from ual_daemon.flight.manoeuvres.recover import TAKES_BACK
from ual_daemon.flight.policy.authority import LONGEST_GAP_S
from ual_daemon.flight.policy.jumps import Jump
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Reference

StopIn: TypeAlias = Callable[[State, Snapshot, Manoeuvre], Handover | None]
"""Returns what stops a mission in a state, after a manoeuvre; None where nothing has to."""

_LEFT_ALONE = (
    f"after {LONGEST_GAP_S:g} s the flight may be another's, so the mission is not stopped any more: look who flies it"
)


class AwaitStop(Manoeuvre):
    """Sends nothing until the autopilot is seen, on the ground or after its climb, and stops its mission then.

    Only the safety pilot can abort a take-off. A new command may replace the wait, as it may the mission.
    """

    stops_mission = TAKES_BACK
    mission = TAKES_BACK
    why_not_pausable = "it stops a mission"

    def __init__(self, name: str, seen_mode: str, modes: tuple[str, str] | None, stop: StopIn) -> None:
        """`seen_mode` is the one in which what it replaces was seen last; empty if it never was. `modes` are those in
        which the autopilot flies the mission and holds; None where UAL takes the control back already. `stop` makes
        what stops it.
        """
        super().__init__(name, None)
        self._seen_mode, self.modes = seen_mode, modes
        self._stop = stop
        self._began_in = ""
        self._seen_s: float | None = None

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return self._step_blind(lost, snapshot)
        self._seen_s = snapshot.time_s
        is_own = self._is_own(snapshot)
        if is_own is False:
            return taken(snapshot, self.name)
        if is_own is None or estimate.state is State.TAKING_OFF:
            return Step()
        handover = self._stop(estimate.state, snapshot, self)
        return Step(has_ended=True) if handover is None else Step(handover=handover)

    def _step_blind(self, lost: UalError, snapshot: Snapshot) -> Step:
        if self._seen_s is None:
            self._seen_s = snapshot.time_s
        is_long = snapshot.time_s - self._seen_s > LONGEST_GAP_S
        return failed(type(lost)(f"{lost.message}; {_LEFT_ALONE}", lost.metadata)) if is_long else Step()

    def _is_own(self, snapshot: Snapshot) -> bool | None:
        """Whether UAL has led to the present mode, and not others; None while that may still be told."""
        mode = snapshot.control.mode_name
        # Where that was not known as it began, it is the one that was seen before: others may have chosen this one.
        self._began_in = self._began_in or self.mode_begun or self._seen_mode or mode
        return True if mode == self._began_in else self.led_to(snapshot)

    @override
    def estimate_jumped(self, jump: Jump, stop: Reference) -> UalError | None:
        return None  # it has no way
