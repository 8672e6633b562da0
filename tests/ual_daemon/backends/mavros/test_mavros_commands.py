"""The commands' table, with services that answer when the test says so, and a time that the test steps."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

import pytest

from ual.errors import RejectedByAutopilotError, UalTimeoutError
from ual_daemon.backends.engine.command import Command, Verdict
from ual_daemon.backends.engine.command_runner import CommandRunner, RunnerSettings
from ual_daemon.backends.engine.link_watch import LinkWatch
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.mavros import commands, messages
from ual_daemon.backends.mavros.commands import TEXT_S, Answer, MavrosCall, read_answer
from ual_daemon.backends.rosbridge.calls import PendingCalls, ServiceError, ServiceTimeoutError
from ual_daemon.backends.values import ControlState, Sample, Snapshot


class Exchange:
    """The safety pilot flies, and control is taken. `calls` are the services that were called."""

    def __init__(self) -> None:
        self.calls: list[tuple[MavrosCall, Hashable]] = []
        self.taken_back: list[int] = []
        self.is_held_up = False
        self.now_s = 100.0
        self.mode, self.heartbeat_s = "POSCTL", 100.0
        self.silent_s = math.inf
        """Since when nothing is heard."""
        self.watch = LinkWatch("rosbridge", 1.0)
        self.watch.on_message(self.now_s)
        self.runner: CommandRunner[MavrosCall] = CommandRunner(
            "PX4",
            self._call,
            lambda _: self.snapshot(),
            self.watch,
            lambda _: 10.0,
            RunnerSettings(TEXT_S, bridge="MAVROS"),
            lambda: "held up" if self.is_held_up else "",
        )
        self.is_held_up = True
        self.done = self.runner.submit(commands.set_mode("OFFBOARD", "take control"), self.now_s)
        self.is_held_up = False

    def _call(self, call: MavrosCall, _: int, key: Hashable) -> Callable[[], object]:
        self.calls.append((call, key))
        number = len(self.calls) - 1
        return lambda: self.taken_back.append(number)

    def snapshot(self) -> Snapshot:
        mode = Sample(messages.mode(self.mode, Px4()), self.heartbeat_s)
        armed = Sample(False, self.heartbeat_s)
        return Snapshot(self.now_s, heard_s=self.watch.heard_s, control=ControlState(mode=mode, armed=armed))

    def step(self, duration_s: float, *, heartbeat: str = "") -> None:
        """Lets time pass. A heartbeat comes at its end, if at all; before the first call ten a second come."""
        for _ in range(round(duration_s / 0.02)):
            self.now_s += 0.02
            if self.now_s < self.silent_s:
                self.watch.on_message(self.now_s)
            if not self.calls and self.now_s < self.silent_s and self.now_s - self.heartbeat_s >= 0.1:
                self.heartbeat_s = self.now_s
            self.runner.tick(self.now_s)
        if heartbeat:
            self.mode, self.heartbeat_s = heartbeat, self.now_s
            self.runner.tick(self.now_s)

    def answer(self, error: Answer | None = None, **values: object) -> None:
        call, key = self.calls[-1]
        reply = read_answer(call, values if error is None else error)
        self.runner.on_answer(key, reply.verdict, self.now_s, reply.text, reply.by)


def test_a_mode_that_was_not_answered_is_not_requested_again() -> None:
    it = Exchange()
    it.step(4.0, heartbeat="POSCTL")
    it.step(4.0, heartbeat="POSCTL")
    assert len(it.calls) == 1


def test_a_mode_is_requested_again_when_a_heartbeat_after_the_answer_shows_the_old_one() -> None:
    it = Exchange()
    it.step(0.1)
    it.answer(mode_sent=True)
    it.step(2.0)
    assert len(it.calls) == 1  # nothing was heard since
    it.step(0.1, heartbeat="POSCTL")
    assert len(it.calls) == 2


@pytest.mark.parametrize("after_s", [0.02, 0.28])
def test_a_heartbeat_right_after_the_answer_does_not_say_that_a_mode_was_not_entered(after_s: float) -> None:
    it = Exchange()
    it.step(0.7)
    it.answer(mode_sent=True)
    it.step(after_s, heartbeat="POSCTL")
    it.step(3.0)
    assert len(it.calls) == 1


def test_a_heartbeat_that_is_old_when_a_mode_may_be_requested_again_is_not_enough() -> None:
    it = Exchange()
    it.step(0.02)
    it.answer(mode_sent=True)
    it.step(0.5, heartbeat="POSCTL")
    it.step(3.0)
    assert len(it.calls) == 1


def test_a_mode_is_requested_again_where_a_heartbeat_comes_each_second() -> None:
    it = Exchange()
    for count in range(1, 5):
        it.step(0.1)
        assert len(it.calls) == count
        it.answer(mode_sent=True)
        it.step(0.9, heartbeat="POSCTL")


def test_a_mode_that_was_shown_is_not_requested_again() -> None:
    it = Exchange()
    it.step(0.1)
    it.answer(mode_sent=True)
    it.step(0.1, heartbeat="OFFBOARD")
    assert it.done.done()
    it.step(5.0, heartbeat="POSCTL")
    assert len(it.calls) == 1


def test_a_mode_waits_until_nothing_holds_up_its_call_and_is_not_sent_once_it_is_withdrawn() -> None:
    it = Exchange()
    it.is_held_up = True
    it.step(1.0)
    assert not it.calls
    it.is_held_up = False
    it.done.cancel()
    it.step(1.0)
    assert not it.calls


def test_a_mode_leaves_once_nothing_holds_up_its_call() -> None:
    it = Exchange()
    it.is_held_up = True
    it.step(1.0)
    it.is_held_up = False
    it.step(0.1)
    assert len(it.calls) == 1


def test_a_mode_that_waits_is_not_sent_once_somebody_else_has_changed_the_mode() -> None:
    it = Exchange()
    it.is_held_up = True
    it.step(0.3, heartbeat="ALTCTL")
    it.is_held_up = False
    it.step(1.0, heartbeat="ALTCTL")
    assert not it.calls


@pytest.mark.parametrize("end", ["dropped", "withdrawn", "replaced", "overruled", "late"])
def test_the_call_of_a_command_that_has_ended_is_withdrawn(end: str) -> None:
    it = Exchange()
    it.step(0.1)
    assert not it.taken_back
    if end == "dropped":
        it.runner.drop(it.now_s)
    elif end == "replaced":
        it.runner.submit(commands.set_mode("AUTO.LAND", "land"), it.now_s)
    elif end == "withdrawn":
        it.done.cancel()
    it.step(0.1, heartbeat="ALTCTL" if end == "overruled" else "POSCTL")
    it.step(5.0 if end == "late" else 0.1)
    assert it.taken_back[0] == 0


@pytest.mark.parametrize(
    "command",
    [commands.set_mode("AUTO.LAND", "land"), commands.arm_or_disarm(is_arming=True), commands.climb(3.0)],
    ids=lambda command: command.what,
)
def test_a_command_into_a_silence_is_not_sent_but_fails_in_words(command: Command[MavrosCall]) -> None:
    it = Exchange()
    it.silent_s = 100.0
    it.step(0.3)
    it.done.cancel()
    calls_count = len(it.calls)
    done = it.runner.submit(command, it.now_s)
    it.step(4.4)
    assert not done.done()
    it.step(0.2)
    assert len(it.calls) == calls_count
    with pytest.raises(UalTimeoutError, match=f"command to {command.what} was not sent: nothing was heard of the auto"):
        done.result(0.0)


def test_a_command_into_a_silence_leaves_with_the_first_heartbeat_that_shows_the_same_mode() -> None:
    it = Exchange()
    it.is_held_up, it.silent_s = True, 100.0
    it.step(3.0)
    it.is_held_up = False
    it.step(0.5)
    assert not it.calls
    it.silent_s = math.inf
    it.step(0.02, heartbeat="POSCTL")
    assert len(it.calls) == 1


def test_a_command_that_was_sent_and_never_answered_may_still_be_executed() -> None:
    it = Exchange()
    it.step(0.1)
    it.silent_s = it.now_s
    it.step(5.0)
    assert len(it.calls) == 1
    with pytest.raises(UalTimeoutError, match="has not answered the command to take control, which may still be exec"):
        it.done.result(0.0)


def test_a_service_that_is_not_there_refuses_by_its_name() -> None:
    it = Exchange()
    it.step(0.1)
    it.answer(ServiceError("/mavros/set_mode", "Service /mavros/set_mode does not exist"))
    it.step(1.0)
    with pytest.raises(RejectedByAutopilotError, match=r"MAVROS refused to take control: /mavros/set_mode.*not exist"):
        it.done.result(0.0)
    assert len(it.calls) == 1


def test_a_service_that_has_not_answered_in_time_refuses_nothing() -> None:
    it = Exchange()
    it.step(0.1)
    it.answer(ServiceTimeoutError("/mavros/set_mode", "the service has not answered"))
    with pytest.raises(UalTimeoutError, match="MAVROS has not answered the command to take control, which may still"):
        it.done.result(0.0)


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        ({"mode_sent": False}, "PX4 refused to take control: MAVROS does not know the mode, or hears no autopilot"),
        ({"mode_sent": True}, "PX4 refused to take control: the mode was not entered; it said: no position"),
    ],
)
def test_why_a_mode_was_not_entered_is_reported(answer: dict[str, object], text: str) -> None:
    it = Exchange()
    it.step(0.1)
    it.answer(answer)
    if answer["mode_sent"]:
        it.runner.on_text("no position")
    it.step(5.0)
    with pytest.raises(RejectedByAutopilotError, match=text):
        it.done.result(0.0)


@pytest.mark.parametrize(
    ("answer", "after_s", "verdict", "text"),
    [
        ({"success": True, "result": 0}, 0.1, Verdict.ACCEPTED, ""),
        ({"success": False, "result": 2}, 0.1, Verdict.REFUSED, "DENIED"),
        ({"success": False, "result": 2}, 5.0, Verdict.REFUSED, "DENIED"),
        ({"success": False, "result": 4}, 0.1, Verdict.REFUSED, "FAILED"),
        ({"success": False, "result": 4}, 5.0, Verdict.LOST, ""),  # what MAVROS says where none came
        ({"success": False, "result": 99}, 0.1, Verdict.REFUSED, "result 99"),
        ({"success": False, "result": 5}, 0.1, Verdict.PASSED_ON, ""),
        ({"success": False, "result": 0}, 0.1, Verdict.PASSED_ON, ""),  # no acknowledgement came
    ],
)
@pytest.mark.parametrize(
    "command", [commands.arm_or_disarm(is_arming=True), commands.climb(3.0)], ids=lambda command: command.what
)
def test_what_the_answers_to_commands_say(
    command: Command[MavrosCall], answer: dict[str, object], after_s: float, verdict: Verdict, text: str
) -> None:
    reply = read_answer(command.request, answer, after_s)
    assert (reply.verdict, reply.text) == (verdict, text)


@pytest.mark.parametrize(
    "text",
    [
        "transport error completing service call: unable to receive data from sender",
        "service [/mavros/cmd/arming] returned no response",
        "node shutdown interrupted service call",
        "Timeout exceeded while waiting for service response",
        "Service call exception: the client was destroyed",
    ],
)
def test_a_call_whose_answer_the_bridge_has_lost_may_have_been_executed(text: str) -> None:
    calls = PendingCalls()
    ident, answer = calls.begin("/mavros/cmd/arming", 0.0, 6.0)
    calls.answer({"op": "service_response", "id": ident, "values": text, "result": False})
    error = answer.exception(0.0)
    assert isinstance(error, ServiceError)
    assert read_answer(commands.arm_or_disarm(is_arming=True).request, error).verdict is Verdict.LOST
