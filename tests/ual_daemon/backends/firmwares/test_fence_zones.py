"""Meaning of a fence's items."""

from __future__ import annotations

import logging
import math

import pytest

from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.autopilot import Autopilot
from ual_daemon.backends.firmwares.fence_reader import FenceReader
from ual_daemon.backends.firmwares.fence_zones import FenceCommand, FenceItem, FoundZones, find_zones
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.values import AutopilotFence, Zone

IN, OUT = FenceCommand.POLYGON_INCLUSION, FenceCommand.POLYGON_EXCLUSION
CIRCLE_IN, CIRCLE_OUT = FenceCommand.CIRCLE_INCLUSION, FenceCommand.CIRCLE_EXCLUSION
CORNERS = ((47.0, 8.0), (47.0, 8.1), (47.1, 8.1), (47.1, 8.0))
INSIDE = Zone("inclusion polygon 1 of 1", True, CORNERS)


def item(command: int, size: float, place: tuple[float, float] = (47.0, 8.0), frame: int = 0) -> FenceItem:
    return FenceItem(command, frame, size, *place)


def polygon(command: int, corners: tuple[tuple[float, float], ...] = CORNERS) -> list[FenceItem]:
    return [item(command, len(corners), corner) for corner in corners]


def test_items_become_zones_with_names_for_people() -> None:
    found = find_zones(
        [
            *polygon(OUT, CORNERS[:3]),
            item(FenceCommand.RETURN_POINT, 0.0),
            item(CIRCLE_IN, 30.5),
            *polygon(OUT),
            item(CIRCLE_OUT, 5.0),
            *polygon(IN),
        ]
    )
    assert found == FoundZones(
        (
            Zone("exclusion polygon 1 of 2", False, CORNERS[:3]),
            Zone("inclusion circle 1 of 1", True, CORNERS[:1], 30.5),
            Zone("exclusion polygon 2 of 2", False, CORNERS),
            Zone("exclusion circle 1 of 1", False, CORNERS[:1], 5.0),
            INSIDE,
        )
    )
    assert find_zones([]) == FoundZones(())


@pytest.mark.parametrize(
    ("items", "why"),
    [
        (polygon(IN)[:3], "the polygon that begins with item 0 has 3 of its 4 corners"),
        ([*polygon(IN)[:2], *polygon(OUT)], "the polygon that begins with item 0 has 2 of its 4 corners"),
        ([item(CIRCLE_OUT, 5.0), *polygon(IN, CORNERS[:2])], "item 1 begins a polygon of 2 corners"),
        ([item(IN, 0.0)], "item 0 begins a polygon of 0 corners"),
        ([item(IN, math.nan)] * 3, "item 0 begins a polygon of nan corners"),
        ([item(IN, 3.5)] * 4, "item 0 begins a polygon of 3.5 corners"),
        ([item(CIRCLE_IN, math.nan)], "inclusion circle 1 of 1 has a radius of nan m"),
        ([item(CIRCLE_OUT, math.inf)], "exclusion circle 1 of 1 has a radius of inf m"),
        ([item(CIRCLE_OUT, 0.0)], "exclusion circle 1 of 1 has a radius of 0 m"),
        ([item(CIRCLE_OUT, 5.0, frame=1)], "item 0 has no place on Earth (frame 1, 47.0000000, 8.0000000)"),
        ([item(CIRCLE_OUT, 5.0, (91.0, 8.0))], "item 0 has no place on Earth (frame 0, 91.0000000, 8.0000000)"),
        ([item(16, 5.0)], "item 0 is command 16, which is none of a fence"),
    ],
)
def test_what_makes_no_fence_is_reported_and_nothing_of_it_counts(items: list[FenceItem], why: str) -> None:
    assert find_zones([item(CIRCLE_OUT, 5.0), *items][1:]) == FoundZones(None, why)


PARAMETERS = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 4.0, "FENCE_TOTAL": 6.0}
FOUND = FoundZones((INSIDE,))


def test_ardupilot_applies_its_zones_only_with_the_bit_of_polygons_and_unites_them_by_an_option() -> None:
    own = ArduCopter().autopilot_fence
    assert own(PARAMETERS, is_enabled=False, found=FOUND) == AutopilotFence(zones=(INSIDE,))
    assert own({**PARAMETERS, "FENCE_TYPE": 3.0}, is_enabled=False, found=FOUND).zones == ()
    assert own({**PARAMETERS, "FENCE_ENABLE": 0.0}, is_enabled=False, found=FOUND).zones == ()
    assert own({**PARAMETERS, "FENCE_ENABLE": 0.0}, is_enabled=True, found=FOUND).zones == (INSIDE,)
    assert own({**PARAMETERS, "FENCE_OPTIONS": 1.0}, is_enabled=False, found=FOUND).unites_inclusions is False
    assert own({**PARAMETERS, "FENCE_OPTIONS": 3.0}, is_enabled=False, found=FOUND).unites_inclusions is True


def test_px4_applies_its_zones_with_an_action_and_never_unites_them() -> None:
    own = Px4().autopilot_fence
    assert own({"GF_ACTION": 2.0}, is_enabled=False, found=FOUND) == AutopilotFence(zones=(INSIDE,))
    assert own({"GF_ACTION": 0.0}, is_enabled=False, found=FOUND).zones == ()


@pytest.mark.parametrize(("autopilot", "parameters"), [(ArduCopter(), PARAMETERS), (Px4(), {"GF_ACTION": 2.0})])
def test_a_malformed_fence_stays_unread_with_the_reason(autopilot: Autopilot, parameters: dict[str, float]) -> None:
    own = autopilot.autopilot_fence(parameters, is_enabled=False, found=FoundZones(None, "item 3 is nothing"))
    assert own.zones == ()
    assert own.unread == "its polygons and circles: item 3 is nothing"
    assert own.is_cut_by_unread


def reported(caplog: pytest.LogCaptureFixture) -> list[tuple[int, object, object]]:
    fields = [vars(each) for each in caplog.records if vars(each).get("ual_event") == "autopilot_fence"]
    return [(each["levelno"], each["ual_fields"]["zones"], each["ual_fields"]["not_read"]) for each in fields]


def test_the_log_waits_for_the_zones_and_says_how_many_there_are(caplog: pytest.LogCaptureFixture) -> None:
    reader = FenceReader(ArduCopter(), PARAMETERS, awaits_zones=True)
    with caplog.at_level(logging.INFO):
        reader.update()
        assert reported(caplog) == []
        reader.set_zones(FOUND)
        reader.set_zones(FOUND)
    assert reported(caplog) == [(logging.INFO, 1, None)]
    assert reader.limits == AutopilotFence(zones=(INSIDE,))


def test_zones_that_do_not_come_are_a_warning_and_those_that_are_known_stay(caplog: pytest.LogCaptureFixture) -> None:
    reader = FenceReader(ArduCopter(), PARAMETERS, awaits_zones=True)
    with caplog.at_level(logging.INFO):
        reader.stop_waiting()
        reader.set_zones(FOUND)
        reader.stop_waiting()
    unread = "its polygons and circles (FENCE_TOTAL 6)"
    assert reported(caplog) == [(logging.WARNING, None, unread), (logging.INFO, 1, None)]
    assert reader.limits is not None
    assert reader.limits.zones == (INSIDE,)
