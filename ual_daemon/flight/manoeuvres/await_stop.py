"""Waiting until a mission can be stopped: while the autopilot takes off in it, or is not seen."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeAlias

from typing_extensions import override

from ual.errors import UalError
from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.values import LandedState, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre, Step, failed, taken, why_blind, with_advice
from ual_daemon.flight.manoeuvres.recover import TAKES_BACK
from ual_daemon.flight.policy.authority import LONGEST_LINK_GAP_S
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Reference

StopIn: TypeAlias = Callable[[State, Snapshot, Manoeuvre], Handover | None]
"""Returns what stops a mission in a state, after a manoeuvre; None where nothing has to."""

HoldInstead: TypeAlias = Callable[[UalError, Manoeuvre], Handover]
"""Returns what has the autopilot hold by itself where it did not give UAL the control, by the error that says why."""

_log = logging.getLogger(__name__)

_BY_ITSELF = (LandedState.TAKING_OFF, LandedState.LANDING)
"""In these it is left alone: it would hold close to the ground, or in the air without a position."""
_ONCE_SEEN = "UAL stops its mission once its state is known"
_HOLDING = "UAL stops its mission: the autopilot is to hold its position by itself"
_HELD = "UAL has stopped its mission: the autopilot holds its position by itself"
_REMEDY = (
    "take over by hand, or select another mode at the ground station; abort tries again, and UAL stops it once its "
    "state is known"
)
_REMEDY_SEEN = "take over by hand, or select another mode at the ground station; recover_from_manual tries again"
_LEFT_ALONE = (
    f"after {LONGEST_LINK_GAP_S:g} s the flight may be another's, so the mission is not stopped any more: "
    "look who flies it"
)


class AwaitStop(Manoeuvre):
    """Waits until the autopilot is seen, on the ground or after its climb, and stops its mission then.

    Only the safety pilot can abort a take-off. Without a position UAL cannot take the control: where the autopilot is
    heard, it is to hold by itself meanwhile. A new command may replace the wait, as it may the mission.
    """

    stops_mission = TAKES_BACK
    mission = TAKES_BACK
    why_not_pausable = "it stops a mission"
    unseen = _ONCE_SEEN
    overrules_nobody = True

    def __init__(
        self,
        name: str,
        seen_mode: str,
        modes: tuple[str, str] | None,
        hold: Callable[[], Future[None]],
        stop: StopIn,
        refused: UalError | None = None,
    ) -> None:
        """`seen_mode` is the one in which what it replaces was seen last; empty if it never was. `modes` are those in
        which the autopilot flies the mission and holds; None where UAL takes the control back already. `hold` commands
        it to hold its position. `stop` makes what stops the mission. `refused` is why UAL could not take the
        control: the autopilot is to hold by itself, also where it is seen.
        """
        super().__init__(name, None)
        self._seen_mode, self.modes = seen_mode, modes
        self._hold, self._stop, self._refused = hold, stop, refused
        if refused is not None:
            self.mission = "the autopilot is to hold: it has not given UAL the control back from its mission"
        self._failure: UalError | None = None
        self._began_in = ""
        self._seen_s: float | None = None

    @override
    def begins_in(self, mode: str) -> None:
        super().begins_in(mode)
        self.mode_seen = self._seen_mode or mode  # nothing has assessed the present one

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return self._step_blind(lost, snapshot, estimate)
        self._seen_s = snapshot.time_s
        is_own = self._is_own(snapshot)
        if is_own is False:
            return taken(snapshot, self.name)
        if is_own is None or estimate.state is State.TAKING_OFF:
            return Step()
        if self._refused is not None and self.modes is not None and estimate.state is State.FLYING_MANUAL:
            return self._hold_fresh(self._refused, self.modes, snapshot)
        if self.command is not None:
            self.command.withdraw()  # it must not be sent again after what follows it
        handover = self._stop(estimate.state, snapshot, self)
        return Step(has_ended=True) if handover is None else Step(handover=handover)

    def _step_blind(self, lost: UalError, snapshot: Snapshot, estimate: Estimate) -> Step:
        if self._seen_s is None:
            self._seen_s = snapshot.time_s
        mode = snapshot.control.mode
        if estimate.is_link_up and mode is not None and not snapshot.link.conflict:
            self._seen_s = max(self._seen_s, mode.time_s)  # what flies it is known all the time
            if self._is_taken_unseen(snapshot):
                return taken(snapshot, self.name)
        is_long = snapshot.time_s - self._seen_s > LONGEST_LINK_GAP_S
        return failed(type(lost)(f"{lost.message}; {_LEFT_ALONE}", lost.metadata)) if is_long else Step()

    def _is_taken_unseen(self, snapshot: Snapshot) -> bool:
        """Has the autopilot hold, or returns that others have taken it. A failsafe may give it back to the mission."""
        is_own, held_by = self._is_own(snapshot), snapshot.control.held_by
        if is_own is False and not (held_by is not None and held_by.is_failsafe):
            return True
        if is_own and self.modes is not None:
            self._hold_unseen(*self.modes, snapshot)
        if self._failure is not None and not self.has_held:
            self.unseen = self._text_of(self._failure, snapshot.control.mode_name)
        return False

    def _text_of(self, failure: UalError, mode: str) -> str:
        if self.modes is None or mode == self.modes[0]:
            return f"its mission may go on: {failure}; {_REMEDY}"
        replaced = f"its mission was not stopped ({failure}), but {mode} has replaced it"
        return f"{replaced}: take over by hand where that is wrong"

    def _hold_fresh(self, refused: UalError, modes: tuple[str, str], snapshot: Snapshot) -> Step:
        self._hold_unseen(*modes, snapshot)
        if self.has_held:
            return failed(with_advice(refused, "the autopilot holds its position by itself instead"))
        return Step() if self._failure is None else failed(with_advice(refused, f"{self._failure}; {_REMEDY_SEEN}"))

    def _hold_unseen(self, flies: str, holds: str, snapshot: Snapshot) -> None:
        mode, armed, landed = snapshot.control.mode_name, snapshot.control.armed, snapshot.control.landed
        if mode == holds:
            self.has_held, self.unseen = True, _HELD
            return
        is_by_itself = landed is not None and landed.value in _BY_ITSELF
        if mode != flies or is_by_itself or (armed is not None and not armed.value):
            return
        if self.command is None:
            if self.led is not None:
                self.led.hold_mode = holds
            self.command, self.unseen = AutopilotCommand("hold its position"), _HOLDING
            self.command.send(self._hold, snapshot)
        if self._failure is None and (failure := self.command.failure(snapshot)) is not None:
            self._failure = failure
            remedy = _REMEDY if self._refused is None else _REMEDY_SEEN
            logs.event(_log, logging.ERROR, "mission_not_stopped", why=str(failure), remedy=remedy)

    def _is_own(self, snapshot: Snapshot) -> bool | None:
        """Returns whether UAL has led to the present mode, and not others; None while that may still be reported."""
        mode = snapshot.control.mode_name
        # The one that was seen before it began: others may have chosen that of the moment in which it did.
        self._began_in = self._began_in or self._seen_mode or self.mode_begun or mode
        return True if mode == self._began_in and not self.has_held else self.led_to(snapshot)

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        return None  # it has no way
