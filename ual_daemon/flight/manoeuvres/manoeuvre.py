"""The base of all manoeuvres: take-off, landing, following a trajectory, taking control back, sending a reference.

The update thread steps a manoeuvre at each update, with the newest snapshot. The step returns a setpoint to send and,
once, how the manoeuvre ended. It never blocks and sends nothing itself.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, ParamSpec, TypeAlias, TypeVar

from ual.errors import LinkLostError, TaskAbortedError, UalError, UalTimeoutError
from ual.geometry import Vector3
from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.values import Cause, Control, LandedState, Setpoint, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.futures import end_future, running_future
from ual_daemon.flight.policy.autopilot_fence import breach_text
from ual_daemon.flight.policy.following import ENDS_TERMINATION
from ual_daemon.flight.policy.geofence import GeofencePolicy
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import VehicleTask
from ual_daemon.tracker.limits import CurrentLimits
from ual_daemon.tracker.references import Reference

_log = logging.getLogger(__name__)

LedTo: TypeAlias = Callable[[Snapshot], bool | None]
"""Returns whether the present mode came by what UAL had made the autopilot do, and not by others. None: that may still
be reported."""


@dataclass(slots=True, eq=False)
class Led:
    """Modes to which UAL has led since a mission was flown.

    What stops the mission shares one record, and so does what replaces that. Otherwise each would keep the one before,
    and a link that is lost repeatedly would make the chain ever longer.

    Attributes:
        by_mission: Whether the mission led to a mode.
        hold_mode: The mode to which the hold leads that was commanded; empty while none was.
        is_control_taken: Whether the control was commanded back.
    """

    by_mission: LedTo
    hold_mode: str = ""
    is_control_taken: bool = False

    def to(self, snapshot: Snapshot) -> bool | None:
        """Returns whether UAL led to the present mode; see `LedTo`."""
        control = snapshot.control
        if control.mode is not None and self.is_control_taken and control.mode.value.control is Control.REFERENCES:
            return True
        is_hold = bool(self.hold_mode) and control.mode_name == self.hold_mode
        if is_hold and control.held_by in (None, Cause.OPEN):
            return None if control.held_by is Cause.OPEN else True
        return self.by_mission(snapshot)  # it may hold at its end, too


P = ParamSpec("P")
T = TypeVar("T")

TIMEOUT_FACTOR = 3.0
"""A manoeuvre may take this many times as long as planned, ..."""
TIMEOUT_MARGIN_S = 20.0
"""... and this much longer."""


class Step(NamedTuple):
    """The result of one step of a manoeuvre.

    Attributes:
        setpoint: The setpoint to send; None to send none.
        has_ended: Whether the manoeuvre has ended.
        error: The error with which it has ended; None if it has succeeded.
        next_reference: The reference to follow after it; None to stop at the present position.
        handover: The manoeuvre that goes on with its task; None while it goes on itself, and where it has ended.
        is_autopilot_to_hold: Whether the autopilot is to hold its position by itself from now on.
        is_autopilot_to_land: Whether that is rather to land on the spot, where it has a landing of its own.
        is_taken: Whether it has ended because others took the UAV, to which UAL then sends nothing.
        is_to_stop: Whether the UAV is to come to rest from the motion that it was sent, inside the geofence where that
            is possible. Without, and without a `next_reference`, it stops from the motion that it has.

    """

    setpoint: Setpoint | None = None
    has_ended: bool = False
    error: UalError | None = None
    next_reference: Reference | None = None
    handover: Handover | None = None
    is_autopilot_to_hold: bool = False
    is_autopilot_to_land: bool = False
    is_taken: bool = False
    is_to_stop: bool = False


def _nothing() -> None:
    """The manoeuvre begins with its first step."""


class Handover(NamedTuple):
    """The manoeuvre that goes on with a task, and the function that is called once this manoeuvre is the one flown."""

    manoeuvre: Manoeuvre
    begin: Callable[[], None] = _nothing


def failed(error: UalError) -> Step:
    """Returns the step of a manoeuvre that has ended with an error."""
    return Step(has_ended=True, error=error)


class Manoeuvre(ABC):
    """Something that the UAV does for some time.

    `declares` is the state that the estimator reports during it; None for the state that the data show.
    `is_goal_moving` says whether its way leads to a goal that moves. `is_replaceable` says whether a new command may
    end it. `is_awaited` says whether a caller waits for its end, by `future`. `why_not_pausable` says why it cannot
    hold on its way; empty if it can. `task` is None if it is not a task of the interface.
    """

    declares: State | None = None
    is_goal_moving = False
    is_replaceable = True
    is_awaited = True
    mission = ""
    """Action of the autopilot by itself in a mission, human-readable, while that is the task; empty otherwise."""
    stops_mission = ""
    """Human-readable action of the manoeuvre in the air, where it stops a mission; empty otherwise. The autopilot would
    fly that on without it: only a command replaces it.
    """
    refuses_setpoints = False
    """Whether no pose and no velocity replaces it, though it may not be a mission yet."""
    unseen = ""
    """Human-readable action of the manoeuvre while the state is not known; empty where nobody needs to be reported."""
    trouble = ""
    """Why the UAV does not do what it was asked last, human-readable, where no task ends with that; empty otherwise."""
    waits_for = ""
    """Why it waits on its way where it can, human-readable: a source of the position has ended; else empty. Set by the
    flight before each step."""
    has_held = False
    """Whether the autopilot has held by itself since it stops a mission."""
    overrules_nobody = False
    """Whether it sends nothing in a mode that UAL did not choose, also where it was chosen before it began."""
    why_not_pausable = "it goes on to its end"
    # Here and not in `__init__`: each setpoint of a stream makes a manoeuvre.
    task: VehicleTask | None = None
    command: AutopilotCommand | None = None
    is_timed = False
    """Whether it ends unless it is given again."""
    led: Led | None = None
    """Modes to which UAL has led before the manoeuvre and in it; None where it began in no mission."""
    is_fitted = False
    """Whether it has looked at the world as it is now; see `fit`."""
    mode_begun = ""
    """The mode in which it began; empty where that was not known."""
    mode_seen = ""
    """The mode in which it was stepped last in a state that was known, or in which it began; empty while none is."""

    def __init__(self, name: str, task: VehicleTask | None) -> None:
        self.name = name
        self.task = task
        self.future = running_future() if task is None else task.future

    @property
    def is_paused(self) -> bool:
        """Whether it holds on its way."""
        return self.task is not None and self.task.is_paused

    @abstractmethod
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        """Makes one update. `estimate` is the state that the data show, without this manoeuvre."""

    def await_cause(self, snapshot: Snapshot) -> None:
        """Makes an update without a step: it is not known yet what has chosen the mode.

        The mode to which its command leads may come and go meanwhile: then others have taken the UAV.
        """
        del snapshot

    def fit(self, snapshot: Snapshot, limits: CurrentLimits, geofence: GeofencePolicy) -> Step | None:
        """Looks at what bounds its motion, after it has begun and whenever that has changed: limits, geofence, home.

        Fits its motion, and returns None if it goes on; or returns how it ends, or what goes on with its task. It is
        called again at the next update if it sets `is_fitted` back.
        """
        del snapshot, limits, geofence
        return None

    def current_reference(self) -> Reference | None:
        """Returns the reference that it follows now; None if the autopilot flies by itself."""
        return None

    def led_to(self, snapshot: Snapshot) -> bool | None:
        """Returns whether it led to the present mode, after it was replaced; see `LedTo`."""
        return False if self.led is None else self.led.to(snapshot)

    def is_overtaken(self, snapshot: Snapshot) -> bool:
        """Returns whether others have chosen the present mode, and it was not stepped since, so that it goes on."""
        mode = snapshot.control.settled_mode
        return self.mode_seen not in ("", mode) and bool(mode) and self.led_to(snapshot) is False

    def begins_in(self, mode: str) -> None:
        """Takes the mode in which it begins; empty where that is not known yet."""
        self.mode_begun = self.mode_seen = mode

    def replaces(self, old: Manoeuvre) -> None:
        """Takes note of what it replaces, as it begins. Called with the flight's lock held."""
        del old

    def leads(self) -> Led:
        """Returns the record of what replaces it; see `Led`."""
        return self.led or Led(self.led_to)

    def path_points(self, now_s: float) -> Sequence[Vector3]:
        """Returns its way from where it began to where it ends, as points; none where that is not known."""
        del now_s
        return ()

    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        """Takes note that the autopilot's estimate has jumped. Returns why it cannot go on; None if it can.

        By default it cannot: its way lies elsewhere now. `stop` is the reference that brings the UAV to rest where it
        is.
        """
        return TaskAbortedError(
            f"{self.name}: the autopilot's {jump.text}; the UAV holds its position",
            {"by": "estimator"},
        )

    def end(self, error: UalError | None) -> None:
        """Withdraws its command, logs its end, and ends its future. Runs the future's callbacks, so hold no lock."""
        self._log_end(error)
        if self.command is not None:
            self.command.withdraw()
        if self.task is not None:
            self.task.end(error)
        else:
            end_future(self.future, error)

    def _log_end(self, error: UalError | None) -> None:
        fields: dict[str, object] = {"task": self.name}
        if self.task is not None:
            fields["task_id"] = self.task.id
        if error is None:
            logs.event(_log, logging.INFO, "task_done", **fields)
        else:
            logs.event(_log, logging.WARNING, "task_ended", **fields, reason=error.reason, why=str(error))


