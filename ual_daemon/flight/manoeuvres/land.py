"""Landing: straight down, by the autopilot's own landing."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import TypeAlias

from typing_extensions import override

from ual.errors import UalError, UalTimeoutError
from ual.types import State
from ual_daemon.backends.values import Control, LandedState, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.manoeuvre import (
    TIMEOUT_MARGIN_S,
    LedTo,
    Manoeuvre,
    Step,
    failed,
    taken,
    why_blind,
    with_advice,
)
from ual_daemon.flight.manoeuvres.progress_watch import ProgressWatch
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.policy.touch_down import TouchDown
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.references import Reference, measured_motion

SLOWEST_LANDING_M_S = 0.2
_REFUSED = "the UAV holds its position: command land again, or let the safety pilot land it by hand"
_REFUSED_WITHOUT_PILOT = "the UAV holds its position: command land again"
_STUCK = (
    "its safety pilot takes over and lands it by hand; or select another mode of the autopilot at the ground station, "
    "and command land again"
)
_STUCK_WITHOUT_PILOT = "abort ends the landing, and the UAV holds its position; then command land again"

_GOES_ON = "the autopilot had begun to land, and goes on by itself: look at the state"

OnHeight: TypeAlias = Callable[[float], None]
"""Gets the z of a landing UAV in the local frame, at each update that has a position."""


def ignore_height(_: float) -> None:
    """Nothing depends on it."""


class Landing(Manoeuvre):
    """A landing at the present position, however it is flown."""

    declares = State.LANDING
    is_replaceable = False

    def __init__(
        self,
        task: VehicleTask,
        reference: Reference | None,
        start: Snapshot,
        name: str,
        on_height: OnHeight,
        *,
        has_safety_pilot: bool,
    ) -> None:
        """`reference` is followed until the descent begins; None where the autopilot flies by itself already."""
        super().__init__(name, task)
        self._reference: Reference | None = reference
        self._begun_s = start.time_s
        self._start_z = measured_motion(start).position.z
        self._refused = _REFUSED if has_safety_pilot else _REFUSED_WITHOUT_PILOT
        self._stuck = _STUCK if has_safety_pilot else _STUCK_WITHOUT_PILOT
        self._descent = ProgressWatch(task, self._stuck, is_up=False)
        self._on_height = on_height
        self._touch_down = TouchDown()

    def _watch_descent(self, snapshot: Snapshot) -> UalError | None:
        """Watches a descent that has begun; see `_why_too_late`."""
        z_m = measured_motion(snapshot).position.z
        self._descent.observe(z_m, snapshot.time_s)
        self._on_height(z_m)
        return self._why_too_late(snapshot)

    @property
    def _slowest_m_s(self) -> float:
        """The mean speed below which it has stopped."""
        return SLOWEST_LANDING_M_S

    def _why_too_late(self, snapshot: Snapshot) -> UalError | None:
        """Returns that the UAV has descended more slowly than any landing does; None if it has not."""
        descended_m = self._start_z - measured_motion(snapshot).position.z
        longest_s = descended_m / self._slowest_m_s + 3 * TIMEOUT_MARGIN_S
        if snapshot.time_s - self._begun_s <= longest_s:
            return None
        return UalTimeoutError(f"land: the UAV has stopped descending, but reports no ground; {self._stuck}")

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        self._start_z += jump.offset.z
        self._descent.moved(jump.offset.z)
        if self._reference is not None:
            self._reference = stop
        return None

    @override
    def current_reference(self) -> Reference | None:
        return self._reference


def _goes_on(lost: UalError) -> UalError:
    return type(lost)(f"{lost.message}; {_GOES_ON}", lost.metadata)


class LandManoeuvre(Landing):
    """A landing by the autopilot's own landing."""

    def __init__(
        self,
        task: VehicleTask,
        command: AutopilotCommand,
        reference: Reference | None,
        start: Snapshot,
        name: str = "land",
        on_height: OnHeight = ignore_height,
        *,
        has_safety_pilot: bool = True,
        send: Callable[[], Future[None]] | None = None,
    ) -> None:
        """`send` sends the command again, in a mode to which UAL itself has led; None where there is no such mode."""
        super().__init__(task, reference, start, name, on_height, has_safety_pilot=has_safety_pilot)
        self._send = send
        self._led_to: LedTo = super().led_to
        self._command = self.command = command
        self._is_landing = False
        self._began_in = None if reference is not None or start.control.mode is None else start.control.mode.value.name

    @override
    def replaces(self, old: Manoeuvre) -> None:
        self._led_to = old.led_to

    def _begin_anew(self, snapshot: Snapshot) -> None:
        """Begins in the mode to which UAL itself has led: the command from before it does not hold any more."""
        self._began_in = snapshot.control.mode_name
        if self._send is not None:
            self._command.withdraw()
            self._command = self.command = AutopilotCommand(self._command.what)
            self._command.send(self._send)

    @override
    def await_cause(self, snapshot: Snapshot) -> None:
        mode = snapshot.control.mode
        if mode is not None and mode.value.control is Control.LAND:
            self._is_landing, self._reference = True, None

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        lost = why_blind(estimate, self.name)
        if lost is not None:
            return failed(_goes_on(lost) if self._is_landing else self._command.left_behind(lost))
        if estimate.state in (State.LANDED_ARMED, State.LANDED_DISARMED):
            return Step(has_ended=self._touch_down.has_landed(snapshot, estimate))
        assert snapshot.control.mode is not None
        control = snapshot.control.mode.value.control
        landed = LandedState.UNKNOWN if snapshot.control.landed is None else snapshot.control.landed.value
        if not self._is_landing:
            if control is Control.LAND or landed is LandedState.LANDING:
                self._is_landing, self._reference = True, None
            elif control is not Control.REFERENCES and snapshot.control.mode.value.name != self._began_in:
                is_own = self._led_to(snapshot)
                if is_own is False:
                    return taken(snapshot, self.name)  # first: the command may have failed because of that
                if is_own:
                    self._begin_anew(snapshot)
            elif (failure := self._command.failure(snapshot)) is not None:
                return failed(with_advice(failure, self._refused))
            elif self._reference is not None:  # it must not lose its references before it lands by itself
                return Step(self._reference.setpoint(snapshot))
        elif control is not Control.LAND and landed is not LandedState.LANDING:
            return taken(snapshot, self.name)
        late = self._watch_descent(snapshot) if self._is_landing else self._why_too_late(snapshot)
        return Step() if late is None else failed(late)
