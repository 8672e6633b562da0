"""Which message is newer: a mode that the safety pilot has just changed must never be passed over, at any rate."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual_daemon.backends.mavlink.autopilots.px4 import Px4
from ual_daemon.backends.mavlink.session.sequence import RunningNumber
from ual_daemon.backends.mavlink.session.telemetry import LATE_S, Telemetry
from ual_daemon.backends.mavlink.wire.messages import Message, mavlink

OFFBOARD, POSCTL = 6 << 16, 3 << 16


@given(first=st.integers(0, 255), gaps=st.lists(st.integers(1, 127), max_size=300), rate_hz=st.floats(1.0, 5000.0))
def test_what_comes_in_order_is_always_newer_whatever_is_lost_between(
    first: int, gaps: list[int], rate_hz: float
) -> None:
    number = RunningNumber(LATE_S)
    sent = first
    number.take(sent, 0.0)
    for count, gap in enumerate(gaps, 1):
        before, sent = number.value, sent + gap
        number.take(sent % 256, count / rate_hz)
        assert number.value == before + gap


@given(order=st.permutations(range(100)))
def test_what_comes_in_any_order_has_the_order_in_which_it_was_sent(order: list[int]) -> None:
    number = RunningNumber(LATE_S)
    number.take(200, 0.0)
    began = number.value
    for sent in order:
        number.take((201 + sent) % 256, 0.01)
        assert number.value == began + 1 + sent


def test_after_a_silence_any_number_is_the_next() -> None:
    number = RunningNumber(LATE_S)
    number.take(200, 0.0)
    before = number.value
    number.take(100, LATE_S + 0.01)
    assert number.value > before


def say(telemetry: Telemetry, message: Message, sequence: int, now_s: float) -> None:
    message._header.seq = sequence % 256
    telemetry.update(message, now_s, now_s)


def mode(custom_mode: int) -> Message:
    return mavlink.MAVLink_current_mode_message(0, custom_mode, custom_mode)


@pytest.mark.parametrize("rate_hz", [100, 430, 500, 700, 900, 2000])
@pytest.mark.parametrize("interval_s", [0.05, 0.13, 0.25, 0.29, 0.298, 0.5])
def test_a_mode_that_the_pilot_has_changed_counts_at_any_rate_of_messages(rate_hz: int, interval_s: float) -> None:
    telemetry = Telemetry(Px4())
    say(telemetry, mode(OFFBOARD), 0, 0.0)
    count = round(rate_hz * interval_s)
    for index in range(1, count):
        telemetry.heard(index % 256, index / rate_hz)
    say(telemetry, mode(POSCTL), count, interval_s)
    assert telemetry.mode_name == "POSCTL"


def test_a_mode_that_comes_late_is_passed_over() -> None:
    telemetry = Telemetry(Px4())
    say(telemetry, mode(OFFBOARD), 250, 0.0)
    for index in range(251, 300):
        telemetry.heard(index % 256, (index - 250) / 500.0)
    say(telemetry, mode(OFFBOARD), 300, 0.1)
    say(telemetry, mode(POSCTL), 280, 0.11)
    assert telemetry.mode_name == "OFFBOARD"


def test_another_mode_that_seems_late_is_doubtful_and_one_that_says_nothing_new_is_not() -> None:
    telemetry = Telemetry(Px4())
    say(telemetry, mode(OFFBOARD), 0, 0.0)
    say(telemetry, mode(OFFBOARD), 250, 0.1)
    assert not telemetry.is_mode_doubtful
    say(telemetry, mode(POSCTL), 130, 0.2)  # late, or so many were lost
    assert telemetry.mode_name == "OFFBOARD"
    assert telemetry.is_mode_doubtful
