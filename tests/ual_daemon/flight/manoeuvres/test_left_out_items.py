"""Items of a mission that others have jumped over, report by report."""

from __future__ import annotations

import pytest

from tests.snapshots import changed
from tests.ual_daemon.flight.hand_made import Autopilot
from ual.missions import HoldTime, Item, Jump, Waypoint
from ual.missions.plan import MissionStage
from ual.types import GeoPoint
from ual_daemon.backends.offers.missions import MissionReport
from ual_daemon.flight.manoeuvres.left_out_items import LeftOutItems
from ual_daemon.geodesy import FlatProjection

DEG_PER_M = 1.0 / 111_319.0
HOME = GeoPoint(47.0, 8.0, 0.0)


def path(*norths_m: float) -> list[Item]:
    return [Waypoint(47.0 + north_m * DEG_PER_M, 8.0, 5.0) for north_m in norths_m]


def reported(
    left_out: LeftOutItems, *items: int, every_s: float = 0.5, reached: int | None = None, at_m: float | None = None
) -> tuple[int, ...]:
    """Reports follow each other from time 0 on, or after the last one. `at_m` is where it is north of the first place;
    None: that is not known.
    """
    here = None if at_m is None else GeoPoint(47.0 + at_m * DEG_PER_M, 8.0, 5.0)
    snapshot = changed(Autopilot(z=5.0).snapshot(), position_geo=here, home_geo=HOME, home_altitude_amsl_m=0.0)
    snapshot = changed(snapshot, projection=FlatProjection(47.0, 8.0, 0.0) if here else None)
    begin_s = 0.0 if left_out._told is None else left_out._told[1]
    for number, item in enumerate(items, 1):
        time_s = begin_s + number * every_s
        left_out.step(MissionReport(MissionStage.ACTIVE, item, reached, time_s), snapshot)
    return left_out.numbers


FIVE = path(0, 10, 20, 30, 40)


@pytest.mark.parametrize(
    ("items", "numbers", "expected"),
    [
        (FIVE, (1, 1, 2, 3, 4, 5), ()),
        (FIVE, (1, 4, 5), (2, 3)),
        (FIVE, (1, 4, 2, 3, 4), ()),  # it comes back to them
        (FIVE, (3, 1, 2, 3), ()),
        (FIVE, (4, 5, 6), ()),  # ArduPilot tells one more at its end
        (path(0, 10, 12, 30), (1, 2, 4), ()),  # the third is reached together with the second
        ([*path(0, 10), HoldTime(1.0), *path(30)], (1, 2, 4), ()),
        ([*FIVE, Jump(1, 2)], (1, 4, 5), ()),  # the mission jumps by itself
    ],
)
def test_items_that_are_never_reported_were_jumped_over(
    items: list[Item], numbers: tuple[int, ...], expected: tuple[int, ...]
) -> None:
    assert reported(LeftOutItems(items), *numbers) == expected


@pytest.mark.parametrize(("at_m", "expected"), [(6.0, (2,)), (8.0, ()), (None, ())])
def test_an_item_that_is_left_far_from_its_position_was_jumped_over(
    at_m: float | None, expected: tuple[int, ...]
) -> None:
    """Campaign, 11200006: a jump from the first item to the second, 3.6 m beside it."""
    left_out = LeftOutItems(FIVE)
    reported(left_out, 1, at_m=0.0)
    reported(left_out, 2, 2, at_m=2.0)
    reported(left_out, 2, at_m=at_m)
    reported(left_out, 2, at_m=2.0)
    assert reported(left_out, 3, at_m=2.0) == expected
    assert reported(left_out, 3, at_m=2.0, reached=2) == ()


def test_two_jumps_of_ours_in_a_row_leave_nothing_out() -> None:
    """The first one was taken for another station's."""
    left_out = LeftOutItems(FIVE)
    reported(left_out, 1, 1, at_m=0.0)
    left_out.jumps_to(3)
    left_out.jumps_to(5)
    assert reported(left_out, 3, at_m=2.0) == ()
    assert reported(left_out, 5, at_m=4.0) == ()


def test_a_jump_of_ours_of_which_only_the_next_one_is_reported_excuses_no_other() -> None:
    left_out = LeftOutItems(FIVE)
    reported(left_out, 1, 1, at_m=0.0)
    left_out.jumps_to(4)
    left_out.jumps_to(2)
    assert reported(left_out, 2, at_m=2.0) == ()
    assert reported(left_out, 4, at_m=4.0) == (2, 3)


def test_a_jump_from_the_first_item_is_found() -> None:
    left_out = LeftOutItems(path(10, 20, 30))
    left_out.forget()  # it was not flown yet
    reported(left_out, 1, 1, at_m=0.0)
    assert reported(left_out, 2, at_m=2.0) == (1,)


def test_what_was_reached_was_executed() -> None:
    left_out = LeftOutItems(FIVE)
    reported(left_out, 1)
    assert reported(left_out, 3, reached=2) == ()


def test_what_was_not_received_is_not_known() -> None:
    assert reported(LeftOutItems(FIVE), 1, 4, every_s=2.0) == ()
    left_out = LeftOutItems(FIVE)
    reported(left_out, 1)
    left_out.forget()
    assert reported(left_out, 4) == ()


def test_what_ual_has_jumped_over_is_left_out_on_purpose() -> None:
    left_out = LeftOutItems(FIVE)
    reported(left_out, 1)
    left_out.jumps_to(4)
    assert reported(left_out, 1, 4) == ()
    assert reported(left_out, 2, 5) == (3, 4)  # a jump of others since
