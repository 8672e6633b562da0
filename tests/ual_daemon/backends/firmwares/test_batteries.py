"""Several batteries of one vehicle, and the one that its flight depends on."""

from __future__ import annotations

import pytest

from ual.types import Battery
from ual_daemon.backends.firmwares.batteries import BATTERY_SILENCE_S, MOST_BATTERIES, Batteries


def reported(*batteries: Battery) -> Batteries:
    found = Batteries()
    for each in batteries:
        found.on_battery(each, 0.0)
    return found


@pytest.mark.parametrize(
    ("batteries", "decisive"),
    [
        ([], None),
        ([Battery(90.0)], 0),
        ([Battery(90.0), Battery(20.0, id=1)], 1),
        ([Battery(90.0), Battery(20.0, id=1, function="payload")], 0),
        ([Battery(90.0, function="propulsion"), Battery(30.0, id=1, function="avionics")], 1),
        ([Battery(20.0, id=3, function="payload")], 3),
        ([Battery(voltage_v=9.0), Battery(90.0, 16.0, id=1)], 1),
        ([Battery(voltage_v=16.0), Battery(voltage_v=14.0, id=1)], 1),
    ],
)
def test_the_emptiest_that_keeps_it_in_the_air_counts(batteries: list[Battery], decisive: int | None) -> None:
    found = reported(*batteries).decisive()
    assert (None if found is None else found.id) == decisive


def test_they_stand_in_the_order_of_their_ids_with_the_newest_word() -> None:
    found = reported(Battery(50.0, id=2), Battery(60.0, id=0), Battery(40.0, id=2))
    assert found.all == (Battery(60.0, id=0), Battery(40.0, id=2))
    assert found.are_several


def test_one_that_is_not_reported_any_more_is_gone() -> None:
    found = reported(Battery(10.0, id=1))
    found.on_battery(Battery(90.0), BATTERY_SILENCE_S + 0.1)
    assert found.all == (Battery(90.0),)
    assert not found.are_several


def test_no_more_are_kept_than_a_vehicle_can_have() -> None:
    found = reported(*(Battery(50.0, id=i) for i in range(MOST_BATTERIES + 1)))
    assert len(found.all) == MOST_BATTERIES
