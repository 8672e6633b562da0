"""A judge that never fails is none: a clean flight passes, and each breach that is put into it is found."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import pytest

from tests.campaign.evidence import Case
from tests.campaign.judge import IN_AIR, LANDING, ON_GROUND, judge
from tests.campaign.modes import ARDUPILOT, PX4
from tests.campaign.plan import plan
from tests.campaign.record import (
    DAEMON_KILLED,
    DAEMON_STARTED,
    Called,
    Life,
    Located,
    Order,
    Record,
    ReportedSample,
    Sent,
    StatusText,
    Trouble,
)
from tests.campaign.words import cause_in

GUIDED, LOITER, LAND = ARDUPILOT.references, 5, 9
TAKEN_S, GIVEN_BACK_S = 14.0, 20.0


def is_armed(time_s: float) -> bool:
    return 2.0 <= time_s < 32.0


def mode(time_s: float) -> int:
    if TAKEN_S <= time_s < GIVEN_BACK_S:
        return LOITER
    return LAND if time_s >= 25.0 else GUIDED


def landed(time_s: float) -> int:
    if time_s < 4.0 or time_s >= 31.0:
        return ON_GROUND
    return LANDING if time_s >= 25.2 else IN_AIR


def state(time_s: float) -> str:
    if not is_armed(time_s):
        return "LANDED_DISARMED"
    if landed(time_s) == ON_GROUND:
        return "LANDED_ARMED"
    if time_s < 8.0:
        return "TAKING_OFF"
    if mode(time_s) == LAND:
        return "LANDING"
    return "FLYING_AUTO" if mode(time_s) == GUIDED else "FLYING_MANUAL"


def current_position(time_s: float) -> tuple[float, float, float]:
    east = min(max(time_s - 9.0, 0.0), 4.0)
    up = max(0.0, min(time_s - 4.0, 3.0, 31.0 - time_s))
    return (east, 0.0, up)


def times(since_s: float, until_s: float, period_s: float) -> Sequence[float]:
    return [since_s + number * period_s for number in range(int((until_s - since_s) / period_s))]


def clean(autopilot: str = "ardupilot") -> Record:
    """Armed by the pilot, take-off, go-to, the pilot takes over, recovered, landed."""
    record = Record(autopilot, fence_m=(12.0, 15.0), anchor=(0.0, 0.0, 0.0), anchor_error_m=0.1)
    record.lives.append(Life(-10.0, DAEMON_STARTED))
    record.orders.append(Order(1.9, "arm"))
    record.orders.append(Order(TAKEN_S - 0.1, "pilot"))
    record.told += [
        ReportedSample(time_s, is_armed(time_s), mode(time_s), landed(time_s)) for time_s in times(0.0, 35.0, 0.05)
    ]
    record.said += [StatusText(time_s + 0.1, state(time_s)) for time_s in times(0.0, 34.0, 0.05)]
    record.sent += [
        Sent(3.1, "mode", GUIDED),
        Sent(3.2, "take_off"),
        Sent(20.0, "mode", GUIDED),
        Sent(25.0, "mode", LAND),
    ]
    record.sent += [
        Sent(time_s, "setpoint") for time_s in (*times(7.5, TAKEN_S + 0.02, 0.02), *times(20.1, 25.0, 0.02))
    ]
    record.sent.sort(key=lambda each: each.time_s)
    record.called += [
        Called("take_off", 3.0, 8.0),
        Called("go_to", 9.0, 13.5, goal=(4.0, 0.0, 3.0)),
        Called("go_to", 13.6, TAKEN_S + 0.05, "TASK_ABORTED", "safety pilot", (8.0, 0.0, 3.0)),
        Called("go_to", 16.0, 16.0, "WRONG_STATE", goal=(8.0, 0.0, 3.0)),
        Called("recover", 19.9, 20.3),
        Called("land", 24.9, 31.2),
    ]
    record.truth += [Located(time_s, current_position(time_s)) for time_s in times(0.0, 35.0, 0.05)]
    record.estimate += [Located(time_s, current_position(time_s)) for time_s in times(0.0, 35.0, 0.05)]
    return record


def rules(record: Record) -> set[str]:
    return {breach.rule for breach in judge(record)}


def test_a_clean_flight_passes() -> None:
    assert judge(clean()) == []


def test_a_record_can_be_assessed_again_from_its_file() -> None:
    record = clean()
    record.troubles.append(Trouble("pilot", 1.0, math.inf))
    assert Record.from_json(record.to_json()) == record


def test_a_take_over_is_what_neither_daemon_nor_client_requested() -> None:
    assert Case(clean()).taken_s == [pytest.approx(TAKEN_S)]


@pytest.mark.parametrize("at_s", [TAKEN_S + 0.2, 16.5, 19.8])
def test_a_setpoint_after_the_take_over_is_found(at_s: float) -> None:
    """A client's call that was refused (16.0) allows nothing."""
    record = clean()
    record.sent.append(Sent(at_s, "setpoint"))
    assert "take-over" in rules(record)


