"""Sends commands until they are acknowledged or show their effect, one of each kind at a time."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from ual.errors import RejectedByAutopilotError
from ual_daemon.backends.mavlink.dialects.command_long import CommandLong
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import Snapshot

_log = logging.getLogger(__name__)

RESEND_S = 0.25
"""An unanswered command is sent again after this. An autopilot answers within 15 ms, over a bad radio within 200."""
SENDS_COUNT = 20
"""How often a command is sent in all, within `COMMAND_PATIENCE_S` of `ual_daemon.flight`. On a link that loses 30 %
each way and damages 10 % of the rest, 0.4 of the commands are acknowledged: 0.6 to the power of 20 is 4 in 100,000."""
FLYING_GROUP = "mode"
"""The group of the commands that decide who or what flies. They are not repeated while nothing is heard: the safety
pilot may have taken over meanwhile, and an OFFBOARD that arrives then would take control from the pilot."""
ARMING_GROUP = "arm"
"""The group of arming and disarming, which are not repeated then either: the pilot may have disarmed it meanwhile."""
SILENT_S = RESEND_S
"""Where nothing was heard for so long, its mode must be heard again first. An autopilot sends 50 messages a second."""
OWN_MODE_S = 2.0
"""How long the mode of the command before may still be seen first. A PX4 shows a mode within 1 s."""
REQUEST_RESEND_S, REQUEST_SENDS_COUNT = 0.5, 4
"""The same for commands that only request data (of no group). Their acknowledgements do not show which of them they are
for, so no repetition may be on its way any more when the next one is sent; and the next one waits until then."""
IN_PROGRESS_S = 10.0
"""How long to wait for the next acknowledgement after one that says "in progress"."""
LATER_ACK_S = 0.3
"""How long to wait for the second acknowledgement of a command that is acknowledged twice."""
TEXT_S = 0.1
"""How long after a refusal the autopilot's texts about it may come."""
EXPLAIN_S = 0.4
"""The same where the texts must be requested first."""
EFFECT_S = 1.0
"""How long after a refusal the effect may still come, where the command was sent more than once. The refusal may be of
the repetition (a second take-off), because the first one was obeyed and its acknowledgement lost."""
STALE_ACK_S = 1.0
"""How long after the end of a command an acknowledgement may still be its own: one that came twice or late, or that of
a repetition. It carries only the command's id, so it could be taken for that of the next command with this id."""
MOST_TEXTS = 20
"""So many texts may explain a refusal; the others are not kept."""
SETPOINTS_WAIT_S = 3.0
"""A command that needs setpoints is sent after this even without them, so that the autopilot reports what is wrong."""


@dataclass(slots=True)
class _Pending:
    command: CommandLong
    since_s: float
    is_withdrawn: Callable[[], bool]
    future: Future[None] = field(default_factory=Future)
    sends_count: int = 0
    acks_count: int = 0
    sent_s: float = 0.0
    """When it was last sent."""
    first_s: float = 0.0
    """When it was first sent."""
    next_s: float = 0.0
    """When to send it again, or to end the wait for a later acknowledgement, for texts, or for its effect."""
    refusal: str = ""
    texts: list[str] = field(default_factory=list)
    from_modes: frozenset[str] = frozenset()
    """The modes in which it may be sent again: those from which it leads to its own. Empty: none is known yet."""
    is_overtaken: bool = False
    """Whether others have chosen another mode since it was sent."""

    @property
    def max_sends_count(self) -> int:
        return SENDS_COUNT if self.command.group else REQUEST_SENDS_COUNT


