"""The judge's rules for a vehicle that fails, and for services: each passes a clean flight, and finds its breach."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest

from tests.campaign.judge import ON_GROUND
from tests.campaign.modes import ARDUPILOT
from tests.campaign.plan import has, plan
from tests.campaign.record import (
    DAEMON_KILLED,
    DAEMON_STARTED,
    Called,
    Life,
    Located,
    Order,
    Place,
    Record,
    ReportedSample,
    Sent,
    StatusText,
    Text,
    Trouble,
    Value,
)
from tests.campaign.test_judge import TAKEN_S, clean, current_position, rules, times
from tests.campaign.test_world import BEGUN_S, eastwards, flight

DEAD_S = 11.0
TOLD = "the UAV does not follow: it falls at 7 m/s; new motions are refused"
HELD: Place = (0.0, 0.0, 3.0)


def status_text(record: Record, since_s: float, until_s: float, reason: str) -> None:
    """Says so in that time."""
    record.said = [
        dataclasses.replace(each, reason=reason) if since_s <= each.time_s < until_s else each for each in record.said
    ]


def falling(record: Record) -> Record:
    """It falls from 3 m and lies there until its end."""
    record.truth = [each for each in record.truth if each.time_s < DEAD_S]
    for time_s in times(DEAD_S, 35.0, 0.05):
        up_m = max(0.0, 3.0 - 4.9 * (time_s - DEAD_S) ** 2)
        down_m_s = 9.8 * (time_s - DEAD_S) if up_m else 0.0
        record.truth.append(Located(time_s, (2.0, 0.0, up_m), (0.0, 0.0, -down_m_s)))
    record.estimate = list(record.truth)
    record.called = [call for call in record.called if call.began_s < DEAD_S]
    record.called[-1] = dataclasses.replace(record.called[-1], ended_s=12.0, outcome="TASK_FAILED", by="fall")
    return record


# --- follows ----------------------------------------------------------------------------------------------------------


def test_a_fall_is_reported() -> None:
    record = falling(clean())
    assert "follows" in rules(record)
    status_text(record, DEAD_S + 1.3, 32.0, TOLD)
    assert "follows" not in rules(record)


def test_a_fall_that_is_reported_and_is_none_is_found() -> None:
    """Campaign, 13400029: the velocity after a pilot's flight was refused as one that another sender disturbs."""
    record = clean()
    status_text(
        record, 10.0, 12.0, "another sender, or the UAV does not follow: it is 5.1 (m, or m/s) beside what is asked"
    )
    assert "follows" in rules(record)
    record.troubles.append(Trouble("second_sender", 9.0, 9.5))
    assert "follows" not in rules(record)
    record = clean()
    status_text(record, record.said[0].time_s, 3.0, TOLD)  # of the flight before
    assert "follows" not in rules(record)


def test_a_fall_that_is_reported_too_late_is_found() -> None:
    record = falling(clean())
    status_text(record, DEAD_S + 2.5, 32.0, TOLD)
    assert "follows" in rules(record)
    record.troubles.append(Trouble("busy", DEAD_S, DEAD_S + 2.2))
    assert "follows" not in rules(record)


def test_after_a_fall_nothing_new_is_accepted_until_somebody_recovers_it() -> None:
    record = falling(clean())
    status_text(record, DEAD_S + 1.0, 32.0, TOLD)
    refused = Called("go_to", 14.5, 14.6, "WRONG_STATE")
    recovered = Called("recover", 15.0, 15.5)
    accepted = Called("go_to", 16.0, 16.5, "TASK_ABORTED", "client")
    record.called += [refused, recovered, accepted]
    assert "follows" not in rules(record)
    record.called.remove(recovered)
    assert "follows" in rules(record)


def test_what_is_disarmed_in_the_air_is_reported_as_that() -> None:
    record = clean()
    record.told = [each for each in record.told if each.time_s <= 27.0]
    record.told += [ReportedSample(time_s, False, landed=ON_GROUND) for time_s in times(27.05, 35.0, 0.05)]
    record.said = [each for each in record.said if each.time_s < 27.3]
    fallen = "the motors were disarmed in the air, and the UAV falls at 5 m/s"
    record.said += [StatusText(time_s, "LANDED_DISARMED", fallen) for time_s in times(27.3, 34.0, 0.05)]
    record.called[-1] = dataclasses.replace(record.called[-1], outcome="TASK_FAILED", ended_s=27.5, by="disarmed")
    assert rules(record) == set()
    status_text(record, 27.3, 34.0, "not armed")
    assert rules(record) == {"follows"}