def test_a_mode_after_the_take_over_is_found() -> None:
    record = clean()
    record.sent.append(Sent(15.0, "mode", GUIDED))
    assert rules(record) == {"unasked"}


def test_setpoints_where_the_pilot_gave_the_mode_back_are_unasked_until_a_command() -> None:
    record = clean()
    record.called = [call for call in record.called if call.name != "recover"]
    assert "unasked" in rules(record)


@pytest.mark.parametrize(
    "sent",
    [Sent(1.0, "arm"), Sent(1.0, "mode", GUIDED), Sent(2.5, "setpoint"), Sent(34.0, "setpoint"), Sent(1, "param_set")],
)
def test_what_nobody_requested_is_found(sent: Sent) -> None:
    record = clean()
    record.sent.append(sent)
    assert rules(record) == {"unasked"}


def test_a_daemon_that_was_started_in_flight_sends_nothing_until_its_first_command() -> None:
    record = clean()
    record.lives += [Life(10.0, DAEMON_KILLED), Life(11.0, DAEMON_STARTED)]
    assert rules(record) == {"unasked"}


def test_a_state_that_stays_what_it_was_is_found() -> None:
    """FLYING_AUTO is told for 0.7 s after the take-over."""
    record = clean()
    record.said = [
        dataclasses.replace(said, state="FLYING_AUTO") if TAKEN_S <= said.time_s < TAKEN_S + 0.7 else said
        for said in record.said
    ]
    assert rules(record) == {"state"}


def test_a_state_that_comes_within_half_a_second_is_true() -> None:
    record = clean()
    record.said = [StatusText(said.time_s + 0.3, said.state) for said in record.said]
    assert rules(record) == set()


@pytest.mark.parametrize("wrong", ["LANDED_ARMED", "LANDED_DISARMED", "FLYING_MANUAL", "LANDING", "UNINITIALIZED"])
def test_a_state_that_is_not_true_is_found(wrong: str) -> None:
    record = clean()
    record.said.append(StatusText(11.0, wrong))
    assert rules(record) == {"state"}


def test_a_take_off_whose_client_does_not_wait_any_longer_goes_on() -> None:
    """PX4's seed 4900003: it took longer than the client's 20 s."""
    record = clean()
    record.called[0] = dataclasses.replace(record.called[0], ended_s=6.0)
    assert rules(record) == {"state"}
    record.called[0] = dataclasses.replace(record.called[0], outcome="TIMEOUT")
    assert rules(record) == set()


def test_a_state_is_not_known_while_the_autopilot_is_silent() -> None:
    record = clean()
    record.told = [told for told in record.told if not 9.0 < told.time_s < 13.0]
    assert rules(record) == {"state"}
    record.said = [
        dataclasses.replace(said, state="UNINITIALIZED") if 10.0 < said.time_s < 13.2 else said for said in record.said
    ]
    record.troubles.append(Trouble("silence", 9.0, 13.0))
    assert rules(record) == set()


