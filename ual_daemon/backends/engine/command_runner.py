"""Sends commands until they are answered or show their effect, and never where the safety pilot may have taken over.

The rules of the pilot stand here once, for all backends, in `CommandRunner._hindrance` and `_judge_modes`:

- never first nor again into a silence; after one for the first time only, once what it changes was received again;
- never over a mode that others chose since it was requested;
- never after it was withdrawn, which is cancelling its future;
- never when it may be executed late: by a bridge that is held up, or by a thread of ours that did not run;
- never an arming in a mode in which the autopilot would begin a flight by itself;
- never again where its table does not say so.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

from ual.errors import RejectedByAutopilotError, UalError, UalTimeoutError
from ual.shared.renamed import renamed_property
from ual_daemon.backends import futures
from ual_daemon.backends.engine.command import ARMING, FLYING, Command, Verdict
from ual_daemon.backends.engine.contained import defect
from ual_daemon.backends.engine.limits import OWN_MODE_S, SETPOINTS_WAIT_S, UNSENT_COMMAND_S
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.values import Control, Mode, Sample, Snapshot

_log = logging.getLogger(__name__)

R = TypeVar("R")

IN_PROGRESS_S = 10.0
"""Seconds for the next answer after one that says "in progress"."""
LATER_ACK_S = 0.3
"""Seconds for the next acceptance of a command that is accepted several times."""
EFFECT_S = 1.0
"""Seconds after a refusal within which the effect may still come, where the command was sent more than once. The
refusal may be of the repetition (a second take-off), because the first one was obeyed and its answer lost.
"""
STALE_ANSWER_S = 1.0
"""Seconds after the end of a command within which an answer may still be its own: one that came twice or late. It
carries only the key, so it could be taken for that of the next command with this key.
"""
LATE_ACK_S = 0.1
"""An answer that has not come after this is late: the vehicle's state should be requested."""
MOST_TEXTS = 20
"""Most texts that explain a refusal; the others are not kept."""


class RunnerSettings(NamedTuple):
    """Seconds after a refusal within which the autopilot's texts about it may come, depending on the link.

    `explain_s` is the same where they must be requested first (`Command.explain`).
    """

    text_s: float = 0.1
    explain_s: float = 0.4
    bridge: str = ""
    """The name of what passes commands on, if there is such a thing: it may not answer."""


class CommandContext(NamedTuple):
    """Request of a command: its time, the known mode's name (empty: none), and the boot (0: none)."""

    time_s: float
    mode: str
    boot: int

    @classmethod
    def at(cls, time_s: float, snapshot: Snapshot) -> CommandContext:
        """Returns what was known by a snapshot."""
        return cls(time_s, snapshot.control.settled_mode, snapshot.link.boot)


@dataclass(slots=True, eq=False)
class _PendingCommand(Generic[R]):
    command: Command[R]
    key: Hashable
    asked_s: float
    result: Future[None]
    from_mode: str = ""
    """The mode from which it leads to its own; empty: none is known yet."""
    shown_mode: str = ""
    """Its own mode, once that has shown."""
    follows_mode: bool = False
    """Whether it follows a command for a mode."""
    before: tuple[Command[R], float] | None = None
    """Our command before, whose mode may still show, and when that was sent."""
    sends_count: int = 0
    accepts_count: int = 0
    first_s: float = 0.0
    """Time at which it was first sent."""
    sent_s: float = 0.0
    """Time at which it was last sent."""
    next_s: float = 0.0
    """Time at which to send it again, or to end the wait for another acceptance, for texts, or for its effect."""
    passed_on_s: float = math.inf
    """Time at which a bridge had sent it."""
    take_back: Callable[[], object] | None = None
    """Takes it back while it has not left."""
    is_in_progress: bool = False
    """Whether the autopilot has reported so."""
    refusal: str = ""
    refuser: str = ""
    texts: list[str] = field(default_factory=list)

    @property
    def is_withdrawn(self) -> bool:
        """Whether nobody wants it any more."""
        return self.result.cancelled()