def offset(way_m: float, farther_m_s: float, until_s: float) -> Record:
    """Flown by setpoints that lead to a place which is that far away, and farther by and by, for some time."""
    record = flight(eastwards({0.0: 0.0}), Called("go_to", BEGUN_S + 1.0, BEGUN_S + 9.0, goal=HELD))
    ways = {each.time_s: way_m + farther_m_s * (each.time_s - BEGUN_S) for each in record.sent}
    record.sent = [
        dataclasses.replace(each, way=(ways[each.time_s] if each.time_s < until_s else 1.0, 0.0, 0.0))
        for each in record.sent
    ]
    record.said += [StatusText(time_s, "FLYING_AUTO") for time_s in times(0.0, 50.0, 0.05)]
    return record


@pytest.mark.parametrize(
    ("way_m", "farther_m_s", "until_s", "found"),
    [
        (2.5, 0.0, 40.0, set()),
        (3.5, 0.0, BEGUN_S + 2.5, set()),
        (3.5, 0.0, BEGUN_S + 5.0, {"follows"}),
        (3.0, 1.0, BEGUN_S + 2.5, {"follows"}),
        (6.0, -0.5, BEGUN_S + 5.0, set()),
    ],
)
def test_a_vehicle_that_is_next_to_what_was_commanded_is_reported(
    way_m: float, farther_m_s: float, until_s: float, found: set[str]
) -> None:
    record = offset(way_m, farther_m_s, until_s)
    assert rules(record) - {"goal"} == found
    status_text(
        record, BEGUN_S, until_s + 2.0, "another sender, or the UAV does not follow: it is 4 m beside what is asked"
    )
    assert rules(record) - {"goal"} == (set() if found else {"follows"})


def test_a_take_off_that_is_held_on_the_ground_is_assessed_by_its_path() -> None:
    """Its reference climbs on: after 3 s it is 3 m above. The task has 8 s to say that it makes no way."""
    record = offset(4.0, 0.0, BEGUN_S + 6.0)
    record.called[-1] = Called("take_off", BEGUN_S, BEGUN_S + 9.0, "TIMEOUT", "no way", height_m=3.0)
    assert rules(record) == {"follows"}
    record.truth = [Located(each.time_s, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) for each in record.truth]
    assert rules(record) == set()


def test_where_the_link_or_the_estimate_is_disturbed_nobody_knows_where_it_is() -> None:
    record = offset(3.5, 0.0, 40.0)
    record.troubles.append(Trouble("gps_jump", 0.0, 45.0))
    assert rules(record) == set()
    record.troubles[:] = [Trouble("wind", 0.0, 45.0)]
    assert rules(record) == {"follows"}


def test_a_velocity_that_is_not_executed_is_found() -> None:
    record = flight(eastwards({0.0: 0.0}))
    record.sent = [dataclasses.replace(each, velocity=(2.5, 0.0, 0.0)) for each in record.sent]
    record.said += [StatusText(time_s, "FLYING_AUTO") for time_s in times(0.0, 50.0, 0.05)]
    assert rules(record) == set()  # 2.75 m/s off are allowed
    record.sent = [dataclasses.replace(each, velocity=(4.0, 0.0, 0.0)) for each in record.sent]
    assert rules(record) == {"follows"}


# --- Nobody armed, nothing flies --------------------------------------------------------------------------------------


def test_who_was_armed_by_nobody_is_found() -> None:
    record = clean()
    record.orders = [order for order in record.orders if order.what != "arm"]
    assert rules(record) == {"nothing flies"}
    record.called.append(Called("arm", 1.5, 2.2))
    assert rules(record) == set()


