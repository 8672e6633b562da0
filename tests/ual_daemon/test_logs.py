"""Events as a program sees them that has not set up the logging, or has by `logging.basicConfig`."""

from __future__ import annotations

import logging

import pytest

from ual.errors import WrongStateError
from ual_daemon import logs

_log = logging.getLogger("ual_daemon.test_logs")


def test_the_text_of_an_event_has_its_fields(caplog: pytest.LogCaptureFixture) -> None:
    logs.event(_log, logging.WARNING, "state", old="FLYING_AUTO", new="UNINITIALIZED", why="no data came", age_s=0.25)
    [record] = caplog.records
    assert record.getMessage() == 'state old=FLYING_AUTO new=UNINITIALIZED why="no data came" age_s=0.25'
    assert vars(record)["ual_event"] == "state"


def test_the_text_of_a_refusal_has_the_reason(caplog: pytest.LogCaptureFixture) -> None:
    logs.refused(_log, "land", WrongStateError("land needs the state FLYING_AUTO"))
    assert caplog.messages == ['refused command=land reason=WRONG_STATE why="land needs the state FLYING_AUTO"']


def test_a_value_cannot_resemble_another_field_or_fill_the_log(caplog: pytest.LogCaptureFixture) -> None:
    logs.event(_log, logging.INFO, "command", what="a=1\nb", long="x" * 400)
    logs.event(_log, logging.WARNING, "command", what="a=1\nb", long="x" * 400)
    [text] = caplog.messages
    assert text == f'command what="a=1\\nb" long="{"x" * 300}... (400 characters)"'


def test_an_event_that_recurs_is_logged_at_once_and_once_it_has_settled_elsewhere(
    caplog: pytest.LogCaptureFixture,
) -> None:
    moved = logs.RecurringEvent(_log, logging.WARNING, "moved")
    for step in range(100):
        moved.note(100.0 + step * 0.1, x=step % 2)
        assert moved.settle(100.0 + step * 0.1) is (step == 0)
    assert caplog.messages == ["moved x=0"]
    assert not moved.settle(119.8)
    assert moved.settle(120.0)
    assert caplog.messages == ["moved x=0", "moved x=1"]
    moved.note(121.0, x=2)
    moved.note(121.5, x=3)
    moved.note(122.0, x=2)  # where it was logged already
    assert moved.settle(140.0)
    assert caplog.messages == ["moved x=0", "moved x=1", "moved x=2"]
    moved.note(3.0, x=4)  # another boot's clock
    assert caplog.messages[-1] == "moved x=4"
