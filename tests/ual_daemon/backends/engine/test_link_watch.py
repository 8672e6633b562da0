"""Silence, what may be believed after it, and reboots."""

from __future__ import annotations

import logging
from typing import Any

import pytest

from ual_daemon.backends.engine.limits import BLIND_SILENCE_S, RESTART_SILENCE_S
from ual_daemon.backends.engine.link_watch import STALE_LINK_S, LinkWatch, LinkWatchState
from ual_daemon.backends.values import LinkReport


class ReportedSample:
    def __init__(self) -> None:
        self.events: list[str] = []
        self.watch = LinkWatch(
            "udp", 1.0, on_lost=lambda: self.events.append("lost"), on_anew=lambda: self.events.append("anew")
        )


@pytest.fixture
def reported() -> ReportedSample:
    return ReportedSample()


def state(watch: LinkWatch) -> LinkWatchState:
    return watch.state


def test_the_link_goes_from_connecting_to_connected_to_stale_to_lost_and_back(reported: ReportedSample) -> None:
    watch = reported.watch
    watch.tick(100.0)
    assert state(watch) is LinkWatchState.CONNECTING
    assert not watch.is_up(100.0)
    watch.on_message(100.0)
    watch.tick(100.0 + STALE_LINK_S - 0.05)
    assert state(watch) is LinkWatchState.CONNECTED
    watch.tick(100.0 + STALE_LINK_S + 0.05)
    assert state(watch) is LinkWatchState.STALE
    assert watch.is_up(101.0)
    watch.tick(101.05)
    assert state(watch) is LinkWatchState.LOST
    assert not watch.is_up(101.05)
    assert watch.on_message(110.0) == 10.0
    assert state(watch) is LinkWatchState.CONNECTED
    assert watch.lost_count == 1
    assert watch.report() == LinkReport(lost_count=1, reboots_count=0)


def test_each_change_is_logged_once(reported: ReportedSample, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        reported.watch.on_message(1.9)
        for tick in range(20, 100):
            reported.watch.tick(tick / 10)
        reported.watch.on_message(10.0)
    records: list[Any] = caplog.records
    assert [record.ual_fields["new"] for record in records] == ["connected", "lost", "connected"]
    assert records[2].ual_fields["silence_s"] == 8.1


def test_a_silence_discards_and_a_longer_one_has_everything_requested_anew(reported: ReportedSample) -> None:
    now_s = 0.0
    for silence_s in (0.0, BLIND_SILENCE_S, 0.9, 1.1, RESTART_SILENCE_S + 0.1):
        now_s += silence_s
        reported.watch.on_message(now_s)
    assert reported.events == ["lost", "lost", "anew"]


def test_what_was_reported_before_a_silence_or_a_time_of_not_looking_is_not_relied_on(reported: ReportedSample) -> None:
    watch = reported.watch
    assert watch.why_silent(0.0) == "nothing was heard of the autopilot yet"
    watch.on_message(0.0)
    watch.on_message(BLIND_SILENCE_S)
    assert watch.spoken_s == 0.0
    assert watch.why_silent(BLIND_SILENCE_S) == ""
    assert watch.why_silent(0.8) == "nothing was heard of the autopilot for 0.6 s"
    watch.on_message(0.8)
    assert watch.spoken_s == 0.8
    watch.on_blind(1.0)
    watch.on_message(0.9)
    assert "is being read" in watch.why_silent(0.9)
    assert watch.why_silent(1.0) == ""
    watch.on_blind(0.5)
    assert watch.spoken_s == 1.0


def test_a_boot_time_that_runs_back_is_a_reboot_and_nothing_is_commanded_while_that_is_doubtful(
    reported: ReportedSample,
) -> None:
    watch = reported.watch
    times = [(100.0, 0.0), (100.5, 0.5), (100.2, 0.6), (101.0, 1.0), (3.0, 1.4), (3.1, 1.5), (3.2, 1.6), (3.3, 1.7)]
    rebooted, doubts = [], []
    for boot_s, now_s in times:
        watch.on_message(now_s)
        rebooted.append(watch.on_boot_time(boot_s, now_s))
        doubts.append("may have rebooted" in watch.why_silent(now_s + 0.2))
    assert rebooted == [False] * 6 + [True, False]
    assert doubts == [False] * 4 + [True] * 2 + [False] * 2
    assert watch.reboots_count == 1
    assert watch.boot_s == 3.3
    assert (watch.begin_boot(), watch.begin_boot()) == (1, 2)
