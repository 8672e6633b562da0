"""Keeping a UAV on the ground whose autopilot was commanded to fly a mission."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import RejectedByAutopilotError, UalError
from ual.types import State
from ual_daemon.backends.values import Cause, Snapshot
from ual_daemon.flight.autopilot_command import COMMAND_PATIENCE_S, AutopilotCommand
from ual_daemon.flight.manoeuvres.arrival import Dwell
from ual_daemon.flight.manoeuvres.await_stop import StopIn
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step, failed, taken
from ual_daemon.flight.manoeuvres.recover import MODE_ENTRY_S, TAKES_BACK
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Reference

_COMMAND_RETRY_S = 0.3
"""The shortest time from one command to the next: the mode to which the first has led may show only then."""
LIFTS_OFF_S = 8.0
"""Seconds after it has begun to hold within which the autopilot may yet lift off. PX4 raises the thrust for up to 5 s
(MPC_TKO_RAMP_T) once it has begun to, whatever the mode is then.
"""
_LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)
_UNTOLD = (None, Cause.OPEN)


class StayOnGround(Manoeuvre):
    """Has the autopilot hold by itself, so that the mission does not lift off after its task has ended.

    Where it lifts off all the same, UAL takes the control back: the flight is its own.
    """

    stops_mission = TAKES_BACK
    why_not_pausable = "it keeps the UAV on the ground"

    def __init__(self, name: str, modes: tuple[str, str], hold: Callable[[], Future[None]], stop: StopIn) -> None:
        """`modes` are those in which the autopilot flies it and holds. `hold` commands it to hold its position. `stop`
        makes what stops it in the air, or once it is seen.
        """
        super().__init__(name, None)
        self._flies, self._holds = self.modes = modes
        self._hold, self._stop = hold, stop
        self._command = self.command = AutopilotCommand("hold its position")
        self._dwell = Dwell(LIFTS_OFF_S)
        self._held_s: float | None = None
        """Time at which the autopilot first held by the command."""
        self._next_s: float | None = None
        """Time from which the command may be sent again."""
        self._flies_s: float | None = None
        """Since when its mode is that of the mission; None while it is another one."""

    def send(self, judged: Snapshot | None = None) -> None:
        """Sends the command. `judged`: see `AutopilotCommand.send`."""
        if self.led is not None:
            self.led.hold_mode = self._holds
        self._command.send(self._hold, judged)

    @override
    def await_cause(self, snapshot: Snapshot) -> None:
        self._note_mode(snapshot.control.mode_name, snapshot)

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        mode = snapshot.control.mode_name
        self.mode_begun = self.mode_begun or mode
        self._note_mode(mode, snapshot)
        if mode and self._is_theirs(mode, snapshot):
            return taken(snapshot, self.name)
        if estimate.state in (State.FLYING_MANUAL, State.UNINITIALIZED):
            return self._stop_otherwise(snapshot, estimate)
        # The mode of the mission may come late, by the command from before.
        if mode == self._holds and self._command.is_accepted:
            has_held = self._dwell.has_held(snapshot.time_s, holds=True) or estimate.state is State.LANDED_DISARMED
            return Step(has_ended=has_held and estimate.state in _LANDED)
        self._dwell.has_held(snapshot.time_s, holds=False)
        failure = self._command.failure(snapshot) or self._why_stuck(snapshot)
        if failure is not None:
            return failed(failure) if estimate.state in _LANDED else self._stop_otherwise(snapshot, estimate, failure)
        if mode == self._flies and self._command.is_accepted:
            self._send_anew(snapshot)
        return Step()

    def _stop_otherwise(self, snapshot: Snapshot, estimate: Estimate, failure: UalError | None = None) -> Step:
        """Hands over to what stops the mission in the air, or while the autopilot is not seen."""
        self.mission = TAKES_BACK
        self._command.withdraw()  # it must not be sent again after what follows it
        handover = self._stop(estimate.state, snapshot, self)
        return Step(has_ended=True, error=failure) if handover is None else Step(handover=handover)

    def _note_mode(self, mode: str, snapshot: Snapshot) -> None:
        if self._next_s is None:
            self._next_s = snapshot.time_s + _COMMAND_RETRY_S
        if self._held_s is None and mode == self._holds and self._command.is_accepted:
            self._held_s = snapshot.time_s
        if mode != self._flies:
            self._flies_s = None
        elif self._flies_s is None:
            self._flies_s = snapshot.time_s

    def _is_theirs(self, mode: str, snapshot: Snapshot) -> bool:
        """Returns whether others have chosen the mode. UAL led to those of the mission and of the hold; its command for
        the mission may be executed late, but then nothing shows that others chose it.
        """
        if mode == self._holds:
            return False
        if self._held_s is None:
            return mode not in (self._flies, self.mode_begun)
        is_late = self._flies_s is not None and self._flies_s - self._held_s > MODE_ENTRY_S
        return self._flies_s is None or is_late or snapshot.control.held_by not in _UNTOLD

    def _why_stuck(self, snapshot: Snapshot) -> UalError | None:
        """Returns that the autopilot accepts to hold repeatedly, and does not; None if that is not so."""
        if self._flies_s is None or snapshot.time_s - self._flies_s <= COMMAND_PATIENCE_S:
            return None
        what, mode = self._command.what, self._flies
        return RejectedByAutopilotError(f"the autopilot accepted to {what}, but is in mode {mode}, and may take off")

    def _send_anew(self, snapshot: Snapshot) -> None:
        assert self._next_s is not None
        if snapshot.time_s < self._next_s:
            return
        self._next_s = snapshot.time_s + _COMMAND_RETRY_S
        self._command = self.command = AutopilotCommand(self._command.what)
        self.send()

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        return None  # it has no way
