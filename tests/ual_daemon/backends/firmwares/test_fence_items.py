"""Between the zones and rally points of the contract and the items that an autopilot keeps."""

from __future__ import annotations

import math
from typing import Any

import pytest

from ual.errors import RejectedByAutopilotError
from ual.fences.values import RallyPoint
from ual.types import AltitudeReference
from ual_daemon.backends.firmwares.fence_items import items_of_rally, rally_of_items
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
