"""Which items of a mission others have jumped over, report by report."""

from __future__ import annotations

import pytest

from ual.missions import HoldTime, Item, Jump, Waypoint
from ual.missions.plan import MissionStage
from ual_daemon.backends.offers.missions import MissionReport
from ual_daemon.flight.manoeuvres.left_out_items import LeftOutItems

DEG_PER_M = 1.0 / 111_319.0


def way(*norths_m: float) -> list[Item]:
    return [Waypoint(47.0 + north_m * DEG_PER_M, 8.0, 5.0) for north_m in norths_m]


def told(left_out: LeftOutItems, *items: int, every_s: float = 0.5, reached: int | None = None) -> tuple[int, ...]:
    """Reports follow each other from time 0 on, or after the last one."""
    begin_s = 0.0 if left_out._told is None else left_out._told[1]
    for number, item in enumerate(items, 1):
        time_s = begin_s + number * every_s
        left_out.on_report(MissionReport(MissionStage.ACTIVE, item, reached, time_s))
    return left_out.numbers


FIVE = way(0, 10, 20, 30, 40)


@pytest.mark.parametrize(
    ("items", "numbers", "expected"),
    [
        (FIVE, (1, 1, 2, 3, 4, 5), ()),
        (FIVE, (1, 4, 5), (2, 3)),
        (FIVE, (1, 4, 2, 3, 4), ()),  # it comes back to them
        (FIVE, (3, 1, 2, 3), ()),
        (way(0, 10, 12, 30), (1, 2, 4), ()),  # the third is reached together with the second
        ([*way(0, 10), HoldTime(1.0), *way(30)], (1, 2, 4), ()),
        ([*FIVE, Jump(1, 2)], (1, 4, 5), ()),  # the mission jumps by itself
    ],
)
def test_items_that_are_never_told_were_jumped_over(
    items: list[Item], numbers: tuple[int, ...], expected: tuple[int, ...]
) -> None:
    assert told(LeftOutItems(items), *numbers) == expected


def test_what_was_reached_was_flown() -> None:
    left_out = LeftOutItems(FIVE)
    told(left_out, 1)
    assert told(left_out, 3, reached=2) == ()


def test_what_was_not_heard_is_not_known() -> None:
    assert told(LeftOutItems(FIVE), 1, 4, every_s=2.0) == ()
    left_out = LeftOutItems(FIVE)
    told(left_out, 1)
    left_out.forget()
    assert told(left_out, 4) == ()


def test_what_ual_has_jumped_over_is_left_out_on_purpose() -> None:
    left_out = LeftOutItems(FIVE)
    told(left_out, 1)
    left_out.jumps_to(4)
    assert told(left_out, 1, 4) == ()
    assert told(left_out, 2, 5) == (3, 4)  # a jump of others since
