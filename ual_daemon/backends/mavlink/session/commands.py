"""Commands and their acknowledgements: sent again while unanswered, one of each kind at a time."""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from ual.errors import RejectedByAutopilotError
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink
from ual_daemon.backends.values import LandedState, Snapshot

_log = logging.getLogger(__name__)

RESEND_S = 0.25
"""An unanswered command is sent again after this; an autopilot answers within 15 ms, a bad radio within 200."""
SENDS_COUNT = 20
"""How often a command is sent in all, within `COMMAND_PATIENCE_S` of `ual_daemon.flight.autopilot_command`. Of a link
that loses 30 % each way and damages 10 % of the rest, 0.4 of the commands come back answered: 0.6 to the power of 20 is
4 in 100,000."""
REQUEST_RESEND_S, REQUEST_SENDS_COUNT = 0.5, 4
"""The same for what is only asked for (of no group). Acknowledgements of such requests cannot be told apart, so that a
repetition must not be on its way any more when the next is sent; and the next one waits for it."""
IN_PROGRESS_S = 10.0
"""How long one that the autopilot says it works on may take until its next word."""
LATER_ACK_S = 0.3
"""How long to wait for the second acknowledgement of a command that is acknowledged twice."""
TEXT_S = 0.1
"""How long after a refusal the autopilot's words about it may come."""
EXPLAIN_S = 0.4
"""The same where it must be asked for its words first."""
EFFECT_S = 1.0
"""How long after the refusal of a command that was sent more than once its effect may come: what was refused may be the
repetition (a second take-off), because the first one was obeyed and its acknowledgement lost."""
STALE_ACK_S = 1.0
"""How long after the end of a command an acknowledgement may still be its own: one that came twice, or late, or that of
a repetition. It has the command's number only, so that it could be taken for that of the next one of that number."""
SETPOINTS_WAIT_S = 3.0
"""A command that needs setpoints is sent after this in any case: let the autopilot say what is wrong."""


@dataclass(frozen=True, slots=True)
class Command:
    """A COMMAND_LONG: `params` from the first, zeros follow.

    `what` is for people ("arm"). Of one `group` only the newest is kept. `acks_count` is how often it is acknowledged.
    `needs_setpoints_s` is for how long setpoints must have been sent before it. `shows` says whether a snapshot taken
    since it was sent shows its effect, whatever was acknowledged. `explain` makes the autopilot say why it refused.
    `then` follows once it is accepted.
    """

    id: int
    params: tuple[float, ...]
    what: str
    group: str = ""
    acks_count: int = 1
    needs_setpoints_s: float = 0.0
    shows: Callable[[Snapshot, float], bool] | None = field(default=None, compare=False)
    explain: Command | None = None
    then: Command | None = None


def arm_or_disarm(*, is_arming: bool) -> Command:
    """Arms or disarms, never by force."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        armed = snapshot.armed
        return armed is not None and armed.time_s > since_s and armed.value is is_arming

    what = "arm" if is_arming else "disarm"
    return Command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (float(is_arming),), what, group="arm", shows=shows)


def shows_mode(name: str) -> Callable[[Snapshot, float], bool]:
    """For `Command.shows`: the autopilot is in a mode of this name."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        mode = snapshot.mode
        return mode is not None and mode.time_s > since_s and mode.value.name == name

    return shows


def shows_landed(*states: LandedState) -> Callable[[Snapshot, float], bool]:
    """For `Command.shows`: it is in one of these landed states."""

    def shows(snapshot: Snapshot, since_s: float) -> bool:
        landed = snapshot.landed
        return landed is not None and landed.time_s > since_s and landed.value in states

    return shows


def set_interval(message_id: int, rate_hz: float) -> Command:
    """Asks to be sent a message at a rate."""
    return Command(
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, (float(message_id), 1e6 / rate_hz), f"stream message {message_id}"
    )


def request_message(message_id: int) -> Command:
    """Asks to be sent a message once."""
    return Command(mavlink.MAV_CMD_REQUEST_MESSAGE, (float(message_id),), f"send message {message_id}")


@dataclass(slots=True)
class _Pending:
    command: Command
    since_s: float
    is_withdrawn: Callable[[], bool]
    future: Future[None] = field(default_factory=Future)
    sends_count: int = 0
    acks_count: int = 0
    first_s: float = 0.0
    """When it was first sent."""
    next_s: float = 0.0
    """When to send it again, or to end the wait for a later acknowledgement, for words, or for its effect."""
    refusal: str = ""
    texts: list[str] = field(default_factory=list)

    @property
    def sends_at_most_count(self) -> int:
        return SENDS_COUNT if self.command.group else REQUEST_SENDS_COUNT


