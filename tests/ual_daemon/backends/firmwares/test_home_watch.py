"""A home that moves by small steps, as PX4 corrects its own: it is asked for each time, and logged now and then."""

from __future__ import annotations

import logging

import pytest

from ual_daemon.backends.firmwares.home_watch import HomeWatch


def test_a_home_that_is_corrected_step_by_step_is_logged_once_for_each_half_metre(
    caplog: pytest.LogCaptureFixture,
) -> None:
    watch, home_m, wanted_count = HomeWatch(), 500.0, 0
    with caplog.at_level(logging.INFO):
        for step in range(1, 11):
            found_m = 500.0 + 0.15 * step
            for _ in range(2):
                is_contradicted = watch.is_contradicted(home_m, found_m + 10.0, 10.0)
            assert is_contradicted
            wanted_count += watch.is_wanted
            watch.is_wanted, home_m = False, found_m
            assert not watch.is_contradicted(home_m, found_m + 10.0, 10.0)
    assert wanted_count == 10
    assert [record.message.split()[0] for record in caplog.records] == ["home_moved"] * 3


def test_a_home_that_goes_back_and_forth_is_logged_once_each_path_and_one_that_is_set_far_off_each_time(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A real PX4 1.17 moved its home by 1.2 m some 40 times in half a minute, and nothing else was seen in the log."""
    watch, home_m = HomeWatch(), 500.0
    with caplog.at_level(logging.INFO):
        for found_m in (*(501.2, 500.0) * 20, 510.0, 500.0):
            for told_m in (home_m, home_m, found_m):
                watch.is_contradicted(told_m, found_m + 10.0, 10.0)
            home_m = found_m
    assert [record.message.split()[1] for record in caplog.records] == ["up_m=1.2", "up_m=-1.2", "up_m=10", "up_m=-10"]
