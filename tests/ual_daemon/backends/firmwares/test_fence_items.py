"""Between the zones and rally points of the contract and the items that an autopilot keeps."""

from __future__ import annotations

import math
from typing import Any

import pytest

from ual.errors import RejectedByAutopilotError
from ual.fences.values import FenceZone, RallyPoint
from ual.types import AltitudeReference
from ual_daemon.backends.firmwares.fence_items import (
    item_of_return_point,
    items_of_rally,
    items_of_zones,
    rally_of_items,
    return_point_of_items,
    zones_of_items,
)
from ual_daemon.backends.firmwares.mission_items import MissionItem

POINT = RallyPoint(47.1, 8.1, 20, AltitudeReference.AMSL)


def test_rally_points_are_read_as_they_were_written() -> None:
    assert rally_of_items(items_of_rally([POINT])) == (POINT,)


@pytest.mark.parametrize(
    "changed",
    [{"x": 900000001}, {"y": -1800000001}, {"z": math.nan}, {"z": math.inf}, {"z": -1e38}],
)
def test_a_rally_point_that_is_nowhere_is_refused(changed: dict[str, Any]) -> None:
    [item] = items_of_rally([POINT])
    with pytest.raises(RejectedByAutopilotError, match="rally points: number 2 has no place on Earth"):
        rally_of_items([item, item._replace(**changed)])


def test_what_is_no_rally_point_is_refused() -> None:
    with pytest.raises(RejectedByAutopilotError, match=r"number 1 is none that UAL knows \(command 16, frame 0\)"):
        rally_of_items([MissionItem(0, 16)])


def test_the_point_to_return_to_is_read_and_is_no_zone() -> None:
    point = item_of_return_point((47.1, 8.1))
    zone = FenceZone(False, ((47.2, 8.2),), 20.0)
    items = [point, *items_of_zones([zone])]
    assert zones_of_items(items) == (zone,)
    assert return_point_of_items(items) == (47.1, 8.1)
    assert return_point_of_items(items[1:]) is None
