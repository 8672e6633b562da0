"""The judge's rules for a world that changes in flight: each passes on a clean flight, and finds its breach."""

from __future__ import annotations

import dataclasses
import json

import pytest

from tests.campaign.evidence import Case
from tests.campaign.judge import IN_AIR, LANDING, judge
from tests.campaign.motion import asides_m
from tests.campaign.record import (
    DAEMON_KILLED,
    DAEMON_STARTED,
    Called,
    Life,
    Located,
    Place,
    Record,
    ReportedSample,
    Sent,
    StatusText,
    Trouble,
    Value,
)
from tests.campaign.test_judge import GIVEN_BACK_S, TAKEN_S, clean, rules, times

HOME = Located(-5.0, (0.0, 0.0, 0.0))
BEGUN_S, DONE_S = 10.0, 40.0


def flight(place: list[Located], *calls: Called, autopilot: str = "ardupilot") -> Record:
    """In the air all the time, flown by setpoints from 10 s to 40 s."""
    record = Record(autopilot, anchor=(0.0, 0.0, 0.0))
    mode = Case(record).modes.references
    record.lives.append(Life(-10.0, DAEMON_STARTED))
    record.told += [ReportedSample(time_s, True, mode, IN_AIR) for time_s in times(0.0, 50.0, 0.05)]
    record.sent += [Sent(time_s, "setpoint") for time_s in times(BEGUN_S, DONE_S, 0.02)]
    record.called += [Called("go_to", 1.0, 2.0), *calls]
    record.truth += [Located(-1.0, (0.0, 0.0, 0.0)), *place]
    record.estimate += place
    return record


def eastwards(speeds_m_s: dict[float, float], *, aside_m_s: float = 0.0) -> list[Located]:
    """With the speed of the newest of these times, sideways too from the second one on."""
    east_m, found = 0.0, []
    for time_s in times(0.0, 50.0, 0.05):
        speed_m_s = [value for since_s, value in speeds_m_s.items() if since_s <= time_s][-1]
        east_m += speed_m_s * 0.05
        north_m = aside_m_s * max(0.0, time_s - BEGUN_S)
        found.append(Located(time_s, (east_m, north_m, 3.0), (speed_m_s, aside_m_s, 0.0)))
    return found


# --- way --------------------------------------------------------------------------------------------------------------


def test_a_task_that_stands_is_found_unless_it_ends() -> None:
    still = eastwards({0.0: 0.0})
    for name in ("go_to", "go_to_geo", "go_above_home", "path", "take_off", "rtl"):
        assert rules(flight(still, Called(name, 11.0, 22.5, "TIMEOUT"))) == set()
        assert rules(flight(still, Called(name, 11.0, 24.5, "TIMEOUT"))) == {"way"}
    assert rules(flight(still, Called("land", 11.0, 39.0))) - {"goal"} == set()


def test_a_task_that_moves_slowly_progresses() -> None:
    assert rules(flight(eastwards({0.0: 0.05}), Called("go_to", 11.0, 39.0, "TIMEOUT"))) == set()
    assert rules(flight(eastwards({0.0: 0.03}), Called("go_to", 11.0, 39.0, "TIMEOUT"))) == {"way"}


def test_a_task_whose_estimate_moves_may_stand() -> None:
    record = flight(eastwards({0.0: 0.0}), Called("go_to", 11.0, 39.0, "TIMEOUT"))
    record.estimate = [dataclasses.replace(each, place=(0.0, 0.0, 30.0 - 0.1 * each.time_s)) for each in record.truth]
    assert rules(record) == set()
    record.estimate = [dataclasses.replace(each, place=(0.0, 0.0, 3.0 - 0.01 * each.time_s)) for each in record.truth]
    assert rules(record) == {"way"}


def test_a_task_whose_path_was_cut_may_stand() -> None:
    record = flight(eastwards({0.0: 0.0}), Called("go_to", 11.0, 39.0, "TIMEOUT"))
    record.troubles.append(Trouble("silence", 12.0, 16.0))
    assert rules(record) == {"way"}
    record.troubles.append(Trouble("silence", 26.0, 27.0))
    assert rules(record) == set()


# --- fence ------------------------------------------------------------------------------------------------------------


