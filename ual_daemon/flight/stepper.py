"""Makes the updates of what is flown: fits it, steps it, sends its setpoint, and begins what follows it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from typing import TypeAlias

from ual.errors import UalError, UalTimeoutError, WrongStateError
from ual.types import Capability, State
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.values import Cause, Control, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.current_manoeuvre import SILENT, CurrentManoeuvre, Ending
from ual_daemon.flight.fitting import Fitting
from ual_daemon.flight.manoeuvres.fly_reference import HOLDS, FlyReference, ReferenceRules
from ual_daemon.flight.manoeuvres.manoeuvre import Handover, Manoeuvre, Step, guarded
from ual_daemon.flight.setpoint_sender import SetpointSender
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.stopping import Stopping, motion_if_near
from ual_daemon.flight.watched_commands import WatchedCommands
from ual_daemon.tracker.drift import Before
from ual_daemon.tracker.references import Reference, Velocity

_log = logging.getLogger(__name__)

Swap: TypeAlias = Callable[[Manoeuvre | None, Callable[[Manoeuvre | None], Ending | None]], bool]
"""See `ual_daemon.flight.flight.Flight`."""


class FlightStepper:
    """Steps what one UAV flies. Only the update thread calls it."""

    def __init__(
        self,
        backend: Backend,
        flown: CurrentManoeuvre,
        swap: Swap,
        rules: ReferenceRules,
        sender: SetpointSender,
        stopping: Stopping,
        watched: WatchedCommands,
    ) -> None:
        self._backend = backend
        self._flown = flown
        self._swap = swap
        self._rules = rules
        self._sender = sender
        self._stopping = stopping
        self._watched = watched
        self._fitting = Fitting(backend, rules.limits, rules.geofence)
        self._current: Reference | None = None
        self._before: Before = _nothing_before
        """The motion of that reference, where the UAV is near it."""

    def update(self, snapshot: Snapshot, raw: Estimate) -> None:
        """Makes one update. `raw` is the state that the data show, without what is flown."""
        self._prepare_velocity(snapshot)
        manoeuvre = self._flown.manoeuvre
        if manoeuvre is not None and raw.state is not State.UNINITIALIZED:
            step = self._fitting.step(manoeuvre, snapshot)
            if step is not None:
                self._do(manoeuvre, step, snapshot)
        self._step(snapshot, raw)

    def _prepare_velocity(self, snapshot: Snapshot) -> None:
        """Takes note of what is flown while no velocity is: the next velocity begins with its place and motion."""
        manoeuvre = self._flown.manoeuvre
        current = None if manoeuvre is None else manoeuvre.current_reference()
        if current is None:
            self.forget()
        elif not isinstance(current, Velocity):
            if current is not self._current:
                self._current, self._before = current, partial(motion_if_near, current)
            self._rules.drift.stand_by(self._before, snapshot)

    def forget(self) -> None:
        """Forgets what was flown before a velocity: it keeps a whole trajectory alive."""
        self._rules.drift.forget()
        self._current, self._before = None, _nothing_before

    def _step(self, snapshot: Snapshot, raw: Estimate) -> None:
        """Steps what is flown, and where that ends, the reference that follows it."""
        manoeuvre = self._flown.manoeuvre
        if manoeuvre is not None and self._step_one(manoeuvre, snapshot, raw):
            return
        follower = self._flown.manoeuvre or self._begin_stop(manoeuvre, snapshot, raw)
        if follower is not None and not follower.is_awaited:  # another thread may have begun something: the next update
            self._step_one(follower, snapshot, raw)

    def _begin_stop(self, ended: Manoeuvre | None, snapshot: Snapshot, raw: Estimate) -> Manoeuvre | None:
        """Stops a UAV that is UAL's to fly while nothing is flown. Returns None where it is not, or something is.

        `ended` is what was flown until now. It may be a stop that has a defect: the next one follows it no more.
        """
        if not self._rules.may_send(snapshot, raw, is_begun=False):
            return None
        current = None if ended is None or not ended.is_awaited else ended.current_reference()
        stop = FlyReference("stop", self._stopping.stop_here(current, snapshot), self._rules)
        return stop if self._swap(stop, lambda old: SILENT if old is None else None) else None

    def _step_one(self, manoeuvre: Manoeuvre, snapshot: Snapshot, raw: Estimate) -> bool:
        """Steps a manoeuvre. Returns False if it has just ended."""
        if manoeuvre.is_awaited and snapshot.control.held_by is Cause.OPEN and raw.is_link_up:
            # Nothing is sent; what took the UAV is known within a moment, and then ends the manoeuvre.
            _withdraw_older(manoeuvre, snapshot)
            manoeuvre.await_cause(snapshot)
            return True
        step = guarded(manoeuvre, manoeuvre.step, snapshot, raw)
        if self._flown.manoeuvre is not manoeuvre and manoeuvre.command is not None:
            manoeuvre.command.withdraw()  # another thread has replaced it, perhaps before its step sent this
        if manoeuvre.is_awaited and not step.is_taken and raw.state is not State.UNINITIALIZED:
            # Not where a command in this moment must see what took it, and not where no step has assessed the mode.
            mode = snapshot.control.mode
            if mode is None or mode.value.name != manoeuvre.mode_seen:  # else it stays, settled or not
                manoeuvre.mode_seen = snapshot.control.settled_mode or manoeuvre.mode_seen
        return self._do(manoeuvre, step, snapshot)

    def _do(self, manoeuvre: Manoeuvre, step: Step, snapshot: Snapshot) -> bool:
        """Does what a step of a manoeuvre results in. Returns False if the manoeuvre has just ended."""
        if step.handover is not None:
            self._hand_over(manoeuvre, step.handover, snapshot)
            return True
        if not step.has_ended:
            if step.setpoint is not None:
                self._sender.send_if_due(manoeuvre, step.setpoint, snapshot)
            return True
        if not self._swap(self._follower(manoeuvre, step, snapshot), partial(self._ends, manoeuvre, step, snapshot)):
            return True
        if step.is_autopilot_to_hold:
            self._leave_to_autopilot(snapshot, manoeuvre.name, is_to_land=step.is_autopilot_to_land)
        return False

    def _follower(self, manoeuvre: Manoeuvre, step: Step, snapshot: Snapshot) -> Manoeuvre | None:
        """Returns what is flown after a manoeuvre; None to stop from the motion that the UAV has."""
        reference = step.next_reference
        is_down = step.error is not None and not step.is_taken and has_led_to_ground(manoeuvre, snapshot)
        if step.is_to_stop or is_down:
            reference = self._stopping.stop(manoeuvre.current_reference(), snapshot)
        if reference is None:
            return None
        is_untold = step.error is not None and not manoeuvre.is_awaited
        trouble = f"it does not follow: {step.error}; {HOLDS}" if is_untold else ""
        return FlyReference(manoeuvre.name, reference, self._rules, trouble)

    def _ends(self, manoeuvre: Manoeuvre, step: Step, snapshot: Snapshot, old: Manoeuvre | None) -> Ending | None:
        if old is not manoeuvre:
            return None  # replaced by another thread, which also ends it
        if manoeuvre.is_paused and step.error is None:
            return None  # paused by another thread during the step
        if manoeuvre.is_awaited:
            by = "" if step.error is None else step.error.metadata.get("by", "")
            left_to = "" if not step.is_autopilot_to_hold else "land" if step.is_autopilot_to_land else "hold by itself"
            self._rules.authority.end(snapshot, is_taken=step.is_taken, left_to=left_to, by=by)
        return Ending(_with_other_sender(step.error, snapshot))

    def _hand_over(self, manoeuvre: Manoeuvre, to: Handover, snapshot: Snapshot) -> None:
        """Makes another manoeuvre go on with the task, unless another thread has replaced or paused it."""
        to.manoeuvre.begins_in(snapshot.control.settled_mode)
        goes_on = Ending(goes_on=True)
        if self._swap(to.manoeuvre, lambda old: goes_on if old is manoeuvre and not manoeuvre.is_paused else None):
            to.begin()
        else:  # what makes it hand over may have come while it was paused, and counts once it goes on
            manoeuvre.is_fitted = False

    def _leave_to_autopilot(self, snapshot: Snapshot, during: str, *, is_to_land: bool) -> None:
        """Commands the autopilot to hold its position by itself, or to land on the spot, until it has left the mode in
        which it obeys UAL.

        It must not be sent after that: the safety pilot may have taken over.
        """
        if _is_control_released(snapshot):
            return
        info = self._backend.info()
        command, event = AutopilotCommand("hold its position"), "hold_by_autopilot"
        send: Callable[[], Future[None]] = self._backend.hold
        if is_to_land and Capability.LAND in info.capabilities and not info.flies_landing_on_setpoints:
            command, event = AutopilotCommand("land"), "land_by_autopilot"
            send = partial(self._backend.land, self._rules.limits.get())
        logs.event(_log, logging.WARNING, event, why=f"{during} was stopped")
        with suppress(WrongStateError):  # UAL is shutting down
            self._watched.add(command, _is_control_released)
        command.send(send, snapshot)


def _nothing_before(_: Snapshot) -> None:
    """No reference is flown."""


def has_led_to_ground(manoeuvre: Manoeuvre, snapshot: Snapshot) -> bool:
    """Returns whether a manoeuvre has led the UAV to the ground by references, which the autopilot still follows.

    It must not lose its stream there before it disarms; see `ReferenceRules`.
    """
    control = snapshot.control
    if not control.is_on_ground or control.armed is None or not control.armed.value:
        return False
    is_led = manoeuvre.declares is None and manoeuvre.current_reference() is not None
    return is_led and control.mode is not None and control.mode.value.control is Control.REFERENCES


def _is_control_released(snapshot: Snapshot) -> bool:
    """Returns whether the autopilot is in a mode in which it does not obey UAL."""
    return snapshot.control.mode is not None and snapshot.control.mode.value.control not in (
        Control.REFERENCES,
        Control.TAKE_OFF,
    )


def _withdraw_older(manoeuvre: Manoeuvre, snapshot: Snapshot) -> None:
    """Withdraws the command that was sent before the mode changed: repeated, it would change that again."""
    is_older = manoeuvre.mode_seen not in ("", snapshot.control.mode_name)
    if is_older and manoeuvre.command is not None and manoeuvre.command.is_sent:
        manoeuvre.command.withdraw()


def _with_other_sender(error: UalError | None, snapshot: Snapshot) -> UalError | None:
    """Returns an error that also names another program's setpoints, which may be why it did not get there."""
    if not snapshot.control.other_sender or not isinstance(error, UalTimeoutError):
        return error
    return UalTimeoutError(f"{error}; {snapshot.control.other_sender}", {**error.metadata, "other_sender": "true"})
