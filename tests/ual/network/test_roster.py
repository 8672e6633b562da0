"""Roster of the network: presence, names, forgeries and conflicts, by given times."""

from __future__ import annotations

import pytest

from tests.ual.network.samples import report, source, uav
from ual.network import roster as module
from ual.network.roster import KEEP_GONE_S, Roster
from ual.types import State


class Case:
    """A roster, and what it dropped."""

    def __init__(self) -> None:
        self.dropped: list[str] = []
        self.roster = Roster(lambda _, why: self.dropped.append(why))

    def names(self) -> list[str]:
        return [each.ns for each in self.roster.uavs()]


@pytest.fixture
def case() -> Case:
    return Case()


def test_a_uav_is_there_once_its_daemon_is_present_and_has_reported(case: Case) -> None:
    assert not case.roster.is_complete(10.0)  # on a busy computer nothing may have been heard yet
    case.roster.on_alive(source(), 10.0)
    assert case.names() == []
    assert not case.roster.is_complete(10.0)
    case.roster.on_report(source(), report(), 10.5)
    [found] = case.roster.uavs()
    assert (found.ns, found.publisher, found.addresses, found.heard_s) == ("uav_1", "uav_1", ("10.0.0.1:50051",), 10.5)
    assert (found.gone_s, found.is_contested, found.telemetry.state) == (None, False, State.FLYING_AUTO)
    assert case.roster.is_complete(10.5)
    assert case.dropped == []


def test_a_sample_is_old_after_two_periods_but_not_before_two_seconds(case: Case) -> None:
    case.roster.on_alive(source(), 0.0)
    case.roster.on_report(source(), report(rate_hz=0.5), 10.0)
    [slow] = case.roster.uavs()
    assert [slow.is_old(now_s) for now_s in (13.9, 14.1)] == [False, True]
    case.roster.on_report(source(), report(rate_hz=20.0), 10.0)
    [fast] = case.roster.uavs()
    assert [fast.is_old(now_s) for now_s in (11.9, 12.1)] == [False, True]


def test_what_vanished_is_kept_with_since_when_and_forgotten_later(case: Case) -> None:
    case.roster.on_alive(source(), 0.0)
    case.roster.on_report(source(), report(), 1.0)
    case.roster.on_gone(source(), 2.0)
    case.roster.on_gone(source(), 3.0)
    [gone] = case.roster.uavs()
    assert (gone.gone_s, gone.is_old(2.0)) == (2.0, True)
    case.roster.on_alive(source("uav_2", 2), 2.0 + KEEP_GONE_S - 1.0)
    assert case.names() == ["uav_1"]
    case.roster.on_alive(source("uav_3", 3), 2.0 + KEEP_GONE_S)
    assert case.names() == []


def test_a_daemon_that_was_cut_off_comes_back_as_the_same(case: Case) -> None:
    case.roster.on_alive(source(), 0.0)
    case.roster.on_report(source(), report(), 1.0)
    case.roster.on_gone(source(), 2.0)
    case.roster.on_alive(source(), 62.0)
    case.roster.on_report(source(), report(), 63.0)
    [found] = case.roster.uavs()
    assert (found.gone_s, found.heard_s) == (None, 63.0)


def test_a_sample_under_anothers_name_is_dropped_and_reported(case: Case) -> None:
    for number, publisher in ((1, "uav_1"), (2, "uav_2")):
        case.roster.on_alive(source(publisher, number), 0.0)
        case.roster.on_report(source(publisher, number), report(uav(publisher, f"10.0.0.{number}:1")), 1.0)
    case.roster.on_report(source("uav_2", 2), report(uav("uav_1", "6.6.6.6:1"), uav("uav_2", "10.0.0.2:1")), 2.0)
    assert [(each.ns, each.addresses) for each in case.roster.uavs()] == [
        ("uav_1", ("10.0.0.1:1",)),
        ("uav_2", ("10.0.0.2:1",)),
    ]
    assert case.dropped == ["uav_2 tells of uav_1, for which it may not speak: dropped"]