def test_an_autopilot_that_flies_out_of_the_fence_without_its_daemon_is_not_led_out() -> None:
    """Campaign, 11200150: ArduCopter follows the last velocity for 3 s, and the next daemon has it brake."""
    record = flight(eastwards({0.0: 0.0, 12.0: 5.0, 15.0: 1.5, 16.0: 0.0}))  # to 16.5 m
    record.fence_m = (12.0, 15.0)
    assert "fence" in rules(record)
    record.sent = [each for each in record.sent if not 13.0 < each.time_s < 15.0]
    record.lives += [Life(13.01, DAEMON_KILLED), Life(14.5, DAEMON_STARTED)]
    assert "fence" not in rules(record)
    record.truth = eastwards({0.0: 0.0, 12.0: 5.0, 16.0: 0.0, 20.0: 3.0, 25.0: 0.0})
    record.estimate = list(record.truth)
    assert "fence" in rules(record)  # led farther out


# --- aside ------------------------------------------------------------------------------------------------------------

LINE = Called("velocity", BEGUN_S, 16.0, velocity=(1.0, 0.0, 0.0))
SPEEDS = {0.0: 0.0, BEGUN_S + 0.06: 1.0, 16.0: 0.0}


@pytest.mark.parametrize(("aside_m_s", "found"), [(0.04, set()), (0.06, {"aside"}), (-0.06, {"aside"})])
def test_a_velocity_that_leads_aside_is_found(aside_m_s: float, found: set[str]) -> None:
    assert rules(flight(eastwards(SPEEDS, aside_m_s=aside_m_s), LINE)) == found


def test_how_far_aside_a_velocity_led_is_counted() -> None:
    ((_, worst_m, allowed_m),) = asides_m(Case(flight(eastwards(SPEEDS, aside_m_s=0.04), LINE)))
    assert worst_m == pytest.approx(0.24, abs=0.01)
    assert allowed_m == pytest.approx(0.3)


def test_a_velocity_leads_along_the_path_from_where_it_was_led_before() -> None:
    """PX4 holds a position within 0.4 m, and the reference of the velocity begins there (campaign, 13500105)."""
    for led_m, found in ((0.1, set()), (-0.1, {"aside"})):
        record = flight(eastwards(SPEEDS, aside_m_s=0.06), LINE)
        record.sent.append(Sent(BEGUN_S - 0.1, "setpoint", way=(0.0, led_m, 0.0)))
        record.sent.sort(key=lambda each: each.time_s)
        assert rules(record) == found


def test_what_the_estimate_does_not_show_is_no_breach() -> None:
    record = flight(eastwards(SPEEDS, aside_m_s=0.3), LINE)
    record.estimate = eastwards(SPEEDS)
    assert rules(record) == set()


def test_a_velocity_that_begins_in_motion_or_is_short_or_befallen_is_not_assessed() -> None:
    moving = {0.0: 0.0, BEGUN_S - 2.0: 1.0, 16.0: 0.0}
    assert rules(flight(eastwards(moving, aside_m_s=0.2), LINE)) == set()
    short = dataclasses.replace(LINE, ended_s=BEGUN_S + 2.5)
    assert rules(flight(eastwards(SPEEDS, aside_m_s=0.2), short)) == set()
    for kind, found in (("second_sender", set()), ("home", {"aside"}), ("origin", {"aside"}), ("limits", {"aside"})):
        record = flight(eastwards(SPEEDS, aside_m_s=0.2), LINE)
        record.troubles.append(Trouble(kind, 11.0, 13.0))
        assert rules(record) == found


def test_a_short_starvation_does_not_excuse_a_velocity() -> None:
    record = flight(eastwards(SPEEDS, aside_m_s=0.2), LINE)
    record.troubles.append(Trouble("busy", 11.0, 11.4))
    assert rules(record) == {"aside"}
    record.troubles.append(Trouble("busy", 13.0, 13.2))
    assert rules(record) == set()


def test_a_velocity_is_assessed_as_far_as_it_is_away_from_fences() -> None:
    record = flight(eastwards(SPEEDS, aside_m_s=0.06), LINE)
    record.fence_m = (7.0, 100.0)  # within 3 m of it after 4 s
    assert rules(record) == set()
    record = flight(eastwards(SPEEDS, aside_m_s=0.06), LINE)
    record.told_homes.append(HOME)
    record.values += [Value(-5.0, name, value) for name, value in AP_FENCE.items()]
    assert rules(record) == {"aside"}
    record.values.append(Value(9.0, "FENCE_RADIUS", 7.0))
    assert rules(record) == set()


