"""Taking the control back from a mission that was stopped in the air."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.types import State
from ual_daemon.backends.values import Control, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.await_stop import HoldInstead, StopIn
from ual_daemon.flight.manoeuvres.manoeuvre import Step
from ual_daemon.flight.manoeuvres.recover import TAKES_BACK, Recover
from ual_daemon.flight.state import Estimate

_ELSEWHERE = (State.LANDED_ARMED, State.TAKING_OFF, State.UNINITIALIZED)
"""In these the mission is stopped in another way: an autopilot may tell them for a moment as it lifts off."""


class StopInAir(Recover):
    """Takes the control back; see `Recover`. Hands over where the mission is not in the air any more, or not seen."""

    stops_mission = TAKES_BACK

    def __init__(
        self,
        name: str,
        seen_mode: str,
        modes: tuple[str, str] | None,
        take_control: Callable[[], Future[None]],
        stop: StopIn,
        hold_instead: HoldInstead,
        *,
        is_early: bool,
    ) -> None:
        """`seen_mode` and `modes`: see `AwaitStop`; `is_early`: see `Recover`. `stop` makes what stops the mission in
        another state, and `hold_instead` what follows where the control is not given.
        """
        command = AutopilotCommand("take our references")
        super().__init__(command, take_control, lambda _: None, name=name, is_early=is_early)
        self._seen_mode, self.modes, self._stop = seen_mode, modes, stop
        self._hold_instead = hold_instead

    @override
    def begins_in(self, mode: str) -> None:
        super().begins_in(self._seen_mode or mode)  # nothing has assessed the present one

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        if estimate.state in _ELSEWHERE and self._may_fly_mission(snapshot):
            handover = self._stop(estimate.state, snapshot, self)
            if handover is not None:
                return Step(handover=handover)
        step = super().step(snapshot, estimate)
        flies_on = self.modes is not None and snapshot.control.mode_name == self.modes[0]
        if step.error is None or step.is_taken or not flies_on or estimate.state is not State.FLYING_MANUAL:
            return step
        return Step(handover=self._hold_instead(step.error, self))

    def _may_fly_mission(self, snapshot: Snapshot) -> bool:
        """Returns whether the autopilot may still fly the mission, in the mode in which it did."""
        mode = snapshot.control.mode
        if mode is None or mode.value.name == (self._began_in or self.mode_begun or mode.value.name):
            return True
        return mode.value.control is not Control.REFERENCES and bool(self.led_to(snapshot))