def test_a_pilot_who_tries_for_long_has_armed_it() -> None:
    """Campaign, 15000108: ArduCopter refused it for 9 s, as its satellites had jumped in the flight before."""
    record = clean()
    [order] = [order for order in record.orders if order.what == "arm"]
    record.orders[record.orders.index(order)] = dataclasses.replace(order, time_s=order.time_s - 20.0)
    assert rules(record) == {"nothing flies"}
    record.orders.append(dataclasses.replace(order, what="armed", time_s=order.time_s + 3.0))
    record.orders.sort(key=lambda each: each.time_s)
    assert rules(record) == set()
    record.orders.insert(1, dataclasses.replace(order, what="armed", time_s=order.time_s - 10.0))
    assert rules(record) == {"nothing flies"}


def test_what_lifts_off_again_after_a_fall_is_found() -> None:
    """Its motors work again after 5 s, and it climbs back by itself."""
    record = falling(clean())
    record.told = [dataclasses.replace(each, mode=ARDUPILOT.references) for each in record.told]
    status_text(record, DEAD_S + 1.0, 33.0, TOLD)
    assert "nothing flies" not in rules(record)
    record.truth = [
        dataclasses.replace(each, place=(2.0, 0.0, 3.0)) if each.time_s > DEAD_S + 5.0 else each
        for each in record.truth
    ]
    assert "nothing flies" in rules(record)
    record.lives += [Life(DEAD_S + 0.1, DAEMON_KILLED), Life(DEAD_S + 4.0, DAEMON_STARTED)]
    assert "nothing flies" in rules(record)
    sent, record.sent = record.sent, [each for each in record.sent if each.time_s < DEAD_S]
    assert "nothing flies" not in rules(record)  # by what was asked of it before its daemon was killed
    record.sent.append(Sent(DEAD_S + 4.2, "land"))
    assert "nothing flies" in rules(record)
    record.called.append(Called("land", DEAD_S + 4.1, DEAD_S + 9.0))
    assert "nothing flies" not in rules(record)  # nor does a landing lift it
    record.called.pop()
    record.sent = sent
    record.called.append(Called("recover", DEAD_S + 4.0, DEAD_S + 4.5))
    assert "nothing flies" not in rules(record)


def test_a_fall_while_no_daemon_runs_is_reported_by_none() -> None:
    """Campaign, 11300174: the motors were stopped, and let run, before the next daemon had started."""
    record = falling(clean())
    assert "follows" in rules(record)
    record.lives.append(Life(DEAD_S + 0.8, DAEMON_STARTED))
    assert "follows" not in rules(record)
    record.lives[-1] = Life(DEAD_S - 5.0, DAEMON_STARTED)
    assert "follows" in rules(record)


@pytest.mark.parametrize("mode", [9, 5])
def test_what_rises_in_its_own_landing_or_in_its_pilots_mode_is_lifted_by_nobody(mode: int) -> None:
    """Its motors were weak and work again: PX4's landing makes up for that by 1.4 m, and the daemon sends nothing. So
    it is in a mode of the pilot (15100104).
    """
    record = falling(clean())
    status_text(record, DEAD_S + 1.0, 33.0, TOLD)
    record.told = [dataclasses.replace(each, mode=mode) if each.time_s > 10.9 else each for each in record.told]
    record.sent = [each for each in record.sent if each.time_s < 11.0]
    record.truth = [
        dataclasses.replace(each, place=(2.0, 0.0, 1.4)) if 16.0 < each.time_s < 18.0 else each for each in record.truth
    ]
    assert "nothing flies" not in rules(record)
    record.sent.append(Sent(15.5, "setpoint"))
    assert "nothing flies" in rules(record)


def test_a_take_off_that_has_ended_lifts_nothing() -> None:
    """It was held on the ground, its task ended, and then it is free."""
    record = clean()
    for call, found in ((("", 8.0), set()), (("NO_WAY", 4.0), set()), (("NO_WAY", 3.2), {"nothing flies"})):
        record.called[0] = dataclasses.replace(record.called[0], outcome=call[0], ended_s=call[1])
        assert rules(record) & {"nothing flies"} == found


def test_a_take_off_that_an_autopilot_flies_by_itself_goes_on_without_its_daemon() -> None:
    record = clean()
    record.called[0] = dataclasses.replace(record.called[0], outcome="DAEMON_UNREACHABLE", ended_s=3.2)
    assert "nothing flies" not in rules(record)
    record.called[0] = dataclasses.replace(record.called[0], began_s=-6.0, ended_s=-5.8)
    assert "nothing flies" in rules(record)