def test_what_shows_no_sign_of_life_is_not_received(case: Case) -> None:
    case.roster.on_report(source(), report(), 1.0)
    assert case.dropped == []  # its sign of life may be on its way
    assert case.roster.doubtful(1.0)
    case.roster.on_answer(["uav_1"], [], 1.5)
    assert not case.roster.doubtful(1.5)
    assert case.names() == []
    case.roster.on_alive(source(), 2.0)
    case.roster.on_report(source(), report(), 2.0)
    case.roster.on_gone(source(), 3.0)
    case.roster.on_report(source(), report(uav(state=State.LANDING)), 4.0)
    case.roster.on_answer(["uav_1"], [source("uav_2", 2)], 5.0)
    assert [each.telemetry.state for each in case.roster.uavs()] == [State.FLYING_AUTO]
    assert case.dropped == ["uav_1 tells of UAVs, but shows no sign of life: dropped"] * 2


def test_a_sign_of_life_that_was_lost_is_requested(case: Case) -> None:
    case.roster.on_alive(source(), 0.0)
    case.roster.on_report(source(), report(), 1.0)
    case.roster.on_gone(source(), 2.0)
    case.roster.on_report(source(), report(), 4.0)
    case.roster.on_answer(["uav_1"], [source()], 4.5)
    case.roster.on_report(source(), report(), 5.0)
    [found] = case.roster.uavs()
    assert (found.gone_s, found.heard_s, case.dropped) == (None, 5.0, [])


def test_one_that_is_silent_and_not_there_when_it_is_requested_is_gone(case: Case) -> None:
    for name, instance, heard_s in (("uav_1", 1, 1.0), ("uav_2", 2, 4.0)):
        case.roster.on_alive(source(name, instance), 0.0)
        case.roster.on_report(source(name, instance), report(uav(name)), heard_s)
    assert not case.roster.doubtful(2.9)
    assert case.roster.doubtful(3.1)
    case.roster.on_answer(["uav_1", "uav_2"], [], 4.5)
    assert [each.gone_s for each in case.roster.uavs()] == [4.5, None]


def test_two_uavs_of_one_name_are_distinguished(case: Case) -> None:
    for instance, host in ((1, "a"), (2, "b")):
        case.roster.on_alive(source(instance=instance), 0.0)
        told = uav(address=f"10.0.0.{instance}:50051")
        case.roster.on_report(source(instance=instance), report(told, host=host, started_s=instance), 1.0)
    found = case.roster.uavs()
    assert [(each.ns, each.is_contested, each.teller.host) for each in found] == [
        ("uav_1", True, "a"),
        ("uav_1", True, "b"),
    ]
    assert case.roster.called("uav_1") == found
    case.roster.on_gone(source(instance=1), 5.0)
    [left] = case.roster.uavs()
    assert (left.teller.host, left.is_contested) == ("b", False)


def test_a_daemon_that_was_started_again_is_no_conflict(case: Case) -> None:
    """It is killed and started again before the token of the one before has run out."""
    for instance in (1, 2):
        case.roster.on_alive(source(instance=instance), 0.0)
        case.roster.on_report(source(instance=instance), report(started_s=float(instance)), float(instance))
    [found] = case.roster.uavs()
    assert (found.instance, found.is_contested) == (source(instance=2).instance, False)


def test_of_several_that_are_gone_the_last_is_shown(case: Case) -> None:
    for instance, gone_s in ((1, 9.0), (2, 7.0)):
        case.roster.on_alive(source(instance=instance), 0.0)
        case.roster.on_report(source(instance=instance), report(host=str(instance)), 1.0)
        case.roster.on_gone(source(instance=instance), gone_s)
    [found] = case.roster.uavs()
    assert found.teller.host == "1"


