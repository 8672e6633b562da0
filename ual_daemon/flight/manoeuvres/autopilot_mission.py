"""A mission that the autopilot flies by itself, as a task of UAL. No setpoint is sent while it does.

The autopilot flies on where the link or the daemon is lost. So the task does not end with the link: once the autopilot
is received again, its mode and its mission say whether it is still this one.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from enum import Enum, auto
from functools import partial
from typing import Any

from typing_extensions import override

from ual.errors import LinkLostError, TaskAbortedError, UalError, WrongStateError
from ual.missions.items import MOVING, Item, Land, ReturnToLaunch, name_of, words_of
from ual.missions.plan import MissionStage
from ual.types import State
from ual_daemon import logs
from ual_daemon.backends.base import Backend
from ual_daemon.backends.offers.missions import AutopilotMissions, KeptMission, MissionReport
from ual_daemon.backends.offers.parameters import UndecidedError
from ual_daemon.backends.values import Cause, Control, Snapshot
from ual_daemon.flight.autopilot_command import AutopilotCommand
from ual_daemon.flight.manoeuvres.left_out_items import LeftOutItems
from ual_daemon.flight.manoeuvres.manoeuvre import (
    Handover,
    Led,
    Manoeuvre,
    Step,
    failed,
    taken,
    taken_over,
    with_advice,
)
from ual_daemon.flight.manoeuvres.mission_watch import MissionWatch
from ual_daemon.flight.manoeuvres.recover import TAKES_BACK, Recover
from ual_daemon.flight.policy.authority import LONGEST_LINK_GAP_S
from ual_daemon.flight.policy.jumps import EstimateJump
from ual_daemon.flight.policy.touch_down import TouchDown
from ual_daemon.flight.state import Estimate
from ual_daemon.flight.tasks import Progress, VehicleTask
from ual_daemon.tracker.references import Reference

_log = logging.getLogger(__name__)

NAME = "mission"
_MISSION_END_DELAY_S = 2.5
"""Seconds after the mode that follows a mission within which the autopilot may report that it is complete: PX4 does
once a second.
"""
_HOLDS = "it holds its position by UAL's references"
_LANDED = (State.LANDED_ARMED, State.LANDED_DISARMED)


class _Phase(Enum):
    VERIFYING = auto()
    """Whether the autopilot still has this mission is being read from it."""
    CHOOSING = auto()
    """The first item is being made the current one."""
    ENTERING = auto()
    FLYING = auto()
    PAUSING = auto()
    PAUSED = auto()
    REREADING = auto()
    """The same as VERIFYING, before a paused one goes on."""


_HOLDING = (_Phase.PAUSED, _Phase.REREADING)


class TakeBack(Recover):
    """Takes the control back at the end of a mission in the air: the task ends once UAL holds it there."""

    is_replaceable = True
    why_not_pausable = "the mission has ended"
    mission = TAKES_BACK
    unflown: UalError | None = None
    """Why the mission was not flown as it stands; None where it was."""

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        step = super().step(snapshot, estimate)
        return step._replace(error=self.unflown) if step.has_ended and step.error is None else step


class AutopilotMission(Manoeuvre):
    """A mission that is on the autopilot. It can be replaced, cancelled and paused.

    Args:
        task: The task.
        backend: Commands the hold of a pause.
        offer: The missions of the autopilot.
        kept: The mission, as it was read from the autopilot.
        first: The item with which it begins, counted from 1; None where the autopilot flies it already.
        reference: What is sent until the autopilot flies the mission; None on the ground.
        take_back: Makes what takes the control back at the end in the air.
        is_ours: Called once it is known that the mission is still this one, after a silence or a pause.
        begins_anew: Why the autopilot would not go on after a pause; empty if it does.

    """

    refuses_setpoints = True

    def __init__(
        self,
        task: VehicleTask,
        backend: Backend,
        offer: AutopilotMissions,
        kept: KeptMission,
        first: int | None,
        reference: Reference | None,
        take_back: Callable[[VehicleTask], TakeBack],
        is_ours: Callable[[], None],
        begins_anew: str = "",
    ) -> None:
        super().__init__(NAME, task)
        self.why_not_pausable = f"the autopilot would begin it anew ({begins_anew})" if begins_anew else ""
        self._backend = backend
        self._offer = offer
        self._kept = kept
        self._first = first
        self._reference = reference
        self._take_back = take_back
        self._is_ours = is_ours
        self._item = first or 1
        self._phase = _Phase.VERIFYING if first is None else _Phase.CHOOSING
        self._waited: Future[Any] | None = None
        """Future that the phase waits for."""
        self._reported_list = _list_key(offer.report())
        """List that was reported when the mission was read last before its start."""
        self._list_read: Future[KeptMission] | None = None
        self.began_in = ""
        """The mode in which it begins, or goes on; empty for the first one that is seen."""
        self._was_paused = False
        self._trouble = ""
        """Why the last pause has failed."""
        self._entered_s = 0.0
        self._begun_s = math.inf if first is not None else -math.inf
        """Time at which the mission was entered first, before any pause; infinity until then."""
        self._watch = MissionWatch(offer, kept)
        self._left_out = LeftOutItems(kept.items)
        self._jump: tuple[int, Future[None]] | None = None
        """The last jump of UAL: to which item, and its future."""
        self._before: Led | None = None
        """Modes to which the mission before, or its stop, may lead late; None where there was none."""
        self._is_ending = False
        """Whether its end was reported, and is compared with what the autopilot has."""
        self._done_s: float | None = None
        """Since when it is in the mode in which it holds after a mission."""
        self._was_in_air = first is None
        self._touch_down = TouchDown()
        self._heard_s: float | None = None
        self._seen_s: float | None = None
        """Time at which its state was known last."""
        self._task: VehicleTask = task
        self._update_words()

    @property
    def modes(self) -> tuple[str, str]:
        """The names of the modes in which the autopilot flies it, and in which it holds."""
        return self._offer.mode, self._offer.pause_mode

    @property
    def items(self) -> Sequence[Item]:
        """The items of the mission."""
        return self._kept.items

    @property
    def id(self) -> str:
        """The identifier of its task."""
        return self._task.id

    @property
    def item(self) -> int:
        """The item that is flown, counted from 1."""
        return self._item

    @property
    def paused_at(self) -> int:
        """The item with which it goes on after a pause, counted from 1, while the autopilot holds in one; else 0."""
        return self._item if self._phase in _HOLDING else 0

    def found_paused(self, item: int, mode: str) -> None:
        """Takes that a daemon before has paused it at an item, in a mode. Before it begins."""
        self._phase, self._was_paused, self._task.is_paused = _Phase.PAUSED, True, True
        self._item, self.began_in = min(item, len(self._kept.items)), mode
        self._update_words()

    def stage(self, snapshot: Snapshot) -> MissionStage:
        """Returns how far it is, by what the autopilot is seen to do."""
        if self._phase in _HOLDING:
            return MissionStage.PAUSED
        is_entered = self._phase is _Phase.ENTERING and _mode(snapshot) == self._offer.mode and self._was_in_air
        if self._phase in (_Phase.CHOOSING, _Phase.ENTERING) and not is_entered:
            return MissionStage.PAUSED if self._was_paused else MissionStage.NOT_STARTED
        return MissionStage.ACTIVE

    @property
    def has_succeeded(self) -> bool:
        """Whether it was flown to its end."""
        return self.future.done() and not self.future.cancelled() and self.future.exception() is None

    def has_list_of(self, report: MissionReport) -> bool:
        """Returns whether the autopilot still reports the list that it reported during this mission."""
        return self._watch.has_list_of(report)

    def is_at_last(self, report: MissionReport) -> bool:
        """Returns whether the last item that moves it is flown, or was reached: there the mission may end."""
        return max(self._item, self.reached(report) or 0) >= self._last_moving

    def reached(self, report: MissionReport) -> int | None:
        """Returns the item that was reached last since it began, counted from 1."""
        return report.reached if report.reached_s > self._begun_s else None

    @override
    def replaces(self, old: Manoeuvre) -> None:
        if old.mission or old.stops_mission:
            self._before = old.leads()
        if old.mission and self._phase is _Phase.CHOOSING:
            self.mission = "the autopilot still flies the mission before"  # nobody took the UAV meanwhile

    @override
    def leads(self) -> Led:
        if self._phase is _Phase.CHOOSING and self._before is not None:  # it has led nowhere by itself
            return self._before
        return super().leads()

    @override
    def current_reference(self) -> Reference | None:
        return self._reference

    @override
    def estimate_jumped(self, jump: EstimateJump, stop: Reference) -> UalError | None:
        if self._reference is not None:
            self._reference = stop
        return None  # the autopilot flies to places on Earth

    def jump(self, item: int, refusal: Callable[[], UalError | None]) -> Future[None]:
        """Makes an item, counted from 1, the one that is flown now. From any thread.

        Raises:
            WrongStateError: The autopilot does not fly the mission at the moment.

        """
        if self._phase is not _Phase.FLYING:
            raise WrongStateError(
                f"{NAME}: the autopilot does not fly it at the moment ({self._phase.name.lower()}); wait, or resume",
                {"needed": "FLYING"},
            )

        self._left_out.jumps_to(item)
        future = self._offer.set_current(self._kept.items, item, lambda: self._why_not() or refusal(), anew=False)
        self._jump = item, future
        return future

    @override
    def led_to(self, snapshot: Snapshot) -> bool | None:
        mode = _mode(snapshot)
        if self._phase is _Phase.ENTERING and mode == self._offer.mode:
            return True
        if self._phase in (_Phase.CHOOSING, _Phase.ENTERING):  # to what the one before led may show late
            return False if self._before is None else self._before.to(snapshot)
        if self._phase is _Phase.PAUSING and not self._is_returning(snapshot):
            return mode == self._offer.pause_mode
        if self._phase not in (_Phase.FLYING, _Phase.PAUSING):
            return False
        if mode == self._offer.mode and self.mode_seen != mode:  # it was entered just now
            return True
        self._item = self._reported_item()
        if self._is_returning(snapshot):
            return None if snapshot.control.held_by is Cause.OPEN else True  # it may be a failsafe
        return True if self._is_complete(snapshot, self._offer.report()) else self._may_be_complete(snapshot) and None

    # --- Steps --------------------------------------------------------------------------------------------------------

    @override
    def step(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        if not estimate.is_link_up or estimate.state is State.UNINITIALIZED:
            return self._step_blind(snapshot, estimate)
        self._seen_s = snapshot.time_s
        self._check_after_silence(snapshot)
        self._check_items(snapshot)
        self._was_in_air = self._was_in_air or estimate.state not in _LANDED
        if estimate.state in _LANDED and self._was_in_air:
            return self._landed(snapshot, estimate) if self._touch_down.has_landed(snapshot, estimate) else Step()
        if estimate.state is State.LANDED_DISARMED:
            return failed(TaskAbortedError(f"{NAME}: the motors were disarmed", {"by": "autopilot"}))
        return _STEPS[self._phase](self, snapshot)

    def _step_blind(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        """The autopilot flies on. Before it does, nothing is known of what was commanded; its mode tells that later."""
        if self._seen_s is None:
            self._seen_s = snapshot.time_s
        if estimate.is_link_up and (step := self._unless_mode_shows_others(snapshot)) is not None:
            return step
        is_entering = self._phase is _Phase.ENTERING
        if self._phase is _Phase.CHOOSING or (is_entering and snapshot.time_s - self._seen_s > LONGEST_LINK_GAP_S):
            text = f"{NAME}: {estimate.why}; it is not known whether the autopilot flies it now"
            metadata = {"state": State.UNINITIALIZED.name, "by": "autopilot"}
            return failed(TaskAbortedError(text, metadata) if estimate.is_link_up else LinkLostError(text, metadata))
        does = "holds by itself" if self._phase in _HOLDING else "flies on by itself"
        what = "it is not known whether the autopilot flies it" if is_entering else f"the autopilot {does}"
        self._task.note = f"{estimate.why}; {what}"
        return Step()

    def _unless_mode_shows_others(self, snapshot: Snapshot) -> Step | None:
        """Returns its end where the mode, which is received without a position, too, shows that others fly it. A
        failsafe may give it back to the mission once the position is known.
        """
        if not _mode(snapshot) or _is_by_failsafe(snapshot):
            return None
        if self._phase in _HOLDING:
            return self._unless_ours(snapshot)
        if self._phase is not _Phase.FLYING:
            return None
        is_over = self._is_complete(snapshot, self._offer.report()) or self._may_be_complete(snapshot)
        return None if is_over else self._unless_flying(snapshot)

    def _check_after_silence(self, snapshot: Snapshot) -> None:
        """After a long silence the flight may be another's: whether the mission is still this one is read again."""
        heard_s, before_s = snapshot.heard_s, self._heard_s
        self._heard_s = heard_s
        self._task.note = self._trouble
        if heard_s is None or before_s is None or heard_s - before_s <= LONGEST_LINK_GAP_S:
            return
        if self._phase is _Phase.FLYING:
            self._phase, self._waited = _Phase.VERIFYING, None

    def _check_items(self, snapshot: Snapshot) -> None:
        report, item = self._offer.report(), self._reported_item()
        if self._phase is not _Phase.FLYING or report is None or report.time_s <= self._entered_s:
            self._left_out.forget()
            return
        self._left_out.step(report, snapshot)
        if item != self._item:
            self._item = item
            self._update_words()

    def _why_unflown(self) -> UalError | None:
        """Returns that others have jumped over items, which so were not flown; None where all were."""
        names = [name_of(self._kept.items, number - 1) for number in self._left_out.numbers]
        if not names:
            return None
        text = f"{NAME}: it has ended without {', '.join(names)}: another station has jumped"
        return TaskAbortedError(text, {"by": Cause.GROUND_STATION.value})

    def _reported_item(self) -> int:
        """Returns the item that the autopilot reported last, since it has entered the mission."""
        report = self._offer.report()
        if report is None or report.item is None or report.time_s <= self._entered_s:
            return self._item
        return min(report.item, len(self._kept.items))

    def _update_words(self) -> None:
        count = len(self._kept.items)
        item = self._kept.items[self._item - 1]
        number = f" ({item.number} in its file)" if item.number not in ("", str(self._item)) else ""
        does = "holds on" if self._phase is _Phase.PAUSED else "flies"
        left_out = "".join(f"; another station has jumped over item {each}" for each in self._left_out.numbers)
        what = f"item {self._item} of {count}, {words_of(item)}{number}"
        self.mission = f"the autopilot {does} our mission: {what}{left_out}"
        if self._phase is _Phase.CHOOSING and not self._was_paused:
            self.mission = ""  # the autopilot takes our references yet
        self._task.report(partial(Progress, (self._item - 1) / count, None, self._item - 1))

    def _landed(self, snapshot: Snapshot, estimate: Estimate) -> Step:
        if (step := self._unless_another(snapshot, is_end=True)) is not None:
            return step
        if self._ends_on_ground():
            return Step(has_ended=True, error=self._why_unflown())
        what = name_of(self._kept.items, self._item - 1)
        text = f"{NAME}: the UAV has landed at {what}, before its end ({estimate.why})"
        return Step(has_ended=True, error=TaskAbortedError(text, {"by": "autopilot"}), is_taken=True)

    def _ends_on_ground(self) -> bool:
        last = len(self._kept.items)
        return self._item >= last and isinstance(self._kept.items[-1], Land | ReturnToLaunch)

    def _verifying(self, snapshot: Snapshot) -> Step:
        if (step := self._unless_flying(snapshot)) is not None:
            return step
        if (step := self._unless_kept("the autopilot flies on: it is not known what")) is not None:
            return step
        logs.event(_log, logging.INFO, "mission_found", task_id=self._task.id, item=self._item)
        self._is_ours()
        self._phase, self._waited = _Phase.FLYING, None
        return Step()

    def _unless_kept(self, advice: str) -> Step | None:
        """Reads the mission from the autopilot. Returns what to do meanwhile, and its end; None if it is still ours."""
        if self._waited is None:
            self._waited = self._offer.download()
        if not self._waited.done():
            return Step()
        found = self._result()
        if isinstance(found, UalError):
            return failed(with_advice(found, advice))
        if found.digest != self._kept.digest:
            return _of_another()
        return None

    def _unless_another(self, snapshot: Snapshot, *, is_end: bool = False) -> Step | None:
        """Returns the end of a mission that another station has replaced; at its end also what to do until that is
        known. None while it is ours.
        """
        watch = self._watch
        watch.step(snapshot.time_s, is_end=is_end)
        if watch.is_other:
            return _of_another()
        if not is_end or watch.is_sure(is_end=True):
            return None
        if watch.failure is None:
            return Step()
        return failed(with_advice(watch.failure, "it is not known whether the autopilot has flown our mission"))

    def _choosing(self, snapshot: Snapshot) -> Step:
        if (step := self._unless_ours(snapshot)) is not None:
            return step
        if self._task.is_paused and self._was_paused:
            return self._stay_paused()
        if self._waited is None:
            anew = self._first == 1 and not self._was_paused
            self._waited = self._offer.set_current(self._kept.items, self._item, self._why_not, anew=anew)
        if self._waited.done():
            found = self._result()
            if isinstance(found, UalError):
                return failed(with_advice(found, self._stays()))
            step = self._unless_replaced()
            if step is None:
                self._enter(snapshot)
            elif step.has_ended:
                return step
        return self._referring(snapshot)

    def _unless_replaced(self) -> Step | None:
        """Reads the mission again if another list was reported since it was read: another station may have brought it,
        and nothing has checked where that leads. Returns what to do meanwhile, and its end; None if it is still ours.
        """
        if self._list_read is None:
            report = self._offer.report()
            reported, id_ = _list_key(report), self._kept.mission_id
            if reported == self._reported_list or (report is not None and report.mission_id == id_ != 0):
                return None
            self._reported_list, self._list_read = reported, self._offer.download()
        if not self._list_read.done():
            return Step()
        found, self._list_read = _result_of(self._list_read), None
        if isinstance(found, UalError):
            return failed(with_advice(found, self._stays()))
        if found.digest != self._kept.digest:
            why = f"{NAME}: another station has brought another mission since this one was read; {self._stays()}"
            return failed(TaskAbortedError(why, {"by": "ground station"}))
        return self._unless_replaced()

    def _enter(self, snapshot: Snapshot) -> None:
        self.command = AutopilotCommand("fly the mission")
        self._phase, self._waited = _Phase.ENTERING, None
        self._entered_s = snapshot.time_s
        self._begun_s = min(self._begun_s, snapshot.time_s)
        self._update_words()
        self.command.send(self._offer.fly)

    def _entering(self, snapshot: Snapshot) -> Step:
        assert self.command is not None
        if _mode(snapshot) == self._offer.mode and not self._is_starting():
            self._phase, self._reference, self._before = _Phase.FLYING, None, None
            self._update_words()
            return Step()
        self._note_entered(snapshot)
        if _mode(snapshot) != self._offer.mode and (step := self._unless_ours(snapshot)) is not None:
            return step
        failure = self.command.failure(snapshot)
        return self._referring(snapshot) if failure is None else failed(with_advice(failure, self._stays()))

    @override
    def await_cause(self, snapshot: Snapshot) -> None:
        if self._phase is _Phase.ENTERING:
            self._note_entered(snapshot)

    def _note_entered(self, snapshot: Snapshot) -> None:
        """Notes that its mode has come: from now on a return to the mode before is a take-over."""
        if _mode(snapshot) == self._offer.mode and self._before is None:
            self.began_in = self._offer.mode

    def _is_starting(self) -> bool:
        """Returns whether its command has not been answered yet: on the ground ArduPilot needs more than the mode."""
        is_early = not self._was_in_air or self._before is not None  # the mode may be that of the mission before
        return self.command is not None and not self.command.is_answered and is_early

    def _flying(self, snapshot: Snapshot) -> Step:
        is_complete = self._is_complete(snapshot, self._offer.report())
        if self._is_ending and _mode(snapshot) in (self._offer.mode, self._offer.done_mode):
            is_complete = not _is_by_others(snapshot)  # MAVROS forgets the end as the mission is read again
        self._is_ending = is_complete
        if (step := self._unless_another(snapshot, is_end=is_complete)) is not None:
            return step
        if is_complete:
            return Step(handover=self._hand_back())
        if self._may_be_complete(snapshot):
            return Step()
        if (step := self._unless_flying(snapshot)) is not None:
            return step
        if self._task.is_paused:
            self.command, self._trouble = AutopilotCommand("hold its position"), ""
            self._phase, self.began_in = _Phase.PAUSING, _mode(snapshot)
            self.command.send(self._backend.hold)
        return Step()

    def _is_complete(self, snapshot: Snapshot, report: MissionReport | None) -> bool:
        """Returns whether the autopilot has ended the mission in the air."""
        if report is None or report.time_s <= self._entered_s or self._ends_by(Land, ReturnToLaunch):
            return False
        if _is_by_others(snapshot) and _mode(snapshot) != self._offer.mode:  # they may hold in the mode that follows
            return False
        has_reached = (
            report.reached == self._last_moving
            and report.reached_s > self._entered_s  # not in a flight before
            and self._item >= self._last_moving  # it has not jumped back
        )
        is_told = report.stage is MissionStage.COMPLETE and self.is_at_last(report)  # else an end of another one
        is_over = is_told or (has_reached and _mode(snapshot) != self._offer.mode)
        return is_over and _mode(snapshot) in (self._offer.mode, self._offer.done_mode)

    def _may_be_complete(self, snapshot: Snapshot) -> bool:
        """Returns whether it has entered the mode in which it holds after a mission, and may still tell its end."""
        is_done = _mode(snapshot) == self._offer.done_mode != self._offer.mode
        is_done = is_done and not _is_by_others(snapshot)
        item = max(self._item, self._unreported_jump())
        if not is_done or item < self._last_moving or self._ends_by(Land, ReturnToLaunch):
            self._done_s = None
            return False
        self._done_s = snapshot.time_s if self._done_s is None else self._done_s
        return snapshot.time_s - self._done_s < _MISSION_END_DELAY_S

    def _unreported_jump(self) -> int:
        """Returns the item to which UAL jumps, which may be reported after its effect; 0 where there is none. A jump
        that was withdrawn with its mission may have left before.
        """
        if self._jump is None:
            return 0
        item, future = self._jump
        is_open = not future.done() or isinstance(_result_of(future), TaskAbortedError)
        return item if is_open else 0

    @property
    def _last_moving(self) -> int:
        """The last item that moves it, counted from 1."""
        return max(number for number, each in enumerate(self._kept.items, 1) if isinstance(each, MOVING))

    def _ends_by(self, *kinds: type[Item]) -> bool:
        return isinstance(self._kept.items[-1], kinds)

    def _hand_back(self) -> Handover:
        take_back = self._take_back(self._task)
        take_back.unflown = self._why_unflown()
        take_back.replaces(self)
        return Handover(take_back, take_back.send)

    def _unless_flying(self, snapshot: Snapshot) -> Step | None:
        """Returns the end of a mission that the autopilot does not fly any more; None while it does."""
        if _mode(snapshot) == self._offer.mode:
            return None
        if not self._is_returning(snapshot):
            return taken(snapshot, NAME)
        if self._item < len(self._kept.items):
            self._item = len(self._kept.items)
            self._update_words()
        return None

    def _is_returning(self, snapshot: Snapshot) -> bool:
        """Returns whether the return at the end of the mission is what changed the mode; its item may be reported
        later.
        """
        mode = snapshot.control.mode
        if mode is None or (mode.value.name != self._offer.return_mode and mode.value.control is not Control.LAND):
            return False
        if not self._ends_by(ReturnToLaunch) or _is_by_failsafe(snapshot):
            return False
        before = [number for number, each in enumerate(self._kept.items, 1) if isinstance(each, MOVING)][:-1]
        return self._item >= len(self._kept.items) or not before or self._item >= before[-1]

    def _pausing(self, snapshot: Snapshot) -> Step:
        assert self.command is not None
        mode = _mode(snapshot)
        if mode == self._offer.pause_mode:
            self._phase, self.began_in, self._was_paused = _Phase.PAUSED, mode, True
            self._update_words()
            return Step()
        if mode != self.began_in and not self._is_returning(snapshot):
            return taken(snapshot, NAME)
        failure = self.command.failure(snapshot)
        if mode != self.began_in:  # it has begun its own return: the hold is commanded again
            self._phase = _Phase.FLYING
        elif failure is not None:
            self._go_on_unpaused(failure)
        return Step()

    def _go_on_unpaused(self, failure: UalError) -> None:
        """The autopilot does not hold. The task goes on with its mission, so that it can be aborted."""
        self._phase, self._task.is_paused = _Phase.FLYING, False
        self._trouble = f"it could not be paused: {failure}"
        logs.event(_log, logging.WARNING, "mission_not_paused", task_id=self._task.id, why=str(failure))

    def _paused(self, snapshot: Snapshot) -> Step:
        if (step := self._unless_ours(snapshot) or self._unless_another(snapshot)) is not None:
            return step
        if not self._task.is_paused:
            self._phase, self._waited = _Phase.REREADING, None
        return Step()

    def _rereading(self, snapshot: Snapshot) -> Step:
        """While it held, another station may have brought another mission, which nothing has checked."""
        if (step := self._unless_ours(snapshot)) is not None:
            return step
        if self._task.is_paused:
            return self._stay_paused()
        if (step := self._unless_kept(self._stays())) is not None:
            return step
        self._is_ours()  # a silence in its pause may have given the flight up
        self._phase, self._waited = _Phase.CHOOSING, None
        return Step()

    def _stay_paused(self) -> Step:
        """Holds where it does, as it was paused again before it has gone on."""
        self._phase, self._waited = _Phase.PAUSED, None
        return Step()

    def _unless_ours(self, snapshot: Snapshot) -> Step | None:
        """Returns the end of a mission before which others took the UAV; None while it is in the mode it began in."""
        self.began_in = self.began_in or self.mode_begun or _mode(snapshot)
        if _mode(snapshot) == self.began_in:
            return None
        is_led = False if self._before is None or self._phase in _HOLDING else self._before.to(snapshot)
        if is_led:
            self.began_in = _mode(snapshot)
            return None
        return Step() if is_led is None else taken(snapshot, NAME)

    def _why_not(self) -> UalError | None:
        """Returns why nothing more of it may be sent, first or again; None where it may. On the thread of the updates.

        Others may have chosen the mode since the last step: no step is made until the cause is known.
        """
        if self.future.done():
            return TaskAbortedError(f"{NAME}: it has ended", {"by": NAME})
        snapshot = self._backend.snapshot()
        if snapshot.control.held_by is Cause.OPEN:
            return UndecidedError(f"{NAME}: it is not known yet who has chosen mode {snapshot.control.mode_text}")
        return taken_over(snapshot, NAME) if self.is_overtaken(snapshot) else None

    def _referring(self, snapshot: Snapshot) -> Step:
        return Step() if self._reference is None else Step(self._reference.setpoint(snapshot))

    def _stays(self) -> str:
        if not self._was_in_air:
            return "the UAV stays on the ground"
        return "the autopilot holds its position" if self._reference is None else _HOLDS

    def _result(self) -> Any:  # noqa: ANN401  of what the phase waits for
        assert self._waited is not None
        return _result_of(self._waited)


