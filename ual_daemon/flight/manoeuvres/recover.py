"""Taking control back: from the safety pilot, or from an autopilot that takes off or lands by itself."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

from typing_extensions import override

from ual.errors import TaskAbortedError, UalError
from ual.types import State
from ual_daemon.backends.values import Control, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.manoeuvre import (
    Handover,
    Manoeuvre,
    Step,
    failed,
    taken,
    takes_back,
    why_blind,
    with_advice,
)
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.references import Hold, Reference, measured_motion

TAKES_BACK = "UAL takes the control back from its mission"
MODE_ENTRY_S = 1.5
"""Seconds after a command of UAL within which the autopilot may still enter the mode to which that led."""

Refusal = Callable[[Snapshot], UalError | None]


class Recover(Manoeuvre):
    """Takes control back. Holds the present pose until the mode has changed, and then stops.

    While it is not known yet what took the UAV, nothing is sent: it may be a failsafe, which is not overridden.
    """

    is_replaceable = False

    def __init__(
        self,
        command: AutopilotCommand,
        take_control: Callable[[], Future[None]],
        refusal: Refusal,
        *,
        name: str = "recover_from_manual",
        task: VehicleTask | None = None,
        out_of: State = State.FLYING_MANUAL,
        is_early: bool = False,
    ) -> None:
        """`take_control` sends the command; `refusal` returns why it may not be sent by a snapshot, None if it may.

        `out_of` is the state that it is to leave for FLYING_AUTO. `is_early`: the autopilot may just be entering the
        mode out of which it is to be taken, by an earlier command of UAL.
        """
        super().__init__(name, task)
        self._is_early = is_early
        self._begun_s: float | None = None
        self._out_of = out_of
        self._command = self.command = command
        self._take_control = take_control
        self._refusal = refusal
        self._is_sent = False
        self._began_in = ""

    def send(self, judged: Snapshot | None = None) -> None:
        """Sends the command, once. `judged`: see `AutopilotCommand.send`."""
        self._is_sent = True
        if self.led is not None:
            self.led.is_control_taken = True
        self._command.send(self._take_control, judged)

    @override
    def replaces(self, old: Manoeuvre) -> None:
        if not (old.mission or old.stops_mission):
            return
        # The state is FLYING_AUTO meanwhile: nobody took the UAV. A next command may replace it, as it may the mission.
        self.mission, self.is_replaceable = TAKES_BACK, True
        self.led = old.leads()

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return failed(self._command.left_behind(lost))
        if estimate.state is State.FLYING_AUTO and self._may_still_enter(snapshot):
            return self._hold(snapshot)
        if estimate.state is State.FLYING_AUTO:
            return Step(has_ended=True, is_to_stop=True)
        if self._out_of is State.TAKING_OFF and (step := self._step_take_off(snapshot, estimate.state)) is not None:
            return step
        is_elsewhere = estimate.state is not self._out_of and not self._has_climbed(estimate.state)
        if is_elsewhere and not self._is_landing_of_mission(estimate.state, snapshot):
            return failed(
                TaskAbortedError(
                    f"{self.name}: the state became {estimate.state.name}",
                    {"by": "autopilot", "state": estimate.state.name},
                )
            )
        # That of its command, even where the next mode was seen before its first step.
        begun = "" if self._is_early else self.mode_begun
        self._began_in = self._began_in or begun or snapshot.control.mode_name
        if snapshot.control.mode_name != self._began_in:  # a repeated command would take control from the pilot
            is_own = self.led_to(snapshot)
            if is_own is None:
                return self._hold(snapshot)
            if not is_own:
                return taken(snapshot, self.name)
            self._begin_anew(snapshot)
        if not self._is_sent:  # `Flight` steps it once it is known what took the UAV
            refusal = self._refusal(snapshot)
            if refusal is not None:
                return failed(refusal)
            self.send()
        failure = self._command.failure(snapshot)
        if failure is not None:
            return failed(failure if self.task is None or not self.mission else with_advice(failure, _stays(snapshot)))
        return self._hold(snapshot)

    def _step_take_off(self, snapshot: Snapshot, state: State) -> Step | None:
        """Holds while the take-off is still told that UAL has ended, and on the ground that it had not left yet.

        Returns None where it is as in the air.
        """
        held, mode = self._hold(snapshot), snapshot.control.mode
        is_ours = self._is_sent and mode is not None and mode.value.control is Control.REFERENCES
        if state is State.TAKING_OFF:
            return held if is_ours else None
        if state is not State.LANDED_ARMED:
            return None
        if is_ours:  # disarm and take_off may follow
            motion = measured_motion(snapshot)
            return held._replace(has_ended=True, next_reference=Hold(motion.position, motion.yaw_rad))
        failure = self._command.failure(snapshot)
        return held if failure is None else failed(failure)

    def _has_climbed(self, state: State) -> bool:
        """Returns whether the take-off out of which it is taken has ended meanwhile."""
        return self._out_of is State.TAKING_OFF and state is State.FLYING_MANUAL

    def _is_landing_of_mission(self, state: State, snapshot: Snapshot) -> bool:
        """Returns whether the mission out of which it is taken began to return or to land just now.

        To end there would leave an autopilot without references that obeys all the same.
        """
        if state is not State.LANDING or not self.mission:
            return False
        return snapshot.control.mode_name == (self._began_in or self.mode_begun) or self.led_to(snapshot) is not False

    def _begin_anew(self, snapshot: Snapshot) -> None:
        """Begins in the mode to which UAL itself has led: the command from before it does not hold any more."""
        self._command.withdraw()
        self._command = self.command = AutopilotCommand(self._command.what)
        self._began_in, self._is_sent = snapshot.control.mode_name, False

    def _may_still_enter(self, snapshot: Snapshot) -> bool:
        self._begun_s = snapshot.time_s if self._begun_s is None else self._begun_s
        return self._is_early and not self._is_sent and snapshot.time_s - self._begun_s < MODE_ENTRY_S

    def _hold(self, snapshot: Snapshot) -> Step:
        motion = measured_motion(snapshot)
        return Step(Hold(motion.position, motion.yaw_rad).setpoint(snapshot))

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        return None  # it holds the present pose, wherever that is


class RecoverFirst(Recover):
    """Takes control back from the autopilot itself, and hands over to the manoeuvre that was commanded."""

    is_replaceable = True
    why_not_pausable = "it takes control back first"

    def __init__(
        self,
        task: VehicleTask,
        name: str,
        command: AutopilotCommand,
        take_control: Callable[[], Future[None]],
        refusal: Refusal,
        onward: Callable[[Snapshot], Manoeuvre],
        *,
        is_early: bool = False,
    ) -> None:
        """`onward` makes the manoeuvre that begins in a snapshot; where it raises, the UAV stops and holds."""
        super().__init__(command, take_control, refusal, name=name, task=task, is_early=is_early)
        self._onward = onward

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        step = super().step(snapshot, estimate)
        if not step.has_ended or step.error is not None:
            return step
        try:
            return Step(handover=Handover(self._onward(snapshot)))
        except UalError as error:
            return step._replace(error=error)


def _stays(snapshot: Snapshot) -> str:
    """The mission may go on, or have ended in another mode: the mode says which."""
    mode = snapshot.control.mode_text
    return f"the autopilot stays in its mode ({mode}) and flies by itself: {takes_back(None)}"