# --- limits -----------------------------------------------------------------------------------------------------------


def limited(place: list[Located], **values: float) -> Record:
    """The limit that is told at 20 s follows one of 10 m/s."""
    autopilot = "px4" if "MPC_XY_VEL_MAX" in values else "ardupilot"
    record = flight(place, Called("velocity", BEGUN_S, DONE_S), autopilot=autopilot)
    for name, value in values.items():
        record.values += [Value(-5.0, name, 1000.0 if name == "WPNAV_SPEED" else 10.0), Value(20.0, name, value)]
    record.values.sort(key=lambda each: each.time_s)
    return record


@pytest.mark.parametrize("values", [{"WPNAV_SPEED": 150.0}, {"MPC_XY_VEL_MAX": 1.5}])
def test_a_flight_that_goes_on_faster_than_a_new_limit_is_found(values: dict[str, float]) -> None:
    slowed = {0.0: 5.0, 22.0: 1.5}  # 1 s and 2.3 s of braking are allowed
    assert rules(limited(eastwards(slowed), **values)) == set()
    assert rules(limited(eastwards({0.0: 5.0}), **values)) == {"limits"}
    assert rules(limited(eastwards({0.0: 5.0, 25.0: 1.5}), **values)) == {"limits"}


def test_a_speed_is_counted_by_the_clock_of_the_daemon() -> None:
    """PX4 6600004: its simulator made 0.87 s in a second, and flew 6.2 m/s by its own clock, 5.4 m/s by ours."""
    at_5_m_s, at_6_m_s = eastwards({0.0: 5.0}), eastwards({0.0: 6.2})
    slower = [dataclasses.replace(each, velocity=(6.2, 0.0, 0.0)) for each in at_5_m_s]
    assert rules(limited(slower, MPC_XY_VEL_MAX=5.0)) == set()
    assert rules(limited(at_6_m_s, MPC_XY_VEL_MAX=5.0)) == {"limits"}


def test_a_simulator_that_was_slow_before_excuses_no_speed() -> None:
    place = eastwards({0.0: 0.0, BEGUN_S: 5.0, 30.0: 6.2})
    slow = [dataclasses.replace(each, velocity=(6.2, 0.0, 0.0)) if each.time_s < 28.0 else each for each in place]
    (breach,) = judge(limited(slow, MPC_XY_VEL_MAX=5.0))
    assert breach.rule == "limits"
    assert 29.0 < breach.time_s < 31.5


def test_a_limit_that_did_not_get_to_the_daemon_binds_nothing() -> None:
    record = limited(eastwards({0.0: 5.0}), WPNAV_SPEED=150.0)
    record.values = [each for each in record.values if each.time_s < 20.0]
    assert rules(record) == set()


def test_a_limit_is_known_anew_after_the_daemon_has_started() -> None:
    record = limited(eastwards({0.0: 5.0}), WPNAV_SPEED=150.0)
    record.lives.append(Life(20.5, DAEMON_STARTED))
    record.called.append(Called("velocity", 21.0, DONE_S))
    assert "limits" not in rules(record)
    record.values.append(Value(23.0, "WPNAV_SPEED", 150.0))
    assert "limits" in rules(record)


def test_a_speed_that_the_estimate_does_not_show_is_no_breach() -> None:
    record = limited(eastwards({0.0: 1.9}), WPNAV_SPEED=100.0)
    assert rules(record) == {"limits"}
    record.estimate = eastwards({0.0: 1.5})
    assert rules(record) == set()


def test_the_cruise_of_px4_bounds_tasks_only() -> None:
    record = limited(eastwards({0.0: 5.0}), MPC_XY_CRUISE=1.0, MPC_XY_VEL_MAX=12.0)
    assert rules(record) == set()
    record.called[-1] = dataclasses.replace(record.called[-1], name="path")
    assert rules(record) == {"limits"}