def test_a_fleet_is_complete_when_it_has_informed_of_all(case: Case) -> None:
    fleet = source("uav_9-11")
    case.roster.on_alive(fleet, 0.0)
    case.roster.on_report(fleet, report(uav("uav_10"), uav("uav_9"), count=3), 1.0)
    assert not case.roster.is_complete(1.0)
    case.roster.on_report(fleet, report(uav("uav_11"), count=3), 1.0)
    assert case.roster.is_complete(1.0)
    assert (case.roster.pieces(fleet), case.roster.pieces(source("uav_1"))) == (2, None)
    assert case.names() == ["uav_9", "uav_10", "uav_11"]


def test_however_many_say_that_they_are_there_memory_is_limited(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_PUBLISHERS", 3)
    for instance in range(5):
        case.roster.on_alive(source(f"uav_{instance}", instance), 0.0)
    assert case.dropped == [f"more than 3 daemons: uav_{instance} is not shown" for instance in (3, 4)]


def test_one_publisher_takes_no_position_of_others(case: Case) -> None:
    """Its certificate lets it show as many signs of life as it wants."""
    for instance in range(5000):
        case.roster.on_alive(source("uav_2", instance), instance * 1e-3)
    case.roster.on_alive(source(), 5.0)
    case.roster.on_report(source(), report(), 5.0)
    assert case.names() == ["uav_1"]
    assert case.roster.is_complete(5.0)  # those that never tell are not waited for, however many come
    assert set(case.dropped) == {"uav_2 shows more than 8 signs of life: not all are shown"}
    case.roster.on_report(source("uav_2", 4999), report(uav("uav_2")), 5.0)
    assert case.names() == ["uav_1", "uav_2"]


def test_a_daemon_that_is_started_again_and_again_keeps_its_slot(case: Case) -> None:
    for instance in range(50):
        case.roster.on_alive(source(instance=instance), float(instance))
        case.roster.on_report(source(instance=instance), report(host=str(instance), started_s=instance), instance + 0.1)
        case.roster.on_gone(source(instance=instance), instance + 0.5)
        assert [each.teller.host for each in case.roster.uavs()] == [str(instance)]
    assert case.dropped == []


def test_what_tells_nothing_is_named_and_not_waited_for(case: Case) -> None:
    case.roster.on_alive(source(), 0.0)
    case.roster.on_report(source(), report(), 0.5)
    assert case.roster.unseen() == ()
    case.roster.on_alive(source("uav_2", 2), 1.0)
    assert not case.roster.is_complete(2.9)
    assert case.roster.is_known("uav_1", 1.0)  # which another's silence does not keep from flying
    assert not case.roster.is_known("uav_2", 1.0)
    assert case.roster.is_complete(3.1)
    assert case.roster.unseen() == ("uav_2 shows a sign of life, and has not told of all its UAVs",)
    for number in range(3, 12):
        case.roster.on_alive(source(f"uav_{number}", number), 1.0)
    assert case.roster.unseen()[-1] == "so do 5 more"


def test_a_second_daemon_of_a_name_is_waited_for(case: Case) -> None:
    """It may be another UAV of this name, which is then not flown."""
    case.roster.on_alive(source(), 0.0)
    case.roster.on_report(source(), report(), 0.5)
    case.roster.on_alive(source(instance=2), 1.0)
    assert not case.roster.is_known("uav_1", 2.9)
    assert case.roster.is_known("uav_1", 3.1)


def test_what_is_not_received_is_not_there_whatever_its_sign_of_life_says(case: Case) -> None:
    for name, instance, rate_hz in (("uav_1", 1, 1.0), ("uav_2", 2, 0.5)):
        case.roster.on_alive(source(name, instance), 0.0)
        case.roster.on_report(source(name, instance), report(uav(name), rate_hz=rate_hz), 10.0)
    assert not case.roster.update(14.9)
    assert case.roster.update(15.1)
    assert [each.gone_s for each in case.roster.uavs()] == [15.1, None]
    assert not case.roster.update(16.0)
    assert case.roster.update(20.1)
    case.roster.on_report(source("uav_1", 1), report(), 21.0)
    assert [each.gone_s for each in case.roster.uavs()] == [None, 20.1]
    case.roster.on_gone(source("uav_2", 2), 30.0)
    assert [each.gone_s for each in case.roster.uavs()] == [None, 20.1]