class Commands:
    """The commands under way to one autopilot. Not thread-safe: belongs to the thread that receives.

    `send` takes a command and how often it was sent before. `setpoints_s` says for how long setpoints have been sent,
    `snapshot` what the autopilot said last.
    """

    def __init__(
        self,
        name: str,
        send: Callable[[Command, int], None],
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
        """When the last command of each number ended, or was given up."""

    def submit(self, command: Command, now_s: float, is_withdrawn: Callable[[], bool] = lambda: False) -> Future[None]:
        """Sends a command when its turn comes; the future ends with its acknowledgement or its effect, or stays open
        without either.

        Where another command follows it, that is the last one's. Once `is_withdrawn` it is not sent (again), and none
        follows: nobody wants its effect any more.
        """
        pending = _Pending(command, now_s, is_withdrawn)
        pending.future.set_running_or_notify_cancel()  # it cannot be taken back, so it cannot be cancelled
        if is_withdrawn():
            return pending.future
        if command.group:
            # What the vehicle does is judged by its state, not by the end of the command that a newer one replaces.
            self._forget(lambda other: other.command.group == command.group, now_s)
        self._waiting.append(pending)
        self._send_waiting(now_s)
        return pending.future

    @property
    def is_any_under_way(self) -> bool:
        """Whether one waits for its turn or its acknowledgement that is more than a request to be told something."""
        return any(pending.command.group for pending in (*self._waiting, *self._in_flight.values()))

    def is_under_way(self, command: Command) -> bool:
        """Whether an equal command waits for its turn or its acknowledgement."""
        return any(pending.command == command for pending in (*self._waiting, *self._in_flight.values()))

    def on_ack(self, ack: Message, now_s: float) -> None:
        """Takes a COMMAND_ACK meant for us."""
        pending = self._in_flight.get(ack.command)
        if pending is None or pending.refusal:
            return
        may_be_stale = now_s - self._ended_s.get(ack.command, -math.inf) < STALE_ACK_S
        if may_be_stale and pending.command.shows is not None:
            return  # it is sent again until its effect shows, or until it is answered for sure
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
        """Takes the autopilot's words: they may explain a refusal."""
        for pending in self._in_flight.values():
            if text not in pending.texts:
                pending.texts.append(text)

    def tick(self, now_s: float) -> None:
        """Does what time asks for; to be called often."""
        self._forget(lambda pending: pending.is_withdrawn(), now_s)
        self._finish_those_shown(now_s)
        for pending in [pending for pending in self._in_flight.values() if now_s >= pending.next_s]:
            if pending.refusal or pending.acks_count:
                self._finish(pending, now_s)
            elif pending.sends_count < pending.sends_at_most_count:
                self._transmit(pending, now_s)
            else:
                level = logging.WARNING if pending.command.group else logging.DEBUG  # requests are made again
                _log.log(level, "%s did not answer the command to %s", self._name, pending.command.what)
                self._end(pending, now_s)
        self._send_waiting(now_s)

    def awaits_effect(self, now_s: float) -> bool:
        """Whether a command is late to be answered, so that it matters to see soon what the vehicle does."""
        return any(
            pending.command.shows is not None and now_s - pending.first_s >= TEXT_S
            for pending in self._in_flight.values()
        )

    def _finish_those_shown(self, now_s: float) -> None:
        """Those whose effect is there are done: no repetition, and no refusal of one, matters any more."""
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
            pending.first_s = now_s
        self._send(pending.command, pending.sends_count)
        pending.sends_count += 1
        pending.next_s = now_s + (RESEND_S if pending.command.group else REQUEST_RESEND_S)

    def _forget(self, is_meant: Callable[[_Pending], bool], now_s: float) -> None:
        for pending in [pending for pending in self._waiting if is_meant(pending)]:
            self._waiting.remove(pending)
        for pending in [pending for pending in self._in_flight.values() if is_meant(pending)]:
            self._end(pending, now_s)

    def _end(self, pending: _Pending, now_s: float) -> None:
        """It is under way no more."""
        del self._in_flight[pending.command.id]
        self._ended_s[pending.command.id] = now_s

    def _finish(self, pending: _Pending, now_s: float) -> None:
        self._end(pending, now_s)
        following = pending.command.then
        if not pending.refusal and following is not None:
            self._waiting.append(_Pending(following, now_s, pending.is_withdrawn, pending.future, texts=pending.texts))
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