def test_a_limit_does_not_bind_what_others_fly() -> None:
    record = limited(eastwards({0.0: 5.0}), WPNAV_SPEED=150.0)
    record.sent.clear()
    assert rules(record) == set()


# --- newest fence -----------------------------------------------------------------------------------------------------

AP_FENCE = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 2.0, "FENCE_RADIUS": 40.0}


def fenced(place: list[Located], autopilot: str, known_s: float, radius_m: float) -> Record:
    record = flight(place, Called("velocity", BEGUN_S, DONE_S), autopilot=autopilot)
    record.told_homes.append(HOME)
    if autopilot == "px4":
        record.values += [Value(-5.0, "GF_MAX_HOR_DIST", 150.0), Value(known_s, "GF_MAX_HOR_DIST", radius_m)]
    else:
        record.values += [Value(-5.0, name, value) for name, value in AP_FENCE.items()]
        record.values.append(Value(known_s, "FENCE_RADIUS", radius_m))
    return record


@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_a_flight_through_a_new_fence_is_found(autopilot: str) -> None:
    stops = {0.0: 1.0, 22.0: 0.0}
    assert rules(fenced(eastwards(stops), autopilot, 15.0, 25.0)) == set()
    assert rules(fenced(eastwards(stops), autopilot, 15.0, 20.0)) == {"newest fence"}
    assert rules(fenced(eastwards(stops), autopilot, 21.0, 20.0)) == set()  # it brakes
    assert rules(fenced(eastwards({0.0: 1.0}), autopilot, 21.0, 20.0)) == {"newest fence"}


def test_a_fence_stands_around_the_newest_home() -> None:
    record = fenced(eastwards({0.0: 1.0, 22.0: 0.0}), "ardupilot", 15.0, 20.0)
    record.told_homes.append(Located(12.0, (5.0, 0.0, 0.0)))
    assert rules(record) == set()


def test_a_fence_that_is_off_binds_nothing() -> None:
    record = fenced(eastwards({0.0: 1.0}), "ardupilot", 15.0, 20.0)
    record.values.append(Value(15.0, "FENCE_ENABLE", 0.0))
    assert rules(record) == set()


def test_nothing_leads_farther_out_of_a_fence_that_it_is_beyond_already() -> None:
    """Recovered with force 10 m outside of it, it may come back, and go no farther."""
    record = fenced(eastwards({0.0: 4.0, BEGUN_S: -1.0}), "ardupilot", 5.0, 30.0)
    assert rules(record) == set()
    assert rules(fenced(eastwards({0.0: 4.0, BEGUN_S: 0.0, 12.0: 1.0}), "ardupilot", 5.0, 30.0)) == {"newest fence"}


# --- words ------------------------------------------------------------------------------------------------------------


def reported(record: Record, time_s: float, reason: str, state: str = "FLYING_MANUAL") -> Record:
    record.said = [each for each in record.said if abs(each.time_s - time_s) > 0.3]
    record.said.append(StatusText(time_s, state, reason))
    record.said.sort(key=lambda each: each.time_s)
    return record


def test_a_flight_that_was_commanded_is_never_reported_not_to_have_been() -> None:
    reason = "in the air (mode GUIDED); UAL has not been commanded in this flight and sends nothing"
    record = reported(clean(), 22.0, reason, "FLYING_AUTO")
    assert rules(record) == {"words"}
    record.lives.append(Life(21.0, DAEMON_STARTED))
    assert "words" not in rules(record)


@pytest.mark.parametrize("cause", ["fence", "battery failsafe", "rc failsafe", "setpoint failsafe"])
def test_a_cause_that_cannot_be_is_found(cause: str) -> None:
    record = clean()
    record.called[2] = dataclasses.replace(record.called[2], by=cause)
    assert rules(record) == {"words"}
    assert rules(reported(clean(), 17.0, f"in the air, mode LOITER does not take our references: {cause}")) == {"words"}


@pytest.mark.parametrize("fault", ["silence", "cut"])
def test_a_path_that_falls_silent_amid_an_upload_may_end_the_setpoints_as_any_other_may(fault: str) -> None:
    record = clean()
    record.troubles.append(Trouble(fault, TAKEN_S - 1.2, TAKEN_S - 0.1))
    assert rules(reported(record, 17.0, "mode LOITER does not take our references: setpoint failsafe")) == set()


