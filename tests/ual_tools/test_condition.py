"""Problems of a UAV, by urgency, in words."""

from __future__ import annotations

import dataclasses

import pytest

from ual.errors import DaemonUnreachableError
from ual.types import Battery, Health, State, Telemetry
from ual_tools import condition
from ual_tools.condition import UavCondition, Urgency
from ual_tools.watch_board import WatchedUav

FLYING = Telemetry(State.FLYING_AUTO, "in the air", battery=Battery(80.0, 15.6))


def test_what_is_fine_has_no_words() -> None:
    assert condition.of_telemetry(FLYING) == UavCondition(Urgency.FINE, "FLYING_AUTO")


@pytest.mark.parametrize(
    ("battery", "level", "text"),
    [
        (None, Urgency.FINE, ""),
        (Battery(), Urgency.FINE, ""),
        (Battery(None, 11.1), Urgency.FINE, "11.1 V"),
        (Battery(30.1, 14.0), Urgency.FINE, "30 %"),
        (Battery(30.0, 14.0), Urgency.WARNING, "30 % LOW"),
        (Battery(15.1, 14.0), Urgency.WARNING, "15 % LOW"),
        (Battery(15.0, 14.0), Urgency.ALARM, "15 % CRITICAL"),
        (Battery(0.0, None), Urgency.ALARM, "0 % CRITICAL"),
    ],
)
def test_a_battery_is_low_and_critical_in_words(battery: Battery | None, level: Urgency, text: str) -> None:
    assert condition.battery_text(battery) == text
    how = condition.of_telemetry(dataclasses.replace(FLYING, battery=battery))
    assert how.level is level
    assert how.text == ("" if level is Urgency.FINE else f"battery {text}")
    assert how.note == ""


def test_of_several_batteries_each_is_reported() -> None:
    full, low = Battery(90.0, id=0, function="all"), Battery(20.0, id=1)
    one = dataclasses.replace(FLYING, battery=full, batteries=(full,))
    assert condition.batteries_text(one) == "90 %"
    several = dataclasses.replace(FLYING, battery=low, batteries=(full, low, Battery(id=2, function="payload")))
    assert condition.batteries_text(several) == "20 % LOW (0 all 90 %, 1 20 % LOW, 2 payload ?)"


@pytest.mark.parametrize(
    ("changes", "level", "words"),
    [
        ({"health": Health(failsafe="rc failsafe")}, Urgency.ALARM, "failsafe: rc failsafe"),
        ({"frame_lost": "it rebooted"}, Urgency.ALARM, "frame lost: it rebooted"),
        ({"state": State.UNINITIALIZED, "state_reason": "no pose"}, Urgency.ALARM, "no pose"),
        (
            {"health": Health(failing_checks=("gps", "autopilot: EKF variance"))},
            Urgency.WARNING,
            "autopilot: EKF variance",
        ),
        (
            {"state": State.LANDED_DISARMED, "health": Health(False, ("gps", "autopilot: EKF variance"))},
            Urgency.WARNING,
            "autopilot: EKF variance; not ready to arm: gps",
        ),
        ({"health": Health(link_quality=0.79)}, Urgency.WARNING, "weak link: 79 % arrives"),
        ({"health": Health(link_quality=0.8)}, Urgency.FINE, ""),
        ({"state": State.FLYING_MANUAL}, Urgency.WARNING, "in the air"),
        (
            {"state": State.FLYING_MANUAL, "health": Health(held_by="safety pilot")},
            Urgency.WARNING,
            "held by safety pilot",
        ),
        (
            {"state": State.LANDED_DISARMED, "health": Health(False, ("compass", "GPS"))},
            Urgency.WARNING,
            "not ready to arm: compass, GPS",
        ),
        ({"state": State.LANDED_ARMED, "health": Health(False)}, Urgency.FINE, ""),
        (
            {"health": Health(failsafe="fence", link_quality=0.5), "battery": Battery(9.0)},
            Urgency.ALARM,
            "failsafe: fence; battery 9 % CRITICAL; weak link: 50 % arrives",
        ),
    ],
)
def test_each_trouble_has_its_urgency_and_words(changes: dict[str, object], level: Urgency, words: str) -> None:
    how = condition.of_telemetry(dataclasses.replace(FLYING, **changes))  # type: ignore[arg-type]  # of several kinds
    assert (how.level, how.text) == (level, words)


def test_what_is_not_the_present_is_lost_however_well_it_was() -> None:
    how = condition.uav_condition(WatchedUav(90.0, FLYING), now_s=100.0, lost_after_s=2.0)
    assert how == UavCondition(Urgency.ALARM, "LOST", *["no telemetry for 10 s, it was FLYING_AUTO"] * 2)
    assert condition.of_answer(DaemonUnreachableError("no\nanswer")) == UavCondition(
        Urgency.ALARM, "DAEMON_UNREACHABLE", "no answer", "no answer"
    )


def test_the_worst_come_first_then_names_and_numbers() -> None:
    found = {
        "uav_10": Urgency.FINE,
        "uav_2": Urgency.FINE,
        "uav_3": Urgency.WARNING,
        "uav_11": Urgency.ALARM,
        "uav_4": Urgency.ALARM,
    }
    how = {ns: UavCondition(level) for ns, level in found.items()}
    assert condition.worst_first(found, how.__getitem__, str) == ["uav_4", "uav_11", "uav_3", "uav_2", "uav_10"]


def test_the_counts_begin_with_what_is_worst() -> None:
    known = [UavCondition(Urgency.FINE, "FLYING_AUTO")] * 3 + [UavCondition(Urgency.FINE, "LANDED_ARMED")] * 5
    assert condition.summary(known) == "5 LANDED_ARMED, 3 FLYING_AUTO"
    known += [UavCondition(Urgency.ALARM, "LOST"), UavCondition(Urgency.WARNING, "FLYING_AUTO"), UavCondition()]
    assert condition.summary(known) == ("1 alarm, 1 warning; 1 LOST, 4 FLYING_AUTO, 5 LANDED_ARMED, 1 not heard yet")
