"""Keeping a UAV on the ground whose autopilot was told to fly a mission."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import RejectedByAutopilotError, UalError
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import COMMAND_PATIENCE_S, AutopilotCommand
from ual_daemon.flight.manoeuvres.arrival import Dwell
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step, failed, taken, why_blind
from ual_daemon.flight.manoeuvres.recover import ENTERED_S
from ual_daemon.flight.policy.jumps import Jump
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Reference

_AGAIN_S = 0.3
"""The shortest time from one command to the next: the mode to which the first has led may show only then."""


class StayOnGround(Manoeuvre):
    """Has the autopilot hold by itself, so that the mission does not lift off after its task has ended."""

    why_not_pausable = "it keeps the UAV on the ground"

    def __init__(self, name: str, mission: AutopilotMission, hold: Callable[[], Future[None]]) -> None:
        """`hold` commands the autopilot to hold its position."""
        super().__init__(name, None)
        self._flies, self._holds = mission.modes
        self._hold = hold
        self._command = self.command = AutopilotCommand("hold its position")
        self._dwell = Dwell(ENTERED_S)
        self._next_s: float | None = None
        """When the command may be sent again."""
        self._flies_s: float | None = None
        """Since when its mode is that of the mission; None while it is another one."""

    def send(self, judged: Snapshot | None = None) -> None:
        """Sends the command. `judged`: see `AutopilotCommand.send`."""
        self._command.send(self._hold, judged)

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return failed(self._command.left_behind(lost))
        mode = snapshot.control.mode_name
        self.mode_begun = self.mode_begun or mode
        if mode not in (self._flies, self._holds, self.mode_begun):
            return taken(snapshot, self.name)
        self._note_mission(snapshot)
        # The mode of the mission may come late, by the command from before.
        if self._dwell.has_held(snapshot.time_s, holds=mode == self._holds and self._command.is_answered):
            return Step(has_ended=True)
        failure = self._command.failure(snapshot) or self._why_stuck(snapshot)
        if failure is not None:
            return failed(failure)
        if mode == self._flies and self._command.is_accepted:
            self._send_anew(snapshot)
        return Step()

    def _note_mission(self, snapshot: Snapshot) -> None:
        if self._next_s is None:
            self._next_s = snapshot.time_s + _AGAIN_S
        if snapshot.control.mode_name != self._flies:
            self._flies_s = None
        elif self._flies_s is None:
            self._flies_s = snapshot.time_s

    def _why_stuck(self, snapshot: Snapshot) -> UalError | None:
        """Returns that the autopilot accepts to hold again and again, and does not; None if that is not so."""
        if self._flies_s is None or snapshot.time_s - self._flies_s <= COMMAND_PATIENCE_S:
            return None
        what, mode = self._command.what, self._flies
        return RejectedByAutopilotError(f"the autopilot accepted to {what}, but is in mode {mode}, and may take off")

    def _send_anew(self, snapshot: Snapshot) -> None:
        assert self._next_s is not None
        if snapshot.time_s < self._next_s:
            return
        self._next_s = snapshot.time_s + _AGAIN_S
        self._command = self.command = AutopilotCommand(self._command.what)
        self.send()

    @override
    def estimate_jumped(self, jump: Jump, stop: Reference) -> UalError | None:
        return None  # it has no way