def test_a_fence_is_not_named_where_a_ground_station_has_it_land() -> None:
    record = clean()
    record.told = [
        dataclasses.replace(each, mode=9, landed=LANDING) if TAKEN_S <= each.time_s < GIVEN_BACK_S else each
        for each in record.told
    ]
    record.said = [
        dataclasses.replace(each, state="LANDING") if TAKEN_S < each.time_s < GIVEN_BACK_S else each
        for each in record.said
    ]
    record.troubles += [Trouble("wide_fence", 1.0, 3.0), Trouble("station", TAKEN_S - 0.2, TAKEN_S - 0.1)]
    record.called[2] = dataclasses.replace(record.called[2], by="ground station")
    assert rules(record) == set()
    assert rules(reported(record, 18.0, "the autopilot lands (mode LAND): fence", "LANDING")) == {"words"}


def test_nobody_else_is_named_where_only_ual_has_commanded() -> None:
    record = clean()
    assert rules(reported(record, 22.0, "in the air; others took it (mode GUIDED)", "FLYING_AUTO")) == set()
    record.orders = [order for order in record.orders if order.what == "arm"]
    assert rules(record) == {"words"}


def test_a_cause_is_named_late_by_a_daemon_that_was_stopped_as_it_came() -> None:
    record = reported(clean(), TAKEN_S + 2.5, "in the air, mode LOITER does not take our references")
    record.called[2] = dataclasses.replace(record.called[2], outcome="LINK_LOST", by="")
    record.said += [StatusText(17.5, "FLYING_MANUAL", "mode LOITER does not take our references: safety pilot")]
    assert rules(record) == {"words"}
    record.troubles.append(Trouble("freeze", TAKEN_S - 0.4, TAKEN_S + 2.2))
    assert "words" not in rules(record)


def test_one_cause_has_one_name() -> None:
    record = clean()
    record.troubles.append(Trouble("freeze", 5.0, 6.0))
    record.called[2] = dataclasses.replace(record.called[2], by="failsafe")
    assert rules(reported(record, 16.0, "in the air, mode LOITER does not take our references: failsafe")) == set()
    assert rules(reported(record, 17.0, "it falls (mode LOITER does not take our references: failsafe)")) == set()
    assert rules(reported(record, 18.0, "in the air, mode LOITER does not take our references")) == {"words"}


def test_a_landing_of_uals_has_no_cause_before_its_mode_is_reported() -> None:
    record = clean()
    record.troubles.append(Trouble("freeze", 5.0, 6.0))
    record.called[2] = dataclasses.replace(record.called[2], by="failsafe")
    reported(record, 17.0, "in the air, mode LOITER does not take our references: failsafe")
    record.called.append(Called("land", 17.9, 18.5))
    assert "words" not in rules(reported(record, 18.0, "our landing is under way"))


def test_a_task_that_was_ended_by_nothing_is_found() -> None:
    record = clean()
    record.called[2] = dataclasses.replace(record.called[2], by="")
    assert rules(record) == {"words"}
    record.called[2] = dataclasses.replace(record.called[2], outcome="INTERNAL", by="")
    assert rules(record) == {"words"}


# --- a height above home ----------------------------------------------------------------------------------------------


def test_a_height_above_home_counts_from_where_home_is_at_the_end() -> None:
    goal: Place = (4.0, 0.0, 2.0)
    record = clean()
    record.called[1] = Called("go_above_home", 9.0, 13.5, goal=goal, is_on_earth=True, is_above_home=True)
    record.homes += [Located(-5.0, (0.0, 0.0, 0.0)), Located(5.0, (1.0, 1.0, 1.0))]
    assert rules(record) == set()
    record.homes[-1] = Located(5.0, (0.0, 0.0, -2.0))
    assert rules(record) == {"goal"}
    record.homes[-1] = Located(12.8, (0.0, 0.0, -2.0))  # which of them it was is not known
    assert rules(record) == set()


def test_records_of_before_can_be_read() -> None:
    record = clean()
    values = dataclasses.asdict(record)
    for name in ("values", "homes", "told_homes"):
        del values[name]
    for call in values["called"]:
        del call["velocity"], call["is_above_home"], call["text"]
    assert Record.from_json(json.dumps(values)) == record
