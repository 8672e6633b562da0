"""Futures that are waited for together."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from ual.errors import LinkLostError, UalTimeoutError
from ual_daemon.backends.chain import done, then_wait, together


def test_all_results_come_in_their_order_once_the_last_is_there() -> None:
    first: Future[int] = Future()
    last: Future[int] = Future()
    found = together([first, done(2), last])
    last.set_result(3)
    assert not found.done()
    first.set_result(1)
    assert found.result(0) == (1, 2, 3)
    assert together([]).result(0) == ()


def test_an_error_comes_once_the_last_has_ended() -> None:
    first: Future[int] = Future()
    last: Future[int] = Future()
    found = together([first, last])
    last.set_exception(UalTimeoutError("late"))
    assert not found.done()
    first.set_exception(LinkLostError("gone"))
    with pytest.raises(LinkLostError):
        found.result(0)


def test_cancelling_goes_both_directions() -> None:
    first: Future[int] = Future()
    last: Future[int] = Future()
    together([first, last]).cancel()
    assert (first.cancelled(), last.cancelled()) == (True, True)
    withdrawn: Future[int] = Future()
    found = together([withdrawn, done(1)])
    withdrawn.cancel()
    assert found.cancelled()


def test_what_a_step_has_begun_while_its_result_was_cancelled_is_cancelled() -> None:
    """The caller gives up on one thread, while another one begins the next command."""
    first: Future[int] = Future()
    last: Future[int] = Future()

    def step(_: int) -> Future[int]:
        result.cancel()
        return last

    result = then_wait(first, step)
    first.set_result(1)
    assert last.cancelled()
