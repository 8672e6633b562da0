"""Descriptions of an autopilot's parameters, and the wait for them."""

import threading

import pytest

from tests.ual_daemon.backends.mavlink.fakes import Harness, heartbeat
from tests.waiting import LIMIT_S, until
from ual_daemon.backends.mavlink.offers import parameter_descriptions
from ual_daemon.backends.mavlink.offers.parameter_descriptions import ParameterDescriptions


def test_an_answer_leaves_no_thread_that_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each question would leave one for seconds."""
    monkeypatch.setattr(parameter_descriptions, "ANSWER_TIMEOUT_S", 2.0 * LIMIT_S)
    harness = Harness()
    harness.receive(heartbeat())
    before = set(threading.enumerate())
    descriptions = ParameterDescriptions(harness.session, lambda _: None)
    assert descriptions.get().result(0) == {}
    until(lambda: set(threading.enumerate()) <= before, "no thread is left")
