from __future__ import annotations

import pytest

from ual_daemon.backends.rosbridge.ordering import Ordering


def accepted(ordering: Ordering, *stamps_s: float) -> list[bool]:
    return [ordering.accepts("pose", each) for each in stamps_s]


def test_a_late_message_is_dropped_and_the_next_one_in_time_accepted() -> None:
    ordering = Ordering()
    assert accepted(ordering, 100.0, 100.04, 100.02, 100.06, 100.05, 100.08) == [True, True, False, True, False, True]


def test_late_messages_that_come_between_newer_ones_are_no_new_clock() -> None:
    ordering = Ordering()
    accepted(ordering, 100.0)
    for step in range(1, 50):
        assert accepted(ordering, 100.0 + 0.04 * step, 99.0 + 0.04 * step) == [True, False]


def test_late_messages_in_any_order_are_no_new_clock() -> None:
    ordering = Ordering()
    assert accepted(ordering, 100.0, 99.0, 98.9, 98.8, 98.7, 98.6, 98.5) == [True] + [False] * 6


@pytest.mark.parametrize("back_s", [0.5, 3.0, 9.0, 11.0])
def test_a_clock_that_is_set_back_is_followed_after_a_few_messages(back_s: float) -> None:
    ordering = Ordering()
    accepted(ordering, 100.0, 100.02)
    after = [100.04 - back_s + 0.02 * step for step in range(8)]
    assert all(accepted(ordering, *after)[3:])


@pytest.mark.parametrize("back_s", [3.0, 11.0])
def test_a_message_after_a_clock_was_set_back_does_not_count_as_late(back_s: float) -> None:
    ordering = Ordering()
    for step in range(200):
        ordering.accepts("pose", 100.0 + 0.02 * step)
        ordering.sent_s(100.0 + 0.02 * step, 0.02 * step)
    for step in range(200, 210):
        stamp_s, now_s = 100.0 + 0.02 * step - back_s, 0.02 * step
        if ordering.accepts("pose", stamp_s):
            assert ordering.sent_s(stamp_s, now_s) == pytest.approx(now_s)


def test_a_state_that_waited_in_a_stall_is_known_to_be_old() -> None:
    ordering = Ordering()
    for step in range(100):
        assert ordering.state_time_s(100.0 + 0.1 * step, 0.1 * step + 0.02) == pytest.approx(0.1 * step + 0.02)
    for step in range(100, 108):
        assert ordering.state_time_s(100.0 + 0.1 * step, 10.8) == pytest.approx(0.1 * step + 0.02)


@pytest.mark.parametrize("rate_hz", [10.0, 5.0, 1.0])
def test_the_states_of_a_simulation_that_runs_too_slowly_are_not_old(rate_hz: float) -> None:
    ordering = Ordering()
    ages_s = [at - ordering.state_time_s(100.0 + 0.9 * at, at) for at in (step / rate_hz for step in range(100))]
    assert max(ages_s) < 0.3 * 0.7
