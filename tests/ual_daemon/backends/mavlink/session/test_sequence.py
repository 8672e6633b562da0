"""Order of messages: a mode that the safety pilot has just changed must never be passed over, at any rate."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as mavlink

from ual_daemon.backends.mavlink.dialects.px4 import Px4
from ual_daemon.backends.mavlink.session.sequence import SequenceGaps, SequenceUnwrapper
from ual_daemon.backends.mavlink.session.telemetry import LATE_MESSAGE_S, AutopilotTelemetry
from ual_daemon.backends.mavlink.wire.messages import Message

OFFBOARD, POSCTL = 6 << 16, 3 << 16


@given(first=st.integers(0, 255), gaps=st.lists(st.integers(1, 127), max_size=300), rate_hz=st.floats(1.0, 5000.0))
def test_what_comes_in_order_is_always_newer_whatever_is_lost_between(
    first: int, gaps: list[int], rate_hz: float
) -> None:
    number = SequenceUnwrapper(LATE_MESSAGE_S)
    sent = first
    number.update(sent, 0.0)
    for count, gap in enumerate(gaps, 1):
        before, sent = number.value, sent + gap
        number.update(sent % 256, count / rate_hz)
        assert number.value == before + gap


@given(order=st.permutations(range(100)))
def test_what_comes_in_any_order_has_the_order_in_which_it_was_sent(order: list[int]) -> None:
    number = SequenceUnwrapper(LATE_MESSAGE_S)
    number.update(200, 0.0)
    began = number.value
    for sent in order:
        number.update((201 + sent) % 256, 0.01)
        assert number.value == began + 1 + sent


def test_after_a_silence_any_number_is_the_next() -> None:
    number = SequenceUnwrapper(LATE_MESSAGE_S)
    number.update(200, 0.0)
    before = number.value
    number.update(100, LATE_MESSAGE_S + 0.01)
    assert number.value > before


def say(telemetry: AutopilotTelemetry, message: Message, sequence: int, now_s: float) -> None:
    message._header.seq = sequence % 256
    telemetry.update(message, now_s, now_s)


def mode(custom_mode: int) -> Message:
    return mavlink.MAVLink_current_mode_message(0, custom_mode, custom_mode)


@pytest.mark.parametrize("rate_hz", [100, 430, 500, 700, 900, 2000])
@pytest.mark.parametrize("interval_s", [0.05, 0.13, 0.25, 0.29, 0.298, 0.5])
def test_a_mode_that_the_pilot_has_changed_counts_at_any_rate_of_messages(rate_hz: int, interval_s: float) -> None:
    telemetry = AutopilotTelemetry(Px4())
    say(telemetry, mode(OFFBOARD), 0, 0.0)
    count = round(rate_hz * interval_s)
    for index in range(1, count):
        telemetry.on_frame(index % 256, index / rate_hz)
    say(telemetry, mode(POSCTL), count, interval_s)
    assert telemetry.mode_name == "POSCTL"


def test_a_mode_that_comes_late_is_passed_over() -> None:
    telemetry = AutopilotTelemetry(Px4())
    say(telemetry, mode(OFFBOARD), 250, 0.0)
    for index in range(251, 300):
        telemetry.on_frame(index % 256, (index - 250) / 500.0)
    say(telemetry, mode(OFFBOARD), 300, 0.1)
    say(telemetry, mode(POSCTL), 280, 0.11)
    assert telemetry.mode_name == "OFFBOARD"


def test_another_mode_that_seems_late_is_doubtful_and_one_that_says_nothing_new_is_not() -> None:
    telemetry = AutopilotTelemetry(Px4())
    say(telemetry, mode(OFFBOARD), 0, 0.0)
    say(telemetry, mode(OFFBOARD), 250, 0.1)
    assert not telemetry.is_mode_doubtful
    say(telemetry, mode(POSCTL), 130, 0.2)  # late, or so many were lost
    assert telemetry.mode_name == "OFFBOARD"
    assert telemetry.is_mode_doubtful


def lost(sequences: list[int]) -> int:
    gaps = SequenceGaps()
    return sum(gaps.count_lost(sequence % 256) for sequence in sequences)


@pytest.mark.parametrize(
    ("sequences", "count"),
    [
        ([], 0),
        ([7, 8, 9], 0),
        ([254, 255, 256, 257], 0),
        ([0, 1, 4], 2),
        ([250, 260], 9),
        ([0, 0, 1, 1, 1], 0),  # doubled
        ([0, 2, 1, 3], 0),  # reordered
        ([0, 2, 1, 1, 3], 0),
        ([0, 3, 2, 2, 4], 1),
        ([0, 5, 4, 3, 2, 1], 0),
        ([0, 120], 119),
    ],
)
def test_loss_is_reported_by_gaps_in_the_numbers(sequences: list[int], count: int) -> None:
    assert lost(sequences) == count


def test_the_counted_loss_is_the_real_one_whatever_is_reordered_or_doubled() -> None:
    noise = random.Random(4)
    sent = list(range(5000))
    kept = [each for each in sent if noise.random() > 0.3 or each in (0, 4999)]
    came = sorted(
        [*kept, *(each for each in kept if noise.random() < 0.1)], key=lambda each: each + noise.random() * 20
    )
    first = came.index(0)  # what came before the first heard is nobody's loss
    count = lost([0, *came[:first], *came[first + 1 :]])
    assert count == len(sent) - len(kept)
