from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual.errors import InvalidArgumentError, ResourceExhaustedError
from ual.missions import (
    CameraAction,
    CameraTrigger,
    Heading,
    HoldTime,
    Item,
    Jump,
    Land,
    RegionOfInterest,
    ReturnToLaunch,
    Speed,
    TakeOff,
    Waypoint,
    checks,
)
from ual.missions.order import executed
from ual.types import AltitudeReference

A, B, C = (Waypoint(47.0 + i * 1e-3, 8.0, 20.0) for i in range(3))


def refusal(*items: Item) -> InvalidArgumentError:
    with pytest.raises(InvalidArgumentError) as caught:
        checks.require(items)
    return caught.value


@pytest.mark.parametrize(
    ("item", "words"),
    [
        (Waypoint(math.nan, 8.0, 20.0), "latitude_deg: nan is not a finite number"),
        (Waypoint(91.0, 8.0, 20.0), "latitude_deg: 91 is out of range"),
        (Waypoint(0.0, 0.0, 20.0), "latitude 0, longitude 0 is a position that was not set"),
        (Waypoint(47.0, 8.0, math.inf), "altitude_m: inf is not a finite number"),
        (Waypoint(47.0, 8.0, 20.0, AltitudeReference.ELLIPSOID), "above home or above mean sea level"),
        (Waypoint(47.0, 8.0, 20.0, hold_s=-1.0), "hold_s: -1 is out of range"),
        (Waypoint(47.0, 8.0, 20.0, accept_radius_m=0.0), "accept_radius_m: 0 is out of range"),
        (Waypoint(47.0, 8.0, 20.0, yaw_rad=math.nan), "yaw_rad: nan"),
        (TakeOff(0.0), "a take-off has to climb above home"),
        (TakeOff(10.0, AltitudeReference.HOME, 47.0), "only one of latitude and longitude"),
        (HoldTime(0.0), "seconds: 0 is out of range"),
        (Speed(0.0), "speed_m_s: 0 is out of range"),
        (Speed(True), "speed_m_s: True is not a finite number"),
        (Heading(100.0), "yaw_rad: 100 is out of range"),
        (RegionOfInterest(47.0, 181.0, 0.0), "longitude_deg: 181 is out of range"),
        (CameraTrigger(CameraAction.BY_DISTANCE), "value: 0 is out of range"),
        (CameraTrigger(CameraAction.STOP, 1.0), "value: it has one, but needs none"),
        (CameraTrigger(7), "action: 7 is none"),  # type: ignore[arg-type]  # as a caller without types may give
        (Jump(9, 1), "it jumps to item 9, which there is not"),
        (Jump(1, 0), "times: 0 is out of range"),
        (Jump(1.0, 1), "to: 1.0 is not a whole number"),  # type: ignore[arg-type]  # as above
        (Jump(2, 1), "it jumps to item 2 (jump), which does not fly"),
    ],
)
def test_a_value_that_is_none_is_named(item: Item, words: str) -> None:
    error = refusal(*([item, A] if isinstance(item, TakeOff) else [A, item]))
    assert words in error.message
    assert error.metadata["item"] == ("1" if isinstance(item, TakeOff) else "2")


def test_an_item_is_named_by_its_number_in_the_file() -> None:
    error = refusal(A, Speed(-1.0, number="3.2"))
    assert error.message.startswith("item 3.2 (speed): speed_m_s")
    assert error.metadata == {"field": "items[1]", "item": "3.2"}


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ((A, TakeOff(10.0)), "item 2 (take-off): a take-off has to come before all that flies"),
        ((A, Land(47.0, 8.0), B), "item 2 (landing): it ends the mission, but more items follow"),
        ((ReturnToLaunch(), A), "item 1 (return to launch): it ends the mission"),
        ((TakeOff(10.0), A, Jump(1, 1)), "item 3 (jump): it jumps to the take-off"),
        ((), "items: the mission has none"),
        ((Speed(3.0), HoldTime(2.0)), "items: none of them leads to a place"),
        ((A, "B"), "items[1]: 'B' is no item of a mission"),
    ],
)
def test_an_item_in_the_wrong_position_is_refused(items: tuple[Any, ...], words: str) -> None:
    assert refusal(*items).message.startswith(words)


def test_too_many_items_are_refused_and_as_many_as_allowed_are_not() -> None:
    checks.require([A] * checks.MOST_ITEMS)
    with pytest.raises(ResourceExhaustedError, match="1001 are more than the limit of 1000"):
        checks.require([A] * (checks.MOST_ITEMS + 1))


def test_a_jump_is_made_as_often_as_it_says_over_the_whole_mission() -> None:
    assert executed([A, B, Jump(1, 2), C]) == [0, 1, 0, 1, 0, 1, 3]
    assert executed([A, B, Jump(1, 1), C, Jump(2, 1)]) == [0, 1, 0, 1, 3, 1, 3]
    assert executed([A, Jump(3, 1), B], start=2) == [2]


def test_jumps_within_jumps_end() -> None:
    with pytest.raises(ResourceExhaustedError, match="jump fewer times"):
        checks.require([A, B, *[Jump(1, 1000)] * 20])


@given(st.lists(st.sampled_from([A, B, HoldTime(1.0), Jump(1, 3), Jump(2, 1), Jump(3, 2), Speed(2.0)]), max_size=8))
def test_whatever_is_accepted_is_executed_in_a_finite_order(items: list[Item]) -> None:
    try:
        checks.require(items)
    except (InvalidArgumentError, ResourceExhaustedError):
        return
    assert executed(items)
