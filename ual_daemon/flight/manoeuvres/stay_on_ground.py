"""Keeping a UAV on the ground whose autopilot was told to fly a mission."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import UalError
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.arrival import Dwell
from ual_daemon.flight.manoeuvres.autopilot_mission import AutopilotMission
from ual_daemon.flight.manoeuvres.manoeuvre import Manoeuvre, Step, failed, taken, why_blind
from ual_daemon.flight.manoeuvres.recover import ENTERED_S
from ual_daemon.flight.policy.jumps import Jump
from ual_daemon.flight.state import Estimate
from ual_daemon.tracker.references import Reference


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
        # The mode of the mission may come late, by the command from before.
        if self._dwell.has_held(snapshot.time_s, holds=mode == self._holds and self._command.is_answered):
            return Step(has_ended=True)
        if mode == self._flies and self._command.is_accepted:
            self._send_anew()
        failure = self._command.failure(snapshot)
        return Step() if failure is None else failed(failure)

    def _send_anew(self) -> None:
        self._command = self.command = AutopilotCommand(self._command.what)
        self.send()

    @override
    def estimate_jumped(self, jump: Jump, stop: Reference) -> UalError | None:
        return None  # it has no way
