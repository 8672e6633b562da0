"""Commands whose answer is all that shows whether they were obeyed: the runner's rules of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.ual_daemon.backends.engine.test_command_runner import Plain
from ual.errors import UalTimeoutError
from ual_daemon.backends.engine.command import ARMING, FLYING, Command, Repeat, Verdict
from ual_daemon.backends.engine.command_runner import LATER_ACK_S, STALE_ANSWER_S

DROP = Command("drop", "drop", "claw", "claw", repeat=Repeat(3.0, 1), unsent_s=1.5, is_told_by_answer=True)
HOLD = replace(DROP, what="hold", request="hold", repeat=Repeat(0.25, 12))
ELSEWHERE = replace(DROP, what="drop elsewhere", request="elsewhere", group="hand")


@pytest.fixture
def plain() -> Plain:
    return Plain()


def test_a_missing_answer_ends_the_future(plain: Plain) -> None:
    dropped = plain.runner.submit(DROP, plain.now_s)
    plain.run(2.9)
    assert not dropped.done()
    plain.run(0.2)
    error = dropped.exception(0)
    assert isinstance(error, UalTimeoutError)
    assert error.message == "Hover has not answered the command to drop, which may still be executed"
    assert plain.sent == ["drop"]


@pytest.mark.parametrize(("most", "group"), [(1, "camera"), (4, "camera"), (4, "")])
def test_what_nothing_shows_ends_without_an_answer(plain: Plain, most: int, group: str) -> None:
    """Its future never ended: the caller waited for 18 s, and was told that, while the log knew after 5 s."""
    ordered = Command("stop", "stop", group, "camera", repeat=Repeat(1.0, most))
    asked = plain.runner.submit(ordered, plain.now_s)
    plain.run(most - 0.1)
    assert not asked.done()
    plain.run(0.3)
    error = asked.exception(0)
    assert isinstance(error, UalTimeoutError)
    assert error.message == "Hover has not answered the command to stop, which may still be executed"


@pytest.mark.parametrize("group", [FLYING, ARMING])
def test_what_the_state_shows_stays_open(plain: Plain, group: str) -> None:
    """Its callers judge what the vehicle does."""
    ordered = Command("go", "go", group, "go", mode="manual", repeat=Repeat(1.0, 2))
    asked = plain.runner.submit(ordered, plain.now_s)
    plain.run(2.5)
    assert not asked.done()


def test_in_progress_is_waited_for(plain: Plain) -> None:
    dropped = plain.runner.submit(DROP, plain.now_s)
    plain.answer(Verdict.IN_PROGRESS)
    plain.run(9.0)
    assert not dropped.done()
    plain.answer(Verdict.ACCEPTED)
    assert dropped.result(0) is None


def test_an_answer_that_may_be_of_another_is_not_taken(plain: Plain) -> None:
    """Late answers to an order that was replaced are possible. One that repeats waits for a sure one."""
    plain.runner.submit(DROP, plain.now_s)
    plain.run(0.2)
    held = plain.runner.submit(HOLD, plain.now_s)
    plain.answer(Verdict.ACCEPTED)
    plain.run(STALE_ANSWER_S - 0.1)
    plain.answer(Verdict.REFUSED)
    plain.run(0.2)
    assert not held.done()
    plain.answer(Verdict.ACCEPTED)
    assert held.result(0) is None


def test_what_is_sent_once_waits_until_its_answer_is_sure(plain: Plain) -> None:
    plain.runner.submit(HOLD, plain.now_s).cancel()
    plain.run(0.05)
    dropped = plain.runner.submit(DROP, plain.now_s)
    plain.run(STALE_ANSWER_S - 0.15)
    assert plain.sent == ["hold"]
    plain.run(0.2)
    assert plain.sent == ["hold", "drop"]
    plain.answer(Verdict.ACCEPTED)
    assert dropped.result(0) is None
    plain.runner.submit(ELSEWHERE, plain.now_s)  # the first answer may come twice
    plain.run(LATER_ACK_S - 0.1)
    assert plain.sent == ["hold", "drop"]
    plain.run(0.15)
    assert plain.sent == ["hold", "drop", "elsewhere"]


def test_what_could_not_leave_in_its_time_does_not_leave(plain: Plain) -> None:
    plain.run(0.5, mode="")
    dropped = plain.runner.submit(DROP, plain.now_s)
    plain.run(1.6, mode="")
    error = dropped.exception(0)
    assert isinstance(error, UalTimeoutError)
    assert "the command to drop was not sent: nothing was heard of the autopilot" in error.message
    plain.run(1.0)
    busy = plain.runner.submit(replace(ELSEWHERE, group="first"), plain.now_s)
    waiting = plain.runner.submit(DROP, plain.now_s)
    plain.run(1.6)
    error = waiting.exception(0)
    assert isinstance(error, UalTimeoutError)
    assert "was not sent: an earlier one was not answered" in error.message
    assert not busy.done()
    assert plain.sent == ["elsewhere"]


def test_requests_for_data_wait_for_each_other_without_end(plain: Plain) -> None:
    """On a bad link each of many takes its time, and the last one is as much needed."""
    request = Command("stream", "stream", key="interval", repeat=Repeat(0.5, 4))
    for number in range(5):
        plain.runner.submit(replace(request, request=f"stream {number}"), plain.now_s)
    plain.run(12.0)
    assert plain.sent[-1] == "stream 4"
    assert len(plain.sent) == 20
