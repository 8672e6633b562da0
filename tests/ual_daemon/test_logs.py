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
