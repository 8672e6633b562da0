"""A jump of the computer's clock is logged, and its drift is not."""

from __future__ import annotations

import logging

import pytest

from ual_daemon.program.clock_watch import ClockWatch


def test_each_jump_is_logged_once_and_a_drift_is_not(caplog: pytest.LogCaptureFixture) -> None:
    utc_s = [0.0]
    watch = ClockWatch(lambda: utc_s[0])
    with caplog.at_level(logging.WARNING, "ual_daemon"):
        for now_s, told_s in ((10.0, 0.0), (11.0, 1.1), (12.0, 2.0), (13.0, 1.8e9), (14.0, 1.8e9 + 1.0), (15.0, 50.0)):
            utc_s[0] = told_s
            watch.compare(now_s)
    jumps = [vars(each)["ual_fields"]["by_s"] for each in caplog.records]
    assert jumps == [pytest.approx(1.8e9, abs=10.0), pytest.approx(-1.8e9, abs=60.0)]
    assert {vars(each)["ual_event"] for each in caplog.records} == {"clock_jumped"}
