"""Corrections that wait to be sent, those of them that are dropped, and the turn of the sender."""

from __future__ import annotations

import logging

import pytest

from tests.rtcm import message
from ual.errors import ResourceExhaustedError
from ual_daemon.backends.offers.corrections import HOLDER_SILENCE_S, Injected, SenderTurn, WaitingCorrections

FIRST, SECOND, THIRD = message(100, 1), message(100, 2), message(100, 3)


def test_the_oldest_whole_messages_are_dropped_counted_and_reported(caplog: pytest.LogCaptureFixture) -> None:
    waiting = WaitingCorrections(720, most_bytes=250)
    with caplog.at_level(logging.WARNING):
        for each in (FIRST, SECOND, THIRD):
            waiting.add(each)
    assert (waiting.counts.dropped_count, waiting.bytes_count) == (1, 200)
    assert "corrections_dropped" in caplog.text
    assert [waiting.take(), waiting.take(), waiting.take()] == [SECOND, THIRD, None]
    waiting.on_left(SECOND, 3.5)
    assert waiting.counts == Injected(messages_count=1, bytes_count=100, dropped_count=1, left_s=3.5)


def test_a_message_that_is_too_long_is_dropped_and_reported(caplog: pytest.LogCaptureFixture) -> None:
    waiting = WaitingCorrections(720)
    with caplog.at_level(logging.WARNING):
        waiting.add(message(721))
        waiting.add(message(720))
    assert waiting.counts.too_long_count == 1
    assert waiting.take() == message(720)
    assert "corrections_too_long" in caplog.text


def test_what_goes_on_for_hours_is_reported_some_times(caplog: pytest.LogCaptureFixture) -> None:
    waiting = WaitingCorrections(720, most_bytes=100)
    with caplog.at_level(logging.WARNING):
        for _ in range(10_000):
            waiting.add(FIRST)
    assert waiting.counts.dropped_count == 9_999
    assert caplog.text.count("corrections_dropped") == 14


def test_all_are_dropped_where_the_link_is_lost() -> None:
    waiting = WaitingCorrections(720)
    waiting.add(FIRST)
    waiting.add(SECOND)
    waiting.drop("the link is lost")
    waiting.drop("the link is lost")
    assert (waiting.counts.dropped_count, waiting.take(), waiting.bytes_count) == (2, None, 0)


def test_one_sends_at_a_time_and_another_one_hears_its_name() -> None:
    turn = SenderTurn(lambda: now_s[0])
    now_s, first, second = [100.0], object(), object()
    turn.keep(first, "the caster")
    assert turn.name == "the caster"
    now_s[0] += HOLDER_SILENCE_S - 0.1
    with pytest.raises(ResourceExhaustedError, match="the caster sends them already") as refused:
        turn.keep(second, "a serial base")
    assert refused.value.metadata == {"limit": "1", "held_by": "the caster"}
    turn.leave(second)
    assert turn.name == "the caster"
    turn.leave(first)
    assert turn.name == ""
    turn.keep(second, "a serial base")


def test_a_sender_that_is_silent_loses_its_turn_to_another_one_that_asks() -> None:
    turn = SenderTurn(lambda: now_s[0])
    now_s, first, second = [100.0], object(), object()
    turn.keep(first, "the caster")
    now_s[0] += HOLDER_SILENCE_S + 0.1
    assert turn.name == ""
    turn.keep(first, "the caster")  # it was silent, and no other one has asked
    now_s[0] += HOLDER_SILENCE_S + 0.1
    turn.keep(second, "a serial base")
    with pytest.raises(ResourceExhaustedError, match="a serial base"):
        turn.keep(first, "the caster")