@pytest.mark.parametrize("mode", [ARDUPILOT.returns, ARDUPILOT.hold])
def test_an_autopilots_fence_that_is_narrower_than_where_it_stands_lifts_it(mode: int) -> None:
    """Campaign, 13400093: its fence became 2 m wide 3 m from home, and the return lifts it off. 15100067: a PX4 fell in
    the hold of its fence, and climbed back.
    """
    record = clean()
    record.called[0] = dataclasses.replace(record.called[0], outcome="GEOFENCE", ended_s=3.2)
    record.told = [dataclasses.replace(each, mode=mode) for each in record.told]
    assert "nothing flies" in rules(record)
    record.troubles.append(Trouble("fence", 3.1, 6.0))
    assert "nothing flies" not in rules(record)
    record.told = [dataclasses.replace(each, mode=ARDUPILOT.references) for each in record.told]
    assert "nothing flies" in rules(record)


def test_a_take_off_that_a_new_fence_ended_was_commanded() -> None:
    """Campaign, 1720000000053: its fence became 2 m wide 5.7 m from home, just after the take-off was accepted."""
    record = clean()
    ended = dataclasses.replace(record.called[0], outcome="GEOFENCE", ended_s=3.2)
    record.called[0] = ended
    assert "unasked" in rules(record)
    record.called[0] = dataclasses.replace(ended, text="take_off: beyond its fence; this has changed in flight")
    assert "unasked" not in rules(record)


def test_a_call_that_no_daemon_has_received_commands_nothing() -> None:
    """Campaign, 1730000000001: the new daemon took 12 s to start, and had not been commanded."""
    record = clean()
    unheard = dataclasses.replace(record.called[0], outcome="DAEMON_UNREACHABLE", text="no UAL daemon of uav_1 answers")
    record.called[0] = unheard
    assert "unasked" in rules(record)
    record.called[0] = dataclasses.replace(unheard, text="the connection to the UAL daemon was lost")
    assert "unasked" not in rules(record)


def test_a_service_goes_on_while_it_is_disarmed_but_moves_nothing() -> None:
    """Campaign, 1720000000053: it was disarmed while a fence was uploaded."""
    record = clean()
    record.sent.append(Sent(34.5, "mission_count"))
    record.called.append(Called("fence", 31.3, 34.8))
    assert "unasked" not in rules(record)
    record.sent.append(Sent(34.6, "take_off"))
    assert "unasked" in rules(record)


# --- mission's owner, no part -----------------------------------------------------------------------------------------


def mission(outcome: str = "", ended_s: float = 13.5, text: str = "") -> Record:
    """The go-to was a mission."""
    record = clean()
    record.told = [
        dataclasses.replace(each, mode=ARDUPILOT.mission) if 9.1 <= each.time_s < ended_s else each
        for each in record.told
    ]
    record.sent = [each for each in record.sent if each.what != "setpoint" or not 9.0 < each.time_s < ended_s]
    record.sent.append(Sent(9.05, "mode", ARDUPILOT.mission))
    goals: tuple[Place, ...] = ((1.0, 0.0, 3.0), (4.0, 0.0, 3.0))
    by = "ground station" if outcome else ""
    record.called[1] = Called("mission", 9.0, ended_s, outcome, by, text=text, goals=goals)
    record.sent.sort(key=lambda each: each.time_s)
    return record


def test_a_mission_that_is_executed_passes() -> None:
    assert rules(mission()) == set()


