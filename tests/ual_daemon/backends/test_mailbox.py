"""The mailbox for setpoints of autopilots whose sending blocks."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from queue import SimpleQueue

import pytest

from tests.waiting import LIMIT_S, until
from ual.geometry import Vector3
from ual_daemon.backends.mailbox import SetpointMailbox
from ual_daemon.backends.values import Setpoint, VelocitySetpoint


class Clock:
    """Stands still. Says each time that somebody has read it."""

    def __init__(self) -> None:
        self.now = 100.0
        self.readings: SimpleQueue[float] = SimpleQueue()

    def now_s(self) -> float:
        self.readings.put(self.now)
        return self.now

    def wait_for_readings(self, count: int) -> None:
        for _ in range(count):
            self.readings.get(timeout=LIMIT_S)


class Autopilot:
    """Takes a setpoint, and answers it when it is let."""

    def __init__(self) -> None:
        self.began: SimpleQueue[float] = SimpleQueue()
        self.may_answer = threading.Semaphore(0)
        self.error: Exception | None = None

    def send(self, setpoint: Setpoint) -> None:
        self.began.put(setpoint.velocity.x)
        assert self.may_answer.acquire(timeout=LIMIT_S)
        if self.error is not None:
            raise self.error

    def next(self) -> float:
        return self.began.get(timeout=LIMIT_S)


@pytest.fixture
def autopilot() -> Autopilot:
    return Autopilot()


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def mailbox(autopilot: Autopilot, clock: Clock) -> Iterator[SetpointMailbox]:
    box = SetpointMailbox(autopilot.send, clock, "mailbox")
    box.open()
    yield box
    autopilot.may_answer.release(100)
    box.close()


def velocity(x: float) -> VelocitySetpoint:
    return VelocitySetpoint(Vector3(x))


def test_who_settles_waits_for_the_setpoint_that_is_en_route(mailbox: SetpointMailbox, autopilot: Autopilot) -> None:
    mailbox.put(velocity(1.0))
    assert autopilot.next() == 1.0
    mailbox.put(velocity(2.0))
    settled = threading.Event()

    def settle() -> None:
        mailbox.settle()
        settled.set()

    thread = threading.Thread(target=settle)
    thread.start()
    until(lambda: mailbox._newest is None)
    assert not settled.is_set()
    autopilot.may_answer.release()
    thread.join(LIMIT_S)
    assert settled.is_set()
    mailbox.put(velocity(3.0))
    assert autopilot.next() == 3.0, "the second was dropped"
    autopilot.may_answer.release()


def test_a_slow_autopilot_gets_the_newest_and_skips_those_between(
    mailbox: SetpointMailbox, autopilot: Autopilot
) -> None:
    mailbox.put(velocity(1.0))
    assert autopilot.next() == 1.0
    for x in (2.0, 3.0, 4.0):
        mailbox.put(velocity(x))  # none of them blocks, though the first one has no answer yet
    autopilot.may_answer.release(2)
    assert autopilot.next() == 4.0
    mailbox.close()
    assert autopilot.began.empty()


def test_one_that_had_to_wait_for_too_long_does_not_leave(
    mailbox: SetpointMailbox, autopilot: Autopilot, clock: Clock
) -> None:
    mailbox.put(velocity(1.0))
    autopilot.next()
    mailbox.put(velocity(2.0))
    clock.wait_for_readings(3)  # both when they were put, and the first one before it left
    clock.now += 0.6
    autopilot.may_answer.release()
    clock.wait_for_readings(1)  # the second one was judged
    mailbox.put(velocity(3.0))
    assert autopilot.next() == 3.0


def test_one_that_was_dropped_does_not_leave(mailbox: SetpointMailbox, autopilot: Autopilot) -> None:
    mailbox.put(velocity(1.0))
    autopilot.next()
    mailbox.put(velocity(2.0))
    mailbox.drop()
    autopilot.may_answer.release()
    mailbox.put(velocity(3.0))
    assert autopilot.next() == 3.0


def test_an_autopilot_that_refuses_gets_the_next_one_and_the_log_says_so_once(
    mailbox: SetpointMailbox, autopilot: Autopilot, caplog: pytest.LogCaptureFixture
) -> None:
    autopilot.error = OSError("the bridge is gone")
    autopilot.may_answer.release(3)
    for x in (1.0, 2.0, 3.0):
        mailbox.put(velocity(x))
        assert autopilot.next() == x
    mailbox.close()
    assert caplog.messages == ['setpoint_not_sent why="the bridge is gone"']
    assert caplog.records[0].levelname == "WARNING"


def test_its_own_thread_may_close_it() -> None:
    ended = threading.Event()

    def send(_: Setpoint) -> None:
        box.close()
        ended.set()

    box = SetpointMailbox(send, Clock(), "mailbox")
    box.open()
    box.put(velocity(1.0))
    assert ended.wait(LIMIT_S)
    box.close()


def test_one_that_was_never_opened_can_be_closed() -> None:
    SetpointMailbox(lambda _: None, Clock(), "mailbox").close()
