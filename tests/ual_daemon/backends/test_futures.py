"""Waiting for the end of a command: whose words reach the caller."""

from __future__ import annotations

import gc
import weakref
from concurrent.futures import Future

import pytest

from ual.errors import LinkLostError, UalError, UalTimeoutError
from ual_daemon.backends import futures


def test_what_does_not_end_in_time_is_withdrawn_and_reported() -> None:
    future: Future[None] = Future()
    with pytest.raises(UalTimeoutError, match=r"^it is late"):
        futures.wait(future, 0.0, "it is late")
    assert future.cancelled()


def test_a_time_out_with_which_it_ends_keeps_its_own_words() -> None:
    with pytest.raises(UalTimeoutError, match=r"^3 of 3 tries"):
        futures.wait(futures.failed(UalTimeoutError("3 of 3 tries were not answered")), 5.0, "it is late")


def test_what_the_backend_cancels_is_an_error_at_once() -> None:
    future: Future[None] = Future()
    future.cancel()
    with pytest.raises(UalError, match="was withdrawn"):
        futures.wait(future, 5.0, "it is late")


def test_a_result_is_returned() -> None:
    future: Future[int] = Future()
    future.set_result(7)
    assert futures.wait(future, 0.0, "it is late") == 7


def test_what_nobody_waits_for_any_more_is_not_kept_until_the_uav_is_closed() -> None:
    """Commands that others have replaced stay open."""
    given = futures.OpenFutures()
    kept: Future[None] = given.give("land", lambda _: None)
    replaced: Future[None] = given.give("hold", lambda _: None)
    forgotten = weakref.ref(replaced)
    del replaced
    gc.collect()
    assert forgotten() is None
    given.close()
    with pytest.raises(LinkLostError, match="cannot land: this UAV was closed"):
        kept.result(0.0)
