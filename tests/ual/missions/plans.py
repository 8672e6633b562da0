"""Ten plans in QGroundControl's documented format, and what becomes of each: its items, or the item that is refused."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from tests.ual.routes.missions import ARDUPILOT, PX4, do, item, waypoint

HOME = [47.3977, 8.5456, 488.0]
LAT, LON = HOME[0], HOME[1]


class Example(NamedTuple):
    """A plan; the kinds of its items, or the beginning of its refusal."""

    name: str
    text: str
    kinds: tuple[str, ...] = ()
    refusal: str = ""


def plan(*items: dict[str, Any], firmware: int = PX4) -> str:
    numbered = [{"doJumpId": number, "autoContinue": True, **each} for number, each in enumerate(items, start=1)]
    mission = {
        "version": 2,
        "firmwareType": firmware,
        "vehicleType": 2,
        "cruiseSpeed": 15,
        "hoverSpeed": 5,
        "plannedHomePosition": HOME,
        "items": numbered,
    }
    fence = {"circles": [], "polygons": [], "version": 2}
    rally = {"points": [], "version": 2}
    document = {"fileType": "Plan", "version": 1, "groundStation": "QGroundControl"}
    return json.dumps({**document, "mission": mission, "geoFence": fence, "rallyPoints": rally})


def take_off(altitude_m: float = 20.0) -> dict[str, Any]:
    return item(22, [0, 0, 0, None, LAT, LON, altitude_m])


def at(north: float, east: float, **more: Any) -> dict[str, Any]:
    """A waypoint so many ten-thousandths of a degree away from home."""
    return waypoint(round(LAT + north * 1e-4, 7), round(LON + east * 1e-4, 7), **more)


def survey(*items: dict[str, Any]) -> dict[str, Any]:
    inner = [{"doJumpId": 10 + number, "autoContinue": True, **each} for number, each in enumerate(items)]
    return {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "version": 5,
        "TransectStyleComplexItem": {"version": 2, "Items": inner},
    }


_RTL = item(20, [0] * 7, frame=2)
_LAND = item(21, [0, 0, 0, None, LAT, LON, 0])
_STRIP = [each for row in range(6) for each in (at(row, 0.0), do(206, 10, 0, 1, 0), at(row, 8.0), do(206, 0, 0, 1, 0))]
TEN = (
    Example("box", plan(take_off(), at(3, 0), at(3, 3), at(0, 3), _LAND), ("TakeOff", *["Waypoint"] * 3, "Land")),
    Example("amsl", plan(take_off(), at(3, 0, frame=0, alt=520.0), _RTL), ("TakeOff", "Waypoint", "ReturnToLaunch")),
    Example(
        "survey",
        plan(take_off(), survey(*_STRIP), _RTL),
        ("TakeOff", *("Waypoint", "CameraTrigger") * 12, "ReturnToLaunch"),
    ),
    Example(
        "hover and capture",
        plan(take_off(), survey(at(1, 1, hold=2.0), do(2000, 0, 0, 1, None), at(1, 2, hold=2.0)), _RTL),
        ("TakeOff", "Waypoint", "CameraTrigger", "Waypoint", "ReturnToLaunch"),
    ),
    Example(
        "speeds and a hold",
        plan(take_off(), do(178, 1, 3.5, -1, 0), at(3, 0), do(93, 5), at(0, 0), _RTL),
        ("TakeOff", "Speed", "Waypoint", "HoldTime", "Waypoint", "ReturnToLaunch"),
    ),
    Example(
        "a region of interest",
        plan(take_off(), item(195, [0, 0, 0, 0, round(LAT + 1e-4, 7), LON, 0]), at(3, 0), at(3, 3), do(197), _RTL),
        ("TakeOff", "RegionOfInterest", "Waypoint", "Waypoint", "RegionOfInterestEnd", "ReturnToLaunch"),
    ),
    Example(
        "a jump",
        plan(take_off(), at(3, 0), at(3, 3), do(177, 2, 2), _RTL, firmware=ARDUPILOT),
        ("TakeOff", "Waypoint", "Waypoint", "Jump", "ReturnToLaunch"),
    ),
    Example("terrain", plan(take_off(), at(3, 0, frame=10)), refusal="item 2: its position is in MAV_FRAME 10"),
    Example(
        "a gimbal",
        plan(take_off(), do(205, -90, 0, 0, 0), at(3, 0)),
        refusal="item 2: it has camera and gimbal, which a mission of UAL has not (MAVLink command 205)",
    ),
    Example(
        "a survey with circles",
        plan(take_off(), survey(at(3, 0), item(18, [2, 0, 10, 0, LAT, LON, 20]))),
        refusal="item 2.2: it has circles (loiter turns)",
    ),
)