def test_a_daemon_that_was_stopped_may_send_and_tell_what_it_had_until_it_runs_again() -> None:
    record = clean()
    record.sent.append(Sent(16.1, "setpoint"))
    record.said = [
        dataclasses.replace(said, state="FLYING_AUTO") if TAKEN_S <= said.time_s < 16.2 else said
        for said in record.said
    ]
    assert rules(record) == {"take-over", "unasked", "state"}
    record.troubles.append(Trouble("freeze", 13.9, 16.0))
    assert rules(record) == set()


def test_without_a_position_the_state_is_not_known() -> None:
    record = clean()
    record.said = [
        dataclasses.replace(said, state="UNINITIALIZED") if 10.0 < said.time_s < 12.0 else said for said in record.said
    ]
    assert rules(record) == {"state"}
    record.told += [ReportedSample(9.9, is_placed=False), ReportedSample(11.9, is_placed=True)]
    record.told.sort(key=lambda each: each.time_s)
    assert rules(record) == set()


def test_a_starvation_that_lasts_is_one() -> None:
    record = clean()
    record.sent.append(Sent(15.1, "setpoint"))
    record.troubles += [Trouble("busy", since_s, since_s + 0.2) for since_s in (13.9, 14.1, 14.3, 14.5, 14.7, 14.9)]
    assert rules(record) == set()
    del record.troubles[2:5]
    assert rules(record) == {"take-over", "unasked"}


def test_a_goal_that_was_not_reached_is_found_by_the_truth() -> None:
    record = clean()
    record.truth = [Located(each.time_s, (each.place[0] * 0.5, 0.0, each.place[2])) for each in record.truth]
    record.estimate = list(record.truth)
    assert rules(record) == {"goal"}


def test_a_goal_counts_from_where_home_was_set_and_one_on_earth_does_not() -> None:
    record = clean()
    record.anchor = (10.0, 0.0, 0.0)
    assert rules(record) == {"goal"}
    record.called = [dataclasses.replace(call, is_on_earth=True) for call in record.called]
    assert rules(record) == set()


def test_what_the_autopilot_itself_did_not_know_is_no_breach() -> None:
    record = clean()
    record.truth = [Located(each.time_s, (each.place[0] - 1.5, *each.place[1:])) for each in record.truth]
    assert rules(record) == set()


def test_a_landing_that_is_done_in_the_air_is_found() -> None:
    record = clean()
    record.called[-1] = dataclasses.replace(record.called[-1], ended_s=28.0)
    assert "goal" in rules(record)


def test_a_flight_beyond_the_fence_is_found_while_setpoints_fly_it() -> None:
    record = clean()
    record.fence_m = (2.0, 15.0)
    assert rules(record) == {"fence"}
    record.sent = [sent for sent in record.sent if sent.what != "setpoint"]
    assert rules(record) == set()


def test_px4_goes_through_modes_of_its_own_after_its_take_off() -> None:
    record = Record("px4")
    take_off = next(iter(PX4.takes_off))
    record.told += [
        ReportedSample(0.0, True, PX4.hold, ON_GROUND),
        ReportedSample(1.0, mode=take_off),
        ReportedSample(6.0, mode=PX4.hold),
    ]
    record.told += [ReportedSample(6.2, mode=PX4.references), ReportedSample(9.0, mode=PX4.hold)]
    record.called.append(Called("take_off", 0.5, 6.5))
    assert Case(record).taken_s == [9.0]


def test_a_failsafe_that_goes_on_while_it_is_recovered_takes_nothing_again() -> None:
    """Seed 300006 on PX4: its RTL followed its hold 0.1 s after `recover` with force had begun."""
    record = Record("px4")
    record.told += [
        ReportedSample(0.0, True, PX4.references, IN_AIR),
        ReportedSample(5.0, mode=PX4.hold),
        ReportedSample(10.1, mode=PX4.returns),
    ]
    record.told += [ReportedSample(10.6, mode=PX4.references)]
    record.called += [Called("go_to", 0.5, 5.1, "TASK_ABORTED", "failsafe"), Called("recover", 10.0, 11.0)]
    record.sent += [Sent(10.02, "setpoint"), Sent(10.3, "setpoint"), Sent(10.5, "mode", PX4.references)]
    assert Case(record).taken_s == [5.0]
    assert rules(record) == set()