def test_the_mission_of_another_station_ends_ours() -> None:
    named = "mission: another station has replaced it"
    for record, found in (
        (mission("TASK_ABORTED", 12.5, named), set()),
        (mission("TASK_ABORTED", 13.5, named), {"mission's owner"}),
        (mission(), {"mission's owner"}),
    ):
        record.orders.append(Order(12.0, "upload"))
        assert rules(record) & {"mission's owner"} == found
    record = mission()  # it was complete as the other station began (campaign, 1630000000024)
    record.orders.append(Order(13.4, "upload"))
    assert rules(record) == set()
    record = mission("TASK_ABORTED", 13.5, named)
    record.orders.append(Order(12.0, "upload"))
    record.missions += [Value(9.0, "mission", 3.0), Value(12.8, "mission", 2.0)]
    assert rules(record) == set()
    record = mission("TASK_ABORTED", 13.5, named)  # its client slept in a pause (campaign, 11300048)
    record.orders.append(Order(12.0, "upload"))
    status_text(record, 12.4, 13.6, "in the air, mode BRAKE ...; the ground station has brought another mission")
    assert "mission's owner" not in rules(record)
    record = mission("TASK_ABORTED", 12.5, "the vehicle was taken")
    record.called[1] = dataclasses.replace(record.called[1], by="safety pilot")
    record.orders.append(Order(12.0, "clear"))
    assert rules(record) == {"mission's owner", "words"}


def test_a_mission_that_was_cut_off_amid_its_upload_is_not_started() -> None:
    record = mission()
    record.called.insert(1, Called("upload", 8.2, 8.6, "CLIENT_KILLED"))
    assert rules(record) == set()  # it was gone before its first item left
    record.sent.append(Sent(8.5, "mission_item_int"))
    assert rules(record) == {"no part"}
    record.called.insert(2, Called("upload", 8.7, 8.9))
    assert rules(record) == set()


def test_an_upload_that_ends_well_after_its_client_was_killed_is_whole() -> None:
    """Campaign, 11200028: the autopilot had all of it, and the mission was started."""
    record = mission()
    record.called.insert(1, Called("upload", 8.2, 8.6, "CLIENT_KILLED"))
    record.sent.append(Sent(8.5, "mission_item_int"))
    record.uploaded.append(Value(8.1, "mission", 0.0))
    assert rules(record) == {"no part"}
    record.uploaded.append(Value(8.7, "mission", 0.0))
    assert rules(record) == set()


# --- texts ------------------------------------------------------------------------------------------------------------


def test_a_severe_text_is_reported_within_a_second() -> None:
    record = clean()
    record.texts.append(Text(11.0, "PreArm: GPS Glitch or Compass error"))
    assert rules(record) == {"texts"}
    for time_s, found in ((12.4, {"texts"}), (11.6, set())):
        record.healths[:] = [Text(0.0, ""), Text(time_s, "GPS Glitch or Compass error; ")]
        assert rules(record) == found


def test_a_text_that_something_is_over_takes_it_out_of_the_health() -> None:
    record = clean()
    record.texts += [Text(11.0, "GPS Glitch or Compass error"), Text(13.0, "Glitch cleared")]
    record.healths += [Text(11.1, "autopilot: GPS Glitch or Compass error"), Text(13.5, "")]
    assert rules(record) == set()
    record.healths[-1] = Text(14.5, "")
    assert rules(record) == {"texts"}


def test_a_check_that_fails_is_reported_whatever_its_figure_is_now() -> None:
    record = clean()
    record.texts.append(Text(11.0, "PreArm: Check mag field (xy diff:100>100)"))
    record.healths.append(Text(11.2, "autopilot: Arm: Check mag field (xy diff:101>100)"))
    assert rules(record) == set()
    record.texts.append(Text(12.0, "EKF3 lane switch 1"))
    record.healths.append(Text(12.2, "autopilot: EKF3 lane switch 0"))
    assert rules(record) == {"texts"}


def test_a_text_that_comes_while_the_daemon_is_gone_is_not_missed() -> None:
    record = clean()
    record.texts.append(Text(11.0, "GPS Glitch"))
    record.troubles.append(Trouble("kill_daemon", 10.9, 11.9))
    assert rules(record) == set()


# --- what is done was reached -----------------------------------------------------------------------------------------


def test_a_take_off_that_did_not_get_so_high_is_found() -> None:
    record = clean()
    for height_m, found in ((3.5, set()), (4.5, {"goal"})):
        record.called[0] = dataclasses.replace(record.called[0], height_m=height_m)
        assert rules(record) == found


def test_a_landing_that_was_a_fall_is_found() -> None:
    record = clean()
    for speed_m_s, found in ((1.5, set()), (6.0, {"goal", "follows"})):
        record.truth = [
            Located(each.time_s, each.place, (0.0, 0.0, -speed_m_s if 30.0 <= each.time_s < 31.0 else 0.0))
            for each in record.truth
        ]
        assert rules(record) == found


