"""The guard of worker threads: one entry fails, the others do not, and a thread that ends is known."""

from __future__ import annotations

import threading

import pytest

from ual.shared import guard
from ual.shared.guard import WorkGuard


def fail() -> None:
    raise OverflowError("date value out of range " + "x" * 1000)


def test_what_fails_is_counted_each_time_and_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    it = WorkGuard("a test")
    before = guard.figures().failed["a test"]
    assert it.contain(lambda: None)
    assert not it.contain(fail)
    assert it.run(fail, str.upper) is not None
    assert it.last_cause.startswith("OverflowError: date value")
    assert len(it.last_cause) < 250
    assert guard.figures().failed["a test"] == before + 2
    assert [each.levelname for each in caplog.records] == ["ERROR"]
    assert "a test: an entry could not be processed" in caplog.text


def test_exceptions_that_are_the_callers_pass() -> None:
    with pytest.raises(OverflowError):
        WorkGuard("a test").contain(fail, passes=OverflowError)


def test_a_thread_that_ends_nevertheless_is_known(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(threading, "excepthook", guard.on_ended_thread)
    monkeypatch.setattr(guard._process, "_ended", ())
    thread = threading.Thread(target=fail, name="a worker")
    thread.start()
    thread.join()
    assert guard.ended_threads() == guard.figures().ended_threads == ("a worker",)
    [record] = caplog.records
    assert (record.levelname, record.exc_info is not None) == ("ERROR", True)
    assert "the thread 'a worker' has ended" in record.getMessage()
