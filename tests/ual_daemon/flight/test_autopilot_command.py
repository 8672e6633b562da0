"""Commands to the autopilot, judged by their effect."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from contextlib import nullcontext
from typing import Any

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot, sent
from ual.errors import LinkLostError, RejectedByAutopilotError, UalTimeoutError
from ual_daemon import traces
from ual_daemon.backends.values import Snapshot
from ual_daemon.flight.autopilot_command import COMMAND_PATIENCE_S, AutopilotCommand


def later(autopilot: Autopilot, seconds: float) -> Snapshot:
    return autopilot.snapshot().at(autopilot.time_s + seconds)


def test_a_command_has_time_to_show_its_effect(autopilot: Autopilot, ack: Future[None]) -> None:
    command = sent(ack, autopilot)
    assert command.failure(autopilot.snapshot()) is None
    assert command.failure(later(autopilot, COMMAND_PATIENCE_S)) is None
    assert isinstance(command.failure(later(autopilot, COMMAND_PATIENCE_S + 0.1)), UalTimeoutError)


def test_the_time_in_which_it_was_not_sent_yet_is_not_the_autopilots(autopilot: Autopilot, ack: Future[None]) -> None:
    """The caller planned it, and then waited for the processor of a busy computer."""
    command = AutopilotCommand("do it")
    assert command.failure(later(autopilot, 60.0)) is None
    command.send(lambda: ack)
    assert command.failure(later(autopilot, 60.0)) is None
    assert command.failure(later(autopilot, 60.0 + COMMAND_PATIENCE_S)) is None
    assert isinstance(command.failure(later(autopilot, 60.1 + COMMAND_PATIENCE_S)), UalTimeoutError)


def test_an_accepted_command_without_effect_is_a_refusal_with_the_status_text(
    autopilot: Autopilot, ack: Future[None]
) -> None:
    command = sent(ack, autopilot)
    assert command.failure(autopilot.snapshot()) is None
    ack.set_result(None)
    autopilot.status_text = "Preflight Fail: heading"
    failure = command.failure(later(autopilot, COMMAND_PATIENCE_S + 0.1))
    assert isinstance(failure, RejectedByAutopilotError)
    assert "accepted to do it, but has not after 5 s" in failure.message
    assert "Preflight Fail: heading" in failure.message


@pytest.mark.parametrize("is_judged", [False, True])
def test_a_text_from_before_a_command_is_no_reason_of_its_failure(
    autopilot: Autopilot, ack: Future[None], is_judged: bool
) -> None:
    autopilot.status_text = "PreArm: Compass not calibrated"  # an hour ago
    command = AutopilotCommand("land")
    command.send(lambda: ack, autopilot.snapshot() if is_judged else None)
    assert command.failure(autopilot.snapshot()) is None
    failure = command.failure(later(autopilot, COMMAND_PATIENCE_S + 0.1))
    assert isinstance(failure, UalTimeoutError)
    assert failure.message == "the autopilot did not answer the command to land"
    autopilot.status_text = "Mode change failed"
    late = command.failure(later(autopilot, COMMAND_PATIENCE_S + 0.1))
    assert late is not None
    assert late.message.endswith("; it says: Mode change failed")


def test_a_refusal_is_known_at_once(autopilot: Autopilot, ack: Future[None]) -> None:
    command = sent(ack, autopilot)
    ack.set_exception(RejectedByAutopilotError("no"))
    assert str(command.failure(autopilot.snapshot())) == "no"
    assert not command.is_accepted


def test_an_error_of_the_backend_is_a_refusal(autopilot: Autopilot) -> None:
    def refuse() -> Future[None]:
        raise LinkLostError("the port is gone")

    command = AutopilotCommand("do it")
    command.send(refuse)
    assert isinstance(command.failure(autopilot.snapshot()), LinkLostError)


class Spans:
    """A tracer that notes how each part ends."""

    def __init__(self) -> None:
        self.ended: list[tuple[str, str]] = []

    def current(self) -> object:
        return self

    def begin(self, name: str, above: object, attributes: object) -> Callable[[Future[Any]], None]:
        assert above is self
        return lambda future: self.ended.append((name, str(future.exception(0))))


@pytest.mark.parametrize("error", [LinkLostError("the port is gone"), OSError("the port is gone")])
def test_its_trace_ends_whatever_the_backend_raises(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail() -> Future[None]:
        raise error

    spans = Spans()
    monkeypatch.setattr(traces, "tracer", spans)
    command = AutopilotCommand("land")
    with nullcontext() if isinstance(error, LinkLostError) else pytest.raises(OSError, match="the port is gone"):
        command.send(fail)
    assert spans.ended == [("autopilot: land", "the port is gone")]


def test_a_command_that_is_withdrawn_before_it_is_sent_is_not_sent() -> None:
    command = AutopilotCommand("arm")
    command.withdraw()
    command.send(lambda: pytest.fail("it was sent"))
    assert not command.is_answered
    failure = command.failure(Snapshot(0.0))
    assert failure is not None, "a manoeuvre would wait for its effect without an end"
    assert "withdrawn before it was sent" in str(failure)


def test_a_command_that_was_withdrawn_is_no_silence_of_the_autopilot(autopilot: Autopilot, ack: Future[None]) -> None:
    """The mode changed after it was given, and what took the UAV is not known yet."""
    command = sent(ack, autopilot)
    assert command.failure(autopilot.snapshot()) is None
    command.withdraw()
    failure = command.failure(later(autopilot, COMMAND_PATIENCE_S + 0.1))
    assert failure is not None
    assert "the command to do it was withdrawn, as the mode changed meanwhile" in failure.message


def test_a_command_that_is_withdrawn_while_it_is_sent_is_cancelled(ack: Future[None]) -> None:
    command = AutopilotCommand("arm")

    def send() -> Future[None]:
        command.withdraw()  # by another thread, before there is a future
        return ack

    command.send(send)
    assert ack.cancelled()