@pytest.mark.parametrize(
    ("goals", "found"),
    [
        (((4.0, 0.0, 3.0), (-2.5, 0.0, 3.0)), {"goal"}),
        (((4.0, 4.0, 3.0),), {"goal"}),
        (((4.0, 1.0, 3.0), (3.0, 0.0, 3.0)), set()),
    ],
)
def test_a_mission_passes_its_positions_in_their_order(goals: tuple[Place, ...], found: set[str]) -> None:
    record = mission()
    record.called[1] = dataclasses.replace(record.called[1], goals=goals)
    record.truth = [Located(each.time_s, current_position(each.time_s)) for each in record.truth]
    assert rules(record) == found


@pytest.mark.parametrize(("begins_s", "ends_s", "found"), [(0.0, 8.9, {"goal"}), (12.8, 13.2, set())])
def test_a_waypoint_counts_as_passed_by_the_error_of_the_estimate_at_that_time(
    begins_s: float, ends_s: float, found: set[str]
) -> None:
    """A barometer's error may end before the mission (campaign, 1690000000016)."""
    record = mission()
    record.called[1] = dataclasses.replace(record.called[1], goals=((4.0, 1.0, 8.0),))
    record.truth = [Located(each.time_s, current_position(each.time_s)) for each in record.truth]
    record.estimate = [
        Located(each.time_s, (x, y, z + (5.0 if begins_s <= each.time_s < ends_s else 0.0)))
        for each in record.truth
        for x, y, z in [each.place]
    ]
    assert rules(record) & {"goal"} == found


def test_a_mission_that_succeeds_without_what_another_station_jumps_over_is_found() -> None:
    record = mission()
    record.orders.append(Order(10.0, "jump"))
    assert rules(record) == set()  # back to what was flown
    record.called[1] = dataclasses.replace(record.called[1], goals=((4.0, 4.0, 3.0), (3.0, 0.0, 3.0)))
    assert rules(record) == {"goal"}


def test_the_judge_imports_nothing_of_the_daemon() -> None:
    imports, todo, seen = re.compile(r"^from tests\.campaign\.(\w+) import", re.MULTILINE), ["judge"], set()
    while todo:
        seen.add(name := todo.pop())
        text = (Path(__file__).parent / f"{name}.py").read_text()
        assert "ual_daemon" not in text, name
        todo += [found for found in imports.findall(text) if found not in seen]
    assert seen >= {"follows", "services", "words", "bounds", "motion", "evidence", "record"}


def test_what_is_new_can_be_assessed_again_from_its_file() -> None:
    record = mission()
    record.texts.append(Text(1.0, "GPS Glitch"))
    record.healths.append(Text(1.5, "GPS Glitch"))
    record.sent.append(Sent(33.0, "setpoint", None, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3)))
    record.lives.append(Life(34.0, "killed"))
    record.troubles.append(Trouble("stop", TAKEN_S, math.inf))
    assert Record.from_json(record.to_json()) == record


def test_the_plans_of_a_campaign_have_every_failure_and_service() -> None:
    plans = [plan(seed) for seed in range(1000)]
    kinds = {fault.kind for each in plans for fault in each.faults}
    assert kinds >= {"motor_off", "motor_weak", "stop", "disarmed", "held", "wind", "gps_jam", "gps_jump", "compass"}
    assert kinds >= {"barometer", "accelerometer", "station_upload", "station_clear", "station_jump", "cut"}
    assert kinds >= {"station_parameter", "station_reboot"}
    steps = {step.name for each in plans for step in each.steps}
    assert steps >= {"upload", "mission", "parameters", "fence", "logs", "camera"}
    for each in plans:
        names = [step.name for step in each.steps]
        assert all(names[fault.step] == "upload" for fault in each.faults if fault.kind == "cut")


def test_flights_can_be_chosen_by_what_they_have() -> None:
    chosen = [flight for flight in map(plan, range(400)) if has(flight, ("pilot", "go_to"))]
    assert 0 < len(chosen) < 100
    assert all("pilot" in {fault.kind for fault in flight.faults} for flight in chosen)
    assert has(plan(1), ())