ONLY_OTHERS_END_IT = "only the safety pilot or a ground station can end that"
"""Of a take-off or landing that is not UAL's."""


def guarded(manoeuvre: Manoeuvre, act: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T | Step:
    """Returns what a manoeuvre does, or its end by a defect: the UAV must not be left without references."""
    try:
        return act(*args, **kwargs)
    except Exception as error:  # noqa: BLE001  logged, and raised to the caller
        _log.exception("a step of %s failed; this is a defect of UAL, please report it", manoeuvre.name)
        return Step(has_ended=True, error=UalError(f"{manoeuvre.name}: a defect of UAL: {error!r}"))


def no_progress(during: str, stuck_s: float, left: str, snapshot: Snapshot, said_before: str | None) -> Step:
    """Returns the step of a manoeuvre that has ended because it makes no way. `left` says what is left.

    What the autopilot says is reported, unless it had said that before the manoeuvre began (`said_before`).
    """
    text = snapshot.condition.status_text
    said = f"the autopilot says: {text}" if text not in ("", said_before) else ""
    why = "".join(f"; {each}" for each in (breach_text(snapshot), said) if each)
    return failed(
        UalTimeoutError(
            f"{during}: the UAV has made no way for {stuck_s:.0f} s: {left}{why}; it stops and holds its position",
            {"state": State.FLYING_AUTO.name, "by": "no way"},
        )
    )


def with_advice(error: UalError, advice: str) -> UalError:
    """Returns the same error with what can be done now. While nothing is heard of the UAV, that is not known."""
    if isinstance(error, LinkLostError):
        return error
    return type(error)(f"{error.message}; {advice}", error.metadata)


def why_not_ours(snapshot: Snapshot, estimate: Estimate, during: str) -> UalError | None:
    """Returns why a manoeuvre that sends references cannot go on; None if it can.

    Reasons are a lost link or position, motors that were disarmed, and an autopilot that does not follow references.
    """
    state, mode = estimate.state, snapshot.control.mode
    is_known = estimate.is_link_up and state is not State.UNINITIALIZED and state is not State.LANDED_DISARMED
    if is_known and mode is not None and mode.value.control is Control.REFERENCES:  # nearly always: no calls
        return None
    blind = why_blind(estimate, during)
    if blind is not None:
        return blind
    if estimate.state is State.LANDED_DISARMED:
        return TaskAbortedError(f"{during}: the motors were disarmed", {"by": "autopilot", "state": "LANDED_DISARMED"})
    assert snapshot.control.mode is not None
    if snapshot.control.mode.value.control is not Control.REFERENCES:
        return taken_over(snapshot, during)
    return None


def why_blind(estimate: Estimate, during: str) -> UalError | None:
    """Returns why a manoeuvre has no data to go on with: the link or the position is lost. None if it has."""
    if not estimate.is_link_up:
        return LinkLostError(f"{during}: {estimate.why}", {"state": State.UNINITIALIZED.name})
    if estimate.state is State.UNINITIALIZED:
        return TaskAbortedError(f"{during}: {estimate.why}", {"by": "autopilot", "state": State.UNINITIALIZED.name})
    return None


def taken(snapshot: Snapshot, during: str) -> Step:
    """Returns the step of a manoeuvre that has ended because others took the UAV."""
    return Step(has_ended=True, error=taken_over(snapshot, during), is_taken=True)


def taken_over(snapshot: Snapshot, during: str) -> TaskAbortedError:
    """Returns the error of a manoeuvre that ended because others, or a failsafe, took control."""
    mode = snapshot.control.mode.value.text if snapshot.control.mode is not None else "unknown"
    breach = breach_text(snapshot)
    unknown = Cause.AUTOPILOT if snapshot.control.is_of_command else Cause.SAFETY_PILOT
    cause = snapshot.control.held_by or (Cause.FENCE if breach else unknown)
    state = _state_of(snapshot, cause)
    metadata = {"by": cause.value, "state": state.name, "mode": mode}
    in_mode = f"(the autopilot is in mode {mode}{f'; {breach}' if breach else ''})"
    if cause.is_failsafe:
        what = f"taken by the autopilot: {cause.value}"
    elif snapshot.control.is_of_command and cause is Cause.AUTOPILOT:
        what = "the autopilot follows a command of UAL from before"
    elif cause is Cause.AUTOPILOT:
        what = "the autopilot holds by itself, as after a mission"
    elif state is State.FLYING_AUTO:  # nothing shows what else selects the mode in which UAL flies it
        what = "the safety pilot or a ground station took over"
    else:
        what = f"the {cause.value} took over"
    return TaskAbortedError(f"{during}: {what} {in_mode}; {_remedy(state, cause)}", metadata)


_STATES = {
    Control.LAND: State.LANDING,
    Control.TAKE_OFF: State.TAKING_OFF,
    Control.REFERENCES: State.FLYING_AUTO,  # it flew in another mode for UAL, and somebody has ended that
}


def _state_of(snapshot: Snapshot, cause: Cause) -> State:
    """Returns the state that the mode of others leads to.

    A return above its home lands at once. Only a ground station is known so late that the landed state is surely
    from after its mode. After a pilot or a failsafe it may still be from a landing of UAL before.
    """
    control = snapshot.control.mode.value.control if snapshot.control.mode is not None else Control.OTHER
    landed = snapshot.control.landed
    if cause is Cause.GROUND_STATION and landed is not None and landed.value is LandedState.LANDING:
        return State.LANDING
    return _STATES.get(control, State.FLYING_MANUAL)


def _remedy(state: State, cause: Cause) -> str:
    if state is State.FLYING_MANUAL:
        return takes_back(cause)
    if state is State.FLYING_AUTO:
        return "the state is FLYING_AUTO, and UAL sends nothing until it is commanded anew"
    return f"the state is {state.name}: {ONLY_OTHERS_END_IT}"


def takes_back(cause: Cause | None) -> str:
    """Returns how UAL gets a UAV back that others, or a failsafe, fly."""
    if cause is Cause.TERMINATION:
        return ENDS_TERMINATION
    needs_force = cause is not None and cause.needs_force
    return f"recover_from_manual takes control back{' only with force' if needs_force else ''}"