def test_a_task_that_goes_on_after_the_take_over_is_found() -> None:
    record = clean()
    record.called[2] = dataclasses.replace(record.called[2], ended_s=TAKEN_S + 1.2)
    assert rules(record) == {"task"}


def test_who_took_it_must_be_reported_truly() -> None:
    record = clean()
    record.troubles.append(Trouble("pilot", TAKEN_S - 0.1, GIVEN_BACK_S))
    assert rules(record) == set()
    record.called[2] = dataclasses.replace(record.called[2], by="ground station")
    assert rules(record) == {"task", "words"}
    record.troubles.append(Trouble("loss", 10.0, 13.0))
    assert rules(record) == set()


@pytest.mark.parametrize(
    ("kind", "names", "wrong"),
    [
        ("fence", ["fence"], "safety pilot"),
        ("fence", ["fence"], "autopilot"),
        ("ekf", ["position failsafe", "autopilot"], "safety pilot"),
        ("ekf", ["position failsafe", "autopilot"], "fence"),
    ],
)
def test_a_fence_and_a_lost_position_must_be_named(kind: str, names: list[str], wrong: str) -> None:
    record = clean()
    record.troubles.append(Trouble(kind, TAKEN_S - 7.0, TAKEN_S - 1.0))
    for by in names:
        record.called[2] = dataclasses.replace(record.called[2], by=by)
        assert rules(record) == set()
    record.called[2] = dataclasses.replace(record.called[2], by=wrong)
    assert rules(record) - {"words"} == {"task"}


def test_the_state_is_not_known_where_a_fault_takes_the_position_away_and_is_where_the_fence_is_breached() -> None:
    record = clean()
    record.said = [
        dataclasses.replace(said, state="UNINITIALIZED") if 10.0 < said.time_s < 12.0 else said for said in record.said
    ]
    record.troubles.append(Trouble("fence", 6.0, 7.9))
    assert rules(record) == {"state"}
    record.troubles.append(Trouble("ekf", 6.0, 7.9))
    assert rules(record) == set()


@pytest.mark.parametrize("kind", ["fence", "ekf"])
def test_a_failsafe_of_the_fence_or_the_estimator_allows_nothing_to_be_sent(kind: str) -> None:
    record = clean()
    record.troubles.append(Trouble(kind, TAKEN_S - 3.0, GIVEN_BACK_S))
    record.called[2] = dataclasses.replace(record.called[2], by="fence" if kind == "fence" else "position failsafe")
    assert rules(record) == set()
    record.sent.append(Sent(16.5, "setpoint"))
    assert rules(record) == {"take-over", "unasked"}


def test_a_plan_follows_from_its_seed() -> None:
    assert plan(7) == plan(7)
    assert plan(7) != plan(8)
    assert plan(7, has_faults=False).steps == plan(7).steps
    assert plan(7, has_faults=False).faults == ()


def test_the_plans_of_a_campaign_have_every_fault() -> None:
    kinds = {fault.kind for seed in range(200) for fault in plan(seed).faults}
    assert kinds >= {"loss", "delay", "corruption", "silence", "kill_daemon", "kill_client", "second_sender", "pilot"}
    assert kinds >= {"rc_loss", "battery", "fence", "ekf", "freeze", "busy", "reboot"}
    assert kinds >= {"limits", "wide_fence", "home", "origin", "station"}


@pytest.mark.parametrize(
    ("reason", "cause"),
    [
        ("in the air, mode POSCTL does not take our references: safety pilot", "safety pilot"),
        ("does not follow (in the air, mode POSCTL does not take our references: safety pilot)", "safety pilot"),
        ("falls (in the air, mode POSCTL: safety pilot; the autopilot has stopped its motors)", "safety pilot"),
        ("in the air, mode POSCTL: another one", ""),
    ],
)
def test_the_cause_in_a_reason_is_found_whatever_stands_behind_it(reason: str, cause: str) -> None:
    assert cause_in(reason) == cause
