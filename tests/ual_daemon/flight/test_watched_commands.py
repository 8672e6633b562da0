"""Commands that are watched until their effect shows."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from tests.ual_daemon.flight.hand_made import Autopilot, sent
from ual.errors import LinkLostError, RejectedByAutopilotError, TaskAbortedError, WrongStateError
from ual_daemon.backends.values import Freshness, Snapshot
from ual_daemon.flight.state import estimate
from ual_daemon.flight.watched_commands import WatchedCommands


def is_disarmed(snapshot: Snapshot) -> bool:
    return snapshot.control.armed is not None and not snapshot.control.armed.value


def step(watched: WatchedCommands, autopilot: Autopilot) -> None:
    snapshot = autopilot.snapshot()
    watched.step(snapshot, estimate(snapshot, Freshness()))


def test_a_command_ends_with_the_link(autopilot: Autopilot, ack: Future[None]) -> None:
    watched = WatchedCommands()
    future = watched.add(sent(ack, autopilot), is_disarmed)
    autopilot.silent_s = 2.0
    step(watched, autopilot)
    with pytest.raises(LinkLostError):
        future.result(timeout=0)
    assert ack.cancelled()  # it is not sent again once the link is back
    assert watched.is_empty


def test_a_command_ends_when_its_effect_shows(autopilot: Autopilot, ack: Future[None]) -> None:
    watched = WatchedCommands()
    future = watched.add(sent(ack, autopilot), is_disarmed)
    step(watched, autopilot)
    assert not future.done()
    autopilot.armed = False
    step(watched, autopilot)
    assert future.result(timeout=0) is None
    assert ack.cancelled()  # it is not sent again
    assert watched.is_empty


def test_a_command_that_is_refused_ends_with_the_refusal(autopilot: Autopilot, ack: Future[None]) -> None:
    watched = WatchedCommands()
    future = watched.add(sent(ack, autopilot), is_disarmed)
    ack.set_exception(RejectedByAutopilotError("no"))
    step(watched, autopilot)
    with pytest.raises(RejectedByAutopilotError):
        future.result(timeout=0)
    assert watched.is_empty


def test_new_commands_are_refused_while_those_before_go_on(autopilot: Autopilot, ack: Future[None]) -> None:
    watched = WatchedCommands()
    future = watched.add(sent(ack, autopilot), is_disarmed)
    watched.refuse_new()
    with pytest.raises(WrongStateError, match="shutting down"):
        watched.add(sent(Future(), autopilot), is_disarmed)
    assert not future.done()
    autopilot.armed = False
    step(watched, autopilot)
    assert future.result(timeout=0) is None


def test_at_the_end_all_commands_end_and_new_ones_are_refused(autopilot: Autopilot, ack: Future[None]) -> None:
    watched = WatchedCommands()
    future = watched.add(sent(ack, autopilot), is_disarmed)
    watched.end_all(TaskAbortedError("closed"))
    with pytest.raises(TaskAbortedError):
        future.result(timeout=0)
    with pytest.raises(WrongStateError):
        watched.add(sent(Future(), autopilot), is_disarmed)
