"""Commands that cannot be made or encoded: their future ends, and the link does not."""

from __future__ import annotations

import pytest

from tests.ual_daemon.backends.engine.scripted import Scripted, mode_command
from tests.ual_daemon.backends.engine.test_command_runner import Plain
from ual.errors import UalError
from ual_daemon.backends.engine.command import Command


def test_a_command_that_cannot_be_made_ends_its_future_with_the_defect(caplog: pytest.LogCaptureFixture) -> None:
    def make() -> Command[str]:
        raise KeyError("no such parameter")

    scripted = Scripted()
    scripted.wait(1.0)
    result = scripted.desk.give("land", make)
    held = scripted.ask("hold")
    scripted.wait(0.1)
    error = result.exception(0)
    assert type(error) is UalError
    assert error.message == "cannot land: a defect of UAL: KeyError('no such parameter')"
    assert held.sent_s  # what was asked for after it leaves in the same tick
    assert sum(record.exc_info is not None for record in caplog.records) == 1


def test_a_command_that_cannot_be_encoded_ends_its_future_and_is_tried_no_more(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def transmit(request: str, sent_before_count: int, key: object) -> None:
        del sent_before_count, key
        tries.append(request)
        raise OverflowError("float too large to pack")

    tries: list[str] = []
    plain = Plain(transmit=transmit)
    result = plain.runner.submit(mode_command("hold"), plain.now_s)
    plain.run(1.0)
    error = result.exception(0)
    assert type(error) is UalError
    assert "a defect of UAL: OverflowError('float too large to pack')" in error.message
    assert tries == ["mode hold"]
    assert not plain.runner.is_any_pending
    assert sum(record.exc_info is not None for record in caplog.records) == 1