def _result_of(waited: Future[Any]) -> Any:  # noqa: ANN401  of whatever is waited for, or its error
    if waited.cancelled():
        return UalError(f"{NAME}: it was withdrawn by the backend")
    error = waited.exception()
    if error is None:
        return waited.result()
    return error if isinstance(error, UalError) else UalError(f"{NAME}: {error}")


def _list_key(report: MissionReport | None) -> tuple[int, tuple[int, ...]] | None:
    """Returns the part of a report that changes with the mission; None where nothing is reported."""
    return None if report is None else (report.mission_id, report.changes)


def _of_another() -> Step:
    """Returns the end of a mission in whose place the autopilot has one that UAL has not brought there."""
    why = (
        f"{NAME}: the autopilot has another mission now, which UAL has not started: another station has brought it; "
        "UAL sends nothing, and recover_from_manual takes control back"
    )
    return Step(has_ended=True, error=TaskAbortedError(why, {"by": "ground station"}), is_taken=True)


def _mode(snapshot: Snapshot) -> str:
    return snapshot.control.mode_name


def _is_by_failsafe(snapshot: Snapshot) -> bool:
    cause = snapshot.control.held_by
    return cause is not None and cause.is_failsafe


def _is_by_others(snapshot: Snapshot) -> bool:
    """Returns whether a failsafe, or the pilot's switch, has chosen the mode. That is also the one in which a mission
    ends.
    """
    return _is_by_failsafe(snapshot) or snapshot.control.held_by is Cause.SAFETY_PILOT


_STEPS: dict[_Phase, Callable[[AutopilotMission, Snapshot], Step]] = {
    _Phase.VERIFYING: AutopilotMission._verifying,  # noqa: SLF001  its own table
    _Phase.CHOOSING: AutopilotMission._choosing,  # noqa: SLF001
    _Phase.ENTERING: AutopilotMission._entering,  # noqa: SLF001
    _Phase.FLYING: AutopilotMission._flying,  # noqa: SLF001
    _Phase.PAUSING: AutopilotMission._pausing,  # noqa: SLF001
    _Phase.PAUSED: AutopilotMission._paused,  # noqa: SLF001
    _Phase.REREADING: AutopilotMission._rereading,  # noqa: SLF001
}