class CommandRunner(Generic[R]):
    """The commands in progress to one autopilot. Not thread-safe: belongs to the thread of the loop.

    Args:
        name: The autopilot's, for errors.
        transmit: Sends a request, with how often it was sent before, and the key of its answers. Returns what takes it
            back while it has not left, if there is such a thing.
        snapshot: Returns the newest data of the autopilot.
        watch: The link's.
        setpoints_s: Returns for how long setpoints have been sent.
        settings: How late texts come.
        hindrance: Returns why a command would be executed late now, human-readable; empty if it would not.

    """

    def __init__(
        self,
        name: str,
        transmit: Callable[[R, int, Hashable], Callable[[], object] | None],
        snapshot: Callable[[float], Snapshot],
        watch: LinkWatch,
        setpoints_s: Callable[[float], float],
        settings: RunnerSettings = RunnerSettings(),  # noqa: B008  it is immutable
        hindrance: Callable[[], str] = str,
    ) -> None:
        self._name = name
        self._do_transmit = transmit
        self._snapshot = snapshot
        self._watch = watch
        self._setpoints_s = setpoints_s
        self._settings = settings
        self._late_hindrance = hindrance
        self._waiting: deque[_PendingCommand[R]] = deque()
        self._in_flight: dict[Hashable, _PendingCommand[R]] = {}
        self._ended_s: dict[Hashable, float] = {}
        """Time at which the last command of each shared key ended, or was given up."""
        self._doubtful_until_s: dict[Hashable, float] = {}
        """Until when an answer for each shared key may be of a command that has ended."""
        self._last: tuple[Command[R], float] | None = None
        """The newest command that leads to a mode, and when that was sent."""
        self._due_s = -math.inf
        """Before this time nothing is due by itself: only requests for data are in progress, or nothing is."""

    # --- What is requested --------------------------------------------------------------------------------------------

    def submit(
        self, command: Command[R], now_s: float, result: Future[None] | None = None, asked: CommandContext | None = None
    ) -> Future[None]:
        """Queues a command, and sends it as soon as nothing keeps it back.

        The future ends with the answer or the effect, of the last command where others follow. It ends with an error
        where the command was refused, could not be sent, or was not answered and nothing else shows what it did.
        Commands that change control, and arming, stay open without an answer. Cancelling it withdraws the command.
        """
        self._due_s = -math.inf
        result = Future() if result is None else result
        if result.cancelled():
            return result
        snapshot = self._snapshot(now_s)
        asked = CommandContext.at(now_s, snapshot) if asked is None else asked
        if asked.boot not in (0, snapshot.link.boot):
            text = f"the command to {command.what} was not sent: the autopilot has rebooted, or is another one"
            futures.end(result, RejectedByAutopilotError(text, {"text": text}))
            return result
        pending = _PendingCommand(command, self._key_of(command), asked.time_s, result)
        if command.group == FLYING:
            self._note_modes(pending, asked.mode, now_s)
        if command.group:
            # The replaced command's future stays open: what the vehicle does is assessed by its state.
            self._drop(lambda other: other.command.group == command.group, now_s)
        self._waiting.append(pending)
        self._judge_modes(now_s)
        self._send_waiting(now_s)
        return result

    def drop(self, now_s: float) -> None:
        """Drops all commands but requests for data: their vehicle may be another one now, or has booted.

        Their futures stay open.
        """
        self._due_s = -math.inf
        self._drop(lambda pending: bool(pending.command.group), now_s)

    def drop_requests(self, is_meant: Callable[[R], bool], now_s: float) -> None:
        """Drops requests for data: others take their place. Their futures stay open."""
        self._due_s = -math.inf
        self._drop(lambda pending: not pending.command.group and is_meant(pending.command.request), now_s)

    # --- What comes ---------------------------------------------------------------------------------------------------

    def on_answer(self, key: Hashable, verdict: Verdict, now_s: float, text: str = "", by: str = "") -> None:
        """Takes an answer: its command, its result, its text, and what refuses it where that is not the autopilot."""
        self._due_s = -math.inf
        pending = self._in_flight.get(key)
        if pending is None or (pending.refusal and pending.command.refusal_is_final):
            return
        if pending.command.shows is not None and now_s - self._ended_s.get(key, -math.inf) < STALE_ANSWER_S:
            return  # it is sent again until its effect shows, or until an answer is surely its own
        if pending.command.is_told_by_answer and self._is_doubtful(pending, now_s):
            return  # it is sent again until an answer is surely its own
        if verdict is Verdict.IN_PROGRESS:
            pending.next_s, pending.is_in_progress = now_s + IN_PROGRESS_S, True
        elif verdict is Verdict.REPLACED and not pending.is_in_progress:
            return
        elif verdict is Verdict.PASSED_ON:
            pending.passed_on_s = min(pending.passed_on_s, now_s)
        elif verdict is Verdict.LOST:
            self._fail(pending, now_s, self._lost(pending))
        elif verdict is Verdict.ACCEPTED:
            self._accept(pending, now_s)
        else:
            self._refuse(pending, now_s, text, by)

    def on_text(self, text: str) -> None:
        """Takes a text of the autopilot, which may explain a refusal."""
        for pending in self._in_flight.values():
            if text not in pending.texts and len(pending.texts) < MOST_TEXTS:
                pending.texts.append(text)

    def on_state(self, now_s: float) -> None:
        """Notes that the vehicle's mode, or whether it is armed, was received again: no such change may be missed."""
        if not (self._waiting or self._in_flight):
            return
        self._judge_modes(now_s)
        self._finish_those_shown(now_s)

    def tick(self, now_s: float) -> None:
        """Sends again, and ends what has waited long enough; to be called often."""
        if now_s < self._due_s:
            return
        self._drop(lambda pending: pending.is_withdrawn, now_s)
        self.on_state(now_s)
        for pending in self._those_left(self._in_flight.values()):
            if now_s >= pending.next_s:
                self._go_on(pending, now_s)
        self._give_up_late_ones(now_s)
        self._send_waiting(now_s)
        self._due_s = self._next_due_s()

    # --- What is known ------------------------------------------------------------------------------------------------

    @property
    def is_any_pending(self) -> bool:
        """Whether a command other than a request for data is queued or unanswered."""
        for pending in self._waiting:  # no generator: each turn of the loop asks
            if pending.command.group:
                return True
        for pending in self._in_flight.values():  # noqa: SIM110
            if pending.command.group:
                return True
        return False

    is_any_under_way = renamed_property(is_any_pending, "CommandRunner.is_any_under_way")

    def is_pending(self, command: Command[R]) -> bool:
        """Returns whether an equal command is queued or unanswered."""
        return any(pending.command == command for pending in (*self._waiting, *self._in_flight.values()))

    def wants_state(self, now_s: float) -> bool:
        """Returns whether the mode and armed should be requested now: an answer is late, or a command waits to hear
        them.
        """
        if not self.is_any_pending and all(each.command.shows is None for each in self._in_flight.values()):
            return False
        return any(
            pending.command.shows is not None and now_s - pending.first_s >= LATE_ACK_S
            for pending in self._in_flight.values()
        ) or any(
            pending.command.is_action
            and (
                self._watch.why_silent(now_s)
                or self._unknown(pending, self._snapshot(now_s), now_s)
                or (pending.command.arms and _why_not_arm(self._snapshot(now_s)))
            )
            for pending in self._waiting
        )

    # --- The pilot's rules --------------------------------------------------------------------------------------------

    def _hindrance(self, pending: _PendingCommand[R], now_s: float) -> str:
        """Returns why a command must not be sent now, first or again, human-readable; empty if it may be."""
        command = pending.command
        if not command.is_action:
            return ""
        snapshot = self._snapshot(now_s)
        return (
            self._watch.why_silent(now_s)
            or self._unknown(pending, snapshot, now_s)
            or self._late_hindrance()
            or (_why_not_arm(snapshot) if command.arms else "")
            or ("" if command.waits is None else command.waits(snapshot))
            or self._too_few_setpoints(pending, now_s)
            or (self._not_again(pending, snapshot) if pending.sends_count else "")
        )

    def _unknown(self, pending: _PendingCommand[R], snapshot: Snapshot, now_s: float) -> str:
        """Returns whether what a command changes was reported since the last silence."""
        group = pending.command.group
        if group not in (FLYING, ARMING):
            return ""
        is_mode = group == FLYING
        what, reported = (
            ("its mode", snapshot.control.mode) if is_mode else ("whether it is armed", snapshot.control.armed)
        )
        if reported is None:
            return f"{what} is not known"
        if reported.time_s < self._watch.spoken_s:
            return f"{what} was not heard since the last silence"
        is_old = is_mode and now_s - reported.time_s > pending.command.mode_age_s
        return f"{what} was not heard for {now_s - reported.time_s:.1f} s" if is_old else ""

    def _too_few_setpoints(self, pending: _PendingCommand[R], now_s: float) -> str:
        needs_s = pending.command.setpoints_before_s
        if self._setpoints_s(now_s) >= needs_s or now_s - pending.asked_s >= SETPOINTS_WAIT_S:
            return ""
        return "no setpoints were sent before it"

    def _not_again(self, pending: _PendingCommand[R], snapshot: Snapshot) -> str:
        """Returns why it must not be repeated, by its own table."""
        heard_s, after_s = snapshot.heard_s, pending.command.repeat.after_answer_s
        if heard_s is None or heard_s <= pending.sent_s:
            return "nothing was heard since it was sent"
        if after_s is None:
            return ""
        reported = snapshot.control.mode if pending.command.group == FLYING else snapshot.control.armed
        is_shown = reported is not None and reported.time_s >= pending.passed_on_s + after_s
        return "" if is_shown else "it may still be executed"

    def _has_missed(self, pending: _PendingCommand[R], now_s: float) -> bool:
        """Returns whether a silence came after it was sent: it may have been obeyed, and others may have undone that.

        A mode in which the autopilot takes our references was not chosen against us: what leads out of it goes on.
        """
        command = pending.command
        if command.is_harmless or not pending.sends_count or self._watch.spoken_s <= pending.first_s:
            return False
        mode = self._snapshot(now_s).control.mode
        is_ours = mode is not None and mode.value.control is Control.REFERENCES
        return command.group == ARMING or (command.group == FLYING and not is_ours)

    def _judge_modes(self, now_s: float) -> None:
        """Ends the commands since which others have chosen a mode: sent now, they would take control from those."""
        dependent = [each for each in (*self._waiting, *self._in_flight.values()) if _depends_on_mode(each)]
        if not dependent:
            return
        snapshot = self._snapshot(now_s)
        mode = snapshot.control.mode if snapshot.control.settled_mode else None
        if mode is None:
            return
        for pending in self._those_left(dependent):
            if pending.command.leads_to(mode.value):
                pending.shown_mode = mode.value.name
            elif not pending.from_mode and not pending.shown_mode:
                pending.from_mode = mode.value.name
            elif pending.shown_mode or not _may_still_show(pending, mode):
                self._overtake(pending, mode.value.name, now_s)

    def _overtake(self, pending: _PendingCommand[R], mode: str, now_s: float) -> None:
        """Ends a command because of a mode of others. The effect of a sent one is assessed by the vehicle's state."""
        what = pending.command.what
        if pending.sends_count:
            late = "" if pending.accepts_count or pending.refusal else ", and may still be executed"
            _log.warning("the command to %s is not sent again%s: the mode became %s", what, late, mode)
            self._drop(lambda each: each is pending, now_s)
        else:
            text = f"the command to {what} was not sent: the mode became {mode}"
            _log.warning(text)
            self._fail(pending, now_s, RejectedByAutopilotError(text, {"text": text}))

    def _note_modes(self, pending: _PendingCommand[R], mode: str, now_s: float) -> None:
        """Notes the modes that may be seen without others having chosen them, where one is known (or none: empty)."""
        pending.from_mode = mode
        if self._last is not None and now_s - self._last[1] < OWN_MODE_S:
            pending.before = self._last

    # --- One command --------------------------------------------------------------------------------------------------

    def _key_of(self, command: Command[R]) -> Hashable:
        return object() if command.key is None else command.key

    def _send_waiting(self, now_s: float) -> None:
        for pending in self._those_left(self._waiting):
            if pending.is_withdrawn:
                self._end(pending, now_s)
            elif self._may_be_sent_first(pending, now_s):
                self._waiting.remove(pending)
                self._in_flight[pending.key] = pending
                self._transmit(pending, now_s)

    def _may_be_sent_first(self, pending: _PendingCommand[R], now_s: float) -> bool:
        command = pending.command
        if pending.sends_count or pending.key in self._in_flight:
            return False
        if command.group and now_s - pending.asked_s > command.unsent_s:
            return False
        if command.is_told_by_answer and command.repeat.most == 1 and self._is_doubtful(pending, now_s):
            return False
        return not self._hindrance(pending, now_s)

    def _is_doubtful(self, pending: _PendingCommand[R], now_s: float) -> bool:
        """Returns whether an answer may be that of a command with its key that has ended."""
        return now_s < self._doubtful_until_s.get(pending.key, -math.inf)

    def _transmit(self, pending: _PendingCommand[R], now_s: float) -> None:
        command = pending.command
        if not pending.sends_count:
            self._begin(pending, now_s)
        pending.sent_s, pending.passed_on_s = now_s, math.inf
        pending.sends_count += 1
        pending.next_s = now_s + command.repeat.every_s
        try:
            pending.take_back = self._do_transmit(command.request, pending.sends_count - 1, pending.key)
        except Exception as error:  # noqa: BLE001  logged, and raised to the caller: the link goes on
            self._fail(pending, now_s, defect(command.what, error))

    def _begin(self, pending: _PendingCommand[R], now_s: float) -> None:
        """Notes the mode from which a command leads to its own, when it is sent first."""
        pending.first_s = now_s
        if pending.command.group == ARMING and not pending.follows_mode:
            self._note_modes(pending, CommandContext.at(now_s, self._snapshot(now_s)).mode, now_s)
        if pending.command.group == FLYING:
            self._last = (pending.command, now_s)

    def _go_on(self, pending: _PendingCommand[R], now_s: float) -> None:
        """Does what is due for a command that was sent."""
        command = pending.command
        if (pending.refusal and command.refusal_is_final) or pending.accepts_count:
            self._finish(pending, now_s)
        elif command.is_told_by_answer and now_s - pending.first_s >= command.repeat.every_s * command.repeat.most:
            self._fail(pending, now_s, self._lost(pending))
        elif pending.sends_count < command.repeat.most and not self._has_missed(pending, now_s):
            if not pending.is_withdrawn and not self._hindrance(pending, now_s):
                self._transmit(pending, now_s)
        elif pending.refusal:
            self._finish(pending, now_s)
        elif self._has_missed(pending, now_s):
            self._give_up_missed(pending, now_s)
        elif command.repeat.after_answer_s is None:  # else see `_give_up_bridged`
            level = logging.WARNING if command.group else logging.DEBUG  # requests are repeated
            _log.log(level, "%s did not answer the command to %s", self._name, command.what)
            if command.shows is None and command.group not in (FLYING, ARMING):  # nothing else will tell
                self._fail(pending, now_s, self._lost(pending))
            else:
                self._end(pending, now_s)

    def _give_up_missed(self, pending: _PendingCommand[R], now_s: float) -> None:
        """Ends a command that must not be sent again after a silence, once what it changes was received without it."""
        if now_s - pending.sent_s >= EFFECT_S and not self._unknown(pending, self._snapshot(now_s), now_s):
            text = f"{self._name} has not answered the command to {pending.command.what}, which is not sent again"
            self._fail(pending, now_s, UalTimeoutError(f"{text} after a silence: others may have acted in it"))

    def _give_up_late_ones(self, now_s: float) -> None:
        """Ends the commands that could not leave, or that a bridge did not execute, before the callers give up."""
        for pending in self._those_left((*self._waiting, *self._in_flight.values())):
            limit_s = UNSENT_COMMAND_S if pending.sends_count else pending.command.unsent_s
            if not pending.command.group or now_s - pending.asked_s <= limit_s:
                continue
            if not pending.sends_count:
                why = self._hindrance(pending, now_s) or "an earlier one was not answered"
                text = f"the command to {pending.command.what} was not sent: {why}"
                self._fail(pending, now_s, UalTimeoutError(text))
            elif pending.command.repeat.after_answer_s is not None and not pending.refusal:
                self._give_up_bridged(pending, now_s)

    def _give_up_bridged(self, pending: _PendingCommand[R], now_s: float) -> None:
        if pending.passed_on_s == math.inf:
            self._fail(pending, now_s, self._lost(pending))
        elif pending.texts:
            pending.refusal = "the mode was not entered" if pending.command.group == FLYING else "it was not done"
            self._finish(pending, now_s)

    def _accept(self, pending: _PendingCommand[R], now_s: float) -> None:
        pending.accepts_count += 1
        pending.next_s = now_s + LATER_ACK_S
        if pending.accepts_count >= pending.command.accepts_count:
            self._finish(pending, now_s)

    def _refuse(self, pending: _PendingCommand[R], now_s: float, text: str, by: str) -> None:
        command = pending.command
        pending.refusal, pending.refuser = text or "no reason was given", by
        if not command.refusal_is_final:
            return
        may_be_done = pending.sends_count > 1 and command.shows is not None
        pending.next_s = now_s + (EFFECT_S if may_be_done else self._settings.text_s)
        if command.explain is not None:
            self._do_transmit(command.explain, 0, None)
            pending.next_s = max(pending.next_s, now_s + self._settings.explain_s)

    def _finish_those_shown(self, now_s: float) -> None:
        """Ends the commands whose effect shows: no repetition, and no refusal of one, matters any more."""
        dependent = [pending for pending in self._in_flight.values() if pending.command.shows is not None]
        if not dependent:
            return
        snapshot = self._snapshot(now_s)
        for pending in self._those_left(dependent):
            assert pending.command.shows is not None
            if pending.command.shows(snapshot, pending.first_s):
                pending.refusal = ""
                self._finish(pending, now_s)

    def _finish(self, pending: _PendingCommand[R], now_s: float) -> None:
        """Ends a command that was accepted, has shown its effect, or was refused; or goes on with what follows it."""
        if pending.refusal:
            self._fail(pending, now_s, self._refused(pending))
            return
        command = pending.command
        self._end(pending, now_s)
        if command.on_done is not None:
            command.on_done()
        if command.then is None:
            if not futures.end(pending.result):
                _take_back(pending)  # withdrawn just now
        else:
            self._follow(pending, command.then, now_s)
        self._send_waiting(now_s)

    def _follow(self, pending: _PendingCommand[R], following: Command[R], now_s: float) -> None:
        successor = _PendingCommand(following, self._key_of(following), now_s, pending.result, texts=pending.texts)
        if pending.command.group == FLYING:
            successor.follows_mode = True
            successor.from_mode = pending.shown_mode or pending.from_mode
            successor.before = (pending.command, pending.first_s)
        self._waiting.append(successor)

    def _fail(self, pending: _PendingCommand[R], now_s: float, error: UalError) -> None:
        self._end(pending, now_s)
        _take_back(pending)
        futures.end(pending.result, error)
        self._send_waiting(now_s)

    def _refused(self, pending: _PendingCommand[R]) -> UalError:
        quoted = "".join(f"; it said: {text}" for text in pending.texts)
        texts = {"text": "; ".join(pending.texts)} if pending.texts else {}
        return RejectedByAutopilotError(
            f"{pending.refuser or self._name} refused to {pending.command.what}: {pending.refusal}{quoted}",
            {"result": pending.refusal, **texts, **dict(pending.command.details)},
        )

    def _lost(self, pending: _PendingCommand[R]) -> UalError:
        bridge, what = self._settings.bridge or self._name, pending.command.what
        return UalTimeoutError(f"{bridge} has not answered the command to {what}, which may still be executed")

    def _those_left(self, some: Iterable[_PendingCommand[R]]) -> Iterator[_PendingCommand[R]]:
        """Yields those of some commands that the ones before them have not ended."""
        for pending in list(some):
            if pending in self._waiting or self._in_flight.get(pending.key) is pending:
                yield pending

    def _drop(self, is_meant: Callable[[_PendingCommand[R]], bool], now_s: float) -> None:
        for pending in [each for each in (*self._waiting, *self._in_flight.values()) if is_meant(each)]:
            self._end(pending, now_s)
            _take_back(pending)

    def _next_due_s(self) -> float:
        """Returns when something is due though nothing comes; at once while anything but a request for data is open."""
        due_s = math.inf
        for pending in self._in_flight.values():
            if pending.command.group or pending.command.shows is not None:
                return -math.inf
            due_s = min(due_s, pending.next_s)
        is_any_free = any(each.command.group or each.key not in self._in_flight for each in self._waiting)
        return -math.inf if is_any_free else due_s

    def _end(self, pending: _PendingCommand[R], now_s: float) -> None:
        """Forgets a command."""
        if not pending.sends_count:
            self._waiting.remove(pending)
            return
        del self._in_flight[pending.key]
        if pending.command.key is not None:
            self._ended_s[pending.key] = now_s
            is_answered = pending.accepts_count > 0 or bool(pending.refusal)
            self._doubtful_until_s[pending.key] = now_s + (LATER_ACK_S if is_answered else STALE_ANSWER_S)


def _why_not_arm(snapshot: Snapshot) -> str:
    """Returns what arming would start in the present mode, human-readable; empty where it starts nothing."""
    return "" if snapshot.control.mode is None else snapshot.control.mode.value.arming_starts


def _take_back(pending: _PendingCommand[R]) -> None:
    if pending.take_back is not None:
        pending.take_back()


def _may_still_show(pending: _PendingCommand[R], mode: Sample[Mode]) -> bool:
    """Returns whether a mode may be seen without others having chosen it: the one before, or that of our command
    before.
    """
    if mode.value.name == pending.from_mode:
        return True
    return pending.before is not None and mode.time_s > pending.before[1] and pending.before[0].leads_to(mode.value)


def _depends_on_mode(pending: _PendingCommand[R]) -> bool:
    """Returns whether a mode of others ends it. Arming that was not sent yet overrules nobody, in whatever mode."""
    group, is_harmless = pending.command.group, pending.command.is_harmless
    has_begun = pending.sends_count > 0 or pending.follows_mode
    return not is_harmless and (group == FLYING or (group == ARMING and has_begun))
