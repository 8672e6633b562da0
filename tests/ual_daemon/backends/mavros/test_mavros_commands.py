"""Commands, with services that answer when the test says so, and a time that the test steps."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Future

import pytest

from ual.errors import RejectedByAutopilotError, UalTimeoutError
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.mavros import commands, messages
from ual_daemon.backends.mavros.commands import Answer, Commands, Step
from ual_daemon.backends.rosbridge import Message
from ual_daemon.backends.rosbridge.calls import ServiceError, ServiceTimeoutError
from ual_daemon.backends.values import Sample, Snapshot


class Exchange:
    """The safety pilot flies, and control is taken. `calls` are the services that were called."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, Message, Callable[[Answer], None]]] = []
        self.futures: list[Future[Message]] = []
        self.is_held_up = False
        self.is_withdrawn = False
        self.wanted_heartbeats = 0
        self.now_s = 100.0
        self.mode, self.heartbeat_s = "POSCTL", 100.0
        self.silent_s = math.inf
        """Since when nothing is heard."""
        self.commands = Commands("PX4", self._call, lambda _: 10.0, lambda: self.is_held_up, self._want_heartbeat)
        step = commands.set_mode("OFFBOARD", "take control")
        self.done = self.commands.submit((step,), self.snapshot(), lambda: self.is_withdrawn)

    def _call(
        self, service: str, arguments: Message, take: Callable[[Answer], None], limit_s: float
    ) -> Future[Message]:
        self.calls.append((service, arguments, take))
        self.futures.append(Future())
        return self.futures[-1]

    def _want_heartbeat(self) -> None:
        self.wanted_heartbeats += 1

    def snapshot(self) -> Snapshot:
        mode = Sample(messages.mode(self.mode, Px4()), self.heartbeat_s)
        return Snapshot(self.now_s, heard_s=min(self.now_s, self.silent_s), mode=mode)

    def step(self, duration_s: float, *, heartbeat: str = "") -> None:
        """Lets time pass. A heartbeat comes at its end, if at all; before the first call ten a second come."""
        for _ in range(round(duration_s / 0.02)):
            self.now_s += 0.02
            if not self.calls and self.now_s < self.silent_s and self.now_s - self.heartbeat_s >= 0.1:
                self.heartbeat_s = self.now_s
            self.commands.tick(self.snapshot())
        if heartbeat:
            self.mode, self.heartbeat_s = heartbeat, self.now_s
            self.commands.tick(self.snapshot())

    def answer(self, **values: object) -> None:
        self.calls[-1][2](values)


def test_a_mode_that_was_not_answered_is_not_asked_for_again() -> None:
    it = Exchange()
    it.step(4.0, heartbeat="POSCTL")
    it.step(4.0, heartbeat="POSCTL")
    assert len(it.calls) == 1


def test_a_mode_is_asked_for_again_when_a_heartbeat_after_the_answer_shows_the_old_one() -> None:
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


def test_a_heartbeat_that_is_old_when_a_mode_may_be_asked_for_again_is_not_enough() -> None:
    it = Exchange()
    it.step(0.02)
    it.answer(mode_sent=True)
    it.step(0.5, heartbeat="POSCTL")
    it.step(3.0)
    assert len(it.calls) == 1


def test_a_mode_is_asked_for_again_where_a_heartbeat_comes_each_second() -> None:
    it = Exchange()
    for count in range(1, 5):
        it.step(0.1)
        assert len(it.calls) == count
        it.answer(mode_sent=True)
        it.step(0.9, heartbeat="POSCTL")


def test_a_heartbeat_is_wanted_once_a_mode_was_sent() -> None:
    it = Exchange()
    it.step(0.1)
    assert it.wanted_heartbeats == 0
    it.answer(mode_sent=True)
    assert it.wanted_heartbeats == 1


def test_a_mode_that_was_shown_is_not_asked_for_again() -> None:
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
    it.is_held_up, it.is_withdrawn = False, True
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
    assert not it.futures[0].cancelled()
    if end == "dropped":
        it.commands.drop()
    elif end == "replaced":
        it.commands.submit((commands.set_mode("AUTO.LAND", "land"),), it.snapshot(), lambda: False)
    it.is_withdrawn = end == "withdrawn"
    it.step(0.1, heartbeat="ALTCTL" if end == "overruled" else "POSCTL")
    it.step(5.0 if end == "late" else 0.1)
    assert it.futures[0].cancelled()


@pytest.mark.parametrize(
    "step",
    [commands.set_mode("AUTO.LAND", "land"), commands.arm_or_disarm(is_arming=True), commands.climb(3.0)],
    ids=lambda step: step.what,
)
def test_a_command_into_a_silence_is_not_sent_but_fails_in_words(step: Step) -> None:
    it = Exchange()
    it.silent_s = 99.6
    done = it.commands.submit((step,), it.snapshot(), lambda: False)
    it.step(4.4)
    assert not done.done()
    it.step(0.2)
    assert not it.calls
    with pytest.raises(UalTimeoutError, match=f"command to {step.what} was not sent: MAVROS publishes nothing of"):
        done.result(0.0)


def test_a_command_into_a_silence_leaves_with_the_first_heartbeat_that_shows_the_same_mode() -> None:
    it = Exchange()
    it.silent_s = 99.6
    it.step(3.0)
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
    it.calls[-1][2](ServiceError("/mavros/set_mode", "Service /mavros/set_mode does not exist"))
    it.step(1.0)
    with pytest.raises(RejectedByAutopilotError, match=r"MAVROS refused to take control: /mavros/set_mode.*not exist"):
        it.done.result(0.0)
    assert len(it.calls) == 1


def test_a_service_that_has_not_answered_in_time_refuses_nothing() -> None:
    it = Exchange()
    it.step(0.1)
    it.calls[-1][2](ServiceTimeoutError("/mavros/set_mode", "the service has not answered"))
    it.step(1.0, heartbeat="OFFBOARD")
    assert it.done.done()
    assert it.done.exception() is None