class CommandSender:
    """The commands under way to one autopilot. Not thread-safe: belongs to the thread that receives.

    `send` takes a command and how often it was sent before. `setpoints_s` returns for how long setpoints have been
    sent, `snapshot` the newest data of the autopilot. `name` is the autopilot's, for errors.
    """

    def __init__(
        self,
        name: str,
        send: Callable[[CommandLong, int], None],
        setpoints_s: Callable[[float], float],
        snapshot: Callable[[float], Snapshot],
    ) -> None:
        self._name = name
        self._send = send
        self._setpoints_s = setpoints_s
        self._snapshot = snapshot
        self._waiting: deque[_Pending] = deque()
        self._in_flight: dict[int, _Pending] = {}
        self._ended_s: dict[int, float] = {}
        """When the last command of each id ended, or was given up."""
        self._silent_s = -math.inf
        """When it was last noticed that nothing is heard."""
        self._last_mode = ("", -math.inf)
        """The mode to which the newest command leads, and when that was sent."""

    def submit(
        self, command: CommandLong, now_s: float, is_withdrawn: Callable[[], bool] = lambda: False
    ) -> Future[None]:
        """Queues a command; sends it once none with its id is unanswered, and setpoints flow where it needs them.

        The future ends with the acknowledgement or the effect, of the last command where others follow; without either
        it stays open. Once `is_withdrawn`, the command is not sent (again), and none follows.
        """
        pending = _Pending(command, now_s, is_withdrawn)
        pending.future.set_running_or_notify_cancel()  # it cannot be taken back, so it cannot be cancelled
        if is_withdrawn():
            return pending.future
        if command.group:
            # The replaced command's future stays open: what the vehicle does is judged by its state.
            self._drop(lambda other: other.command.group == command.group, now_s)
        self._waiting.append(pending)
        self._send_waiting(now_s)
        return pending.future

    def drop(self, now_s: float) -> None:
        """Drops all commands but requests for data: their vehicle may be another one now. Their futures stay open."""
        self._drop(lambda pending: bool(pending.command.group), now_s)

    def drop_requests(self, command_id: int, now_s: float) -> None:
        """Drops the requests for data with this command: others take their place. Their futures stay open."""
        self._drop(lambda pending: not pending.command.group and pending.command.id == command_id, now_s)

    @property
    def is_any_under_way(self) -> bool:
        """Whether a command other than a request for data is queued or unanswered."""
        return any(pending.command.group for pending in (*self._waiting, *self._in_flight.values()))

    def is_under_way(self, command: CommandLong) -> bool:
        """Returns whether an equal command is queued or unanswered."""
        return any(pending.command == command for pending in (*self._waiting, *self._in_flight.values()))

    def on_ack(self, ack: Message, now_s: float) -> None:
        """Takes a COMMAND_ACK meant for us."""
        pending = self._in_flight.get(ack.command)
        if pending is None or pending.refusal:
            return
        may_be_stale = now_s - self._ended_s.get(ack.command, -math.inf) < STALE_ACK_S
        if may_be_stale and pending.command.shows is not None:
            return  # it is sent again until its effect shows, or until an acknowledgement is surely its own
        if ack.result == mavlink.MAV_RESULT_IN_PROGRESS:
            pending.next_s = now_s + IN_PROGRESS_S
        elif ack.result == mavlink.MAV_RESULT_ACCEPTED:
            pending.acks_count += 1
            pending.next_s = now_s + LATER_ACK_S
            if pending.acks_count >= pending.command.acks_count:
                self._finish(pending, now_s)
        else:
            pending.refusal = _result_name(ack.result)
            may_be_done = pending.sends_count > 1 and pending.command.shows is not None
            pending.next_s = now_s + (EFFECT_S if may_be_done else TEXT_S)
            if pending.command.explain is not None:
                self._send(pending.command.explain, 0)
                pending.next_s = max(pending.next_s, now_s + EXPLAIN_S)

    def on_text(self, text: str) -> None:
        """Takes a text of the autopilot, which may explain a refusal."""
        for pending in self._in_flight.values():
            if text not in pending.texts and len(pending.texts) < MOST_TEXTS:
                pending.texts.append(text)

    def on_state(self, now_s: float) -> None:
        """Takes note that the vehicle's mode, or whether it is armed, was heard anew: no such change may be missed."""
        self._drop_overtaken(now_s)
        self._finish_those_shown(now_s)

    def tick(self, now_s: float) -> None:
        """Sends again, and ends what has waited long enough; to be called often."""
        self._drop(lambda pending: pending.is_withdrawn(), now_s)
        self._notice_silence(now_s)
        self.on_state(now_s)
        for pending in [pending for pending in self._in_flight.values() if now_s >= pending.next_s]:
            if pending.refusal or pending.acks_count:
                self._finish(pending, now_s)
            elif pending.sends_count < pending.max_sends_count:
                if self._may_repeat(pending, now_s):
                    self._transmit(pending, now_s)
            else:
                level = logging.WARNING if pending.command.group else logging.DEBUG  # requests are repeated
                _log.log(level, "%s did not answer the command to %s", self._name, pending.command.what)
                self._end(pending, now_s)
        self._send_waiting(now_s)

    def awaits_effect(self, now_s: float) -> bool:
        """Returns whether an answer is late, so that the vehicle's state should be requested at once."""
        return any(
            pending.command.shows is not None and now_s - pending.first_s >= TEXT_S
            for pending in self._in_flight.values()
        )

    def _notice_silence(self, now_s: float) -> None:
        if any(pending.command.group in (FLYING_GROUP, ARMING_GROUP) for pending in self._in_flight.values()):
            heard_s = self._snapshot(now_s).heard_s
            if heard_s is not None and now_s - heard_s > SILENT_S:
                self._silent_s = now_s

    def _may_repeat(self, pending: _Pending, now_s: float) -> bool:
        """Whether the vehicle has been heard since a command was sent, and what it changes since the last silence."""
        group = pending.command.group
        if group not in (FLYING_GROUP, ARMING_GROUP):
            return True
        snapshot = self._snapshot(now_s)
        heard_s, changed = snapshot.heard_s, snapshot.mode if group == FLYING_GROUP else snapshot.armed
        is_heard = heard_s is not None and heard_s > pending.sent_s
        return is_heard and changed is not None and changed.time_s > self._silent_s

    def _drop_overtaken(self, now_s: float) -> None:
        """Drops the commands for a mode once others have chosen one: repeated, they would take control from those.

        Their futures stay open: what the vehicle does is judged by its state.
        """
        judged = [each for each in (*self._waiting, *self._in_flight.values()) if each.from_modes]
        mode = self._snapshot(now_s).mode if judged else None
        if mode is None:
            return
        name = mode.value.name
        for pending in judged:
            if name == pending.command.mode:
                pending.from_modes = frozenset({name})
            elif name not in pending.from_modes:
                _log.warning("does not repeat the command to %s: the mode became %s", pending.command.what, name)
                pending.is_overtaken = True
        self._drop(lambda pending: pending.is_overtaken, now_s)

    def _begin(self, pending: _Pending, now_s: float) -> None:
        """Takes note of the modes from which a command leads to its own, when it is sent first."""
        pending.first_s = now_s
        if pending.command.group != FLYING_GROUP:
            return
        mode = self._snapshot(now_s).mode
        if mode is not None and not pending.from_modes:
            last, sent_s = self._last_mode
            before = {last} if now_s - sent_s < OWN_MODE_S else set()
            pending.from_modes = frozenset({mode.value.name, *before})
        self._last_mode = (pending.command.mode, now_s)

    def _finish_those_shown(self, now_s: float) -> None:
        """Ends the commands whose effect shows: no repetition, and no refusal of one, matters any more."""
        judged = [pending for pending in self._in_flight.values() if pending.command.shows is not None]
        if not judged:
            return
        snapshot = self._snapshot(now_s)
        for pending in judged:
            assert pending.command.shows is not None
            if pending.command.shows(snapshot, pending.first_s):
                pending.refusal = ""
                self._finish(pending, now_s)

    def _send_waiting(self, now_s: float) -> None:
        for pending in list(self._waiting):
            if pending.is_withdrawn():
                self._waiting.remove(pending)
            elif pending.command.id not in self._in_flight and self._is_ready(pending, now_s):
                self._waiting.remove(pending)
                self._in_flight[pending.command.id] = pending
                self._transmit(pending, now_s)

    def _is_ready(self, pending: _Pending, now_s: float) -> bool:
        needs_s = pending.command.needs_setpoints_s
        return self._setpoints_s(now_s) >= needs_s or now_s - pending.since_s >= SETPOINTS_WAIT_S

    def _transmit(self, pending: _Pending, now_s: float) -> None:
        if not pending.sends_count:
            self._begin(pending, now_s)
        self._send(pending.command, pending.sends_count)
        pending.sent_s = now_s
        pending.sends_count += 1
        pending.next_s = now_s + (RESEND_S if pending.command.group else REQUEST_RESEND_S)

    def _drop(self, is_meant: Callable[[_Pending], bool], now_s: float) -> None:
        for pending in [pending for pending in self._waiting if is_meant(pending)]:
            self._waiting.remove(pending)
        for pending in [pending for pending in self._in_flight.values() if is_meant(pending)]:
            self._end(pending, now_s)

    def _end(self, pending: _Pending, now_s: float) -> None:
        del self._in_flight[pending.command.id]
        self._ended_s[pending.command.id] = now_s

    def _finish(self, pending: _Pending, now_s: float) -> None:
        self._end(pending, now_s)
        following = pending.command.then
        if not pending.refusal and following is not None:
            successor = _Pending(following, now_s, pending.is_withdrawn, pending.future, texts=pending.texts)
            if following.group == FLYING_GROUP:
                successor.from_modes = pending.from_modes
            self._waiting.append(successor)
        elif not pending.refusal:
            pending.future.set_result(None)
        else:
            words = "".join(f"; it said: {text}" for text in pending.texts)
            pending.future.set_exception(
                RejectedByAutopilotError(
                    f"{self._name} refused to {pending.command.what}: {pending.refusal}{words}",
                    {"result": pending.refusal, "command": _command_name(pending.command.id)},
                )
            )
        self._send_waiting(now_s)


def _result_name(result: int) -> str:
    entry = mavlink.enums["MAV_RESULT"].get(result)
    return f"result {result}" if entry is None else str(entry.name).removeprefix("MAV_RESULT_")


def _command_name(command_id: int) -> str:
    entry = mavlink.enums["MAV_CMD"].get(command_id)
    return f"command {command_id}" if entry is None else str(entry.name)
