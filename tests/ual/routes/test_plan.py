"""QGroundControl's plans: whose fields they are, surveys, and what older versions wrote."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.ual.routes.missions import ARDUPILOT, PX4, do, item, plan, waypoint
from ual import routes
from ual.routes import RouteError
from ual.types import GeoWaypoint

DATA = Path(__file__).parents[2] / "data" / "routes"


def survey(*items: dict[str, Any], kind: str = "survey") -> dict[str, Any]:
    return {
        "type": "ComplexItem",
        "complexItemType": kind,
        "TransectStyleComplexItem": {"Items": list(items), "VisualTransectPoints": [[1, 2]]},
    }


@pytest.mark.parametrize("kind", ["survey", "CorridorScan"])
def test_a_survey_is_executed_as_its_items(kind: str) -> None:
    lines = survey(waypoint(1, 2, 30), item(206, [5, 0, 1, 0, 0, 0, 0]), waypoint(1, 3, 30), kind=kind)
    route = routes.parse_plan(plan(lines), "m.plan")
    assert route.waypoints == [GeoWaypoint(1.0, 2.0, 30.0), GeoWaypoint(1.0, 3.0, 30.0)]
    assert route.leg_speeds_m_s == []
    assert route.left_out == ["item 1.2: camera and gimbal"]
    assert len(routes.read(DATA / "survey.plan").waypoints) == 3


def test_what_cannot_be_executed_of_a_survey_is_refused_by_its_number() -> None:
    with pytest.raises(RouteError, match=r"m.plan, item 2.3: .*MAV_FRAME 10"):
        routes.parse_plan(plan(waypoint(), survey(waypoint(1, 2), do(206, 5), waypoint(1, 3, frame=10))), "m.plan")


def test_a_jump_over_a_survey_finds_its_item() -> None:
    lines = survey(waypoint(1, 2, doJumpId=2), waypoint(1, 3, doJumpId=3))
    items = [waypoint(1, 1, doJumpId=1), lines, waypoint(1, 4, doJumpId=4), {**do(177, 4, 1), "doJumpId": 5}]
    items.append(waypoint(1, 5, doJumpId=6))
    found = routes.parse_plan(plan(*items), "m.plan").waypoints
    assert [each.longitude_deg for each in found if isinstance(each, GeoWaypoint)] == [1, 2, 3, 4, 5]
    items[3] = {**do(177, 3, 1), "doJumpId": 5}
    found = routes.parse_plan(plan(*items), "m.plan").waypoints
    assert [each.longitude_deg for each in found if isinstance(each, GeoWaypoint)] == [1, 2, 3, 4, 3, 4, 5]


def test_a_fence_in_the_plan_is_reported_to_be_left_out() -> None:
    fences: list[dict[str, Any]] = [
        {"geoFence": {"polygons": [{"inclusion": True}], "circles": []}},
        {"geoFence": {"polygons": [], "circles": [{}]}},
        {"rallyPoints": {"points": [[47.0, 8.0, 20.0]]}},
    ]
    for more in fences:
        (left_out,) = routes.parse_plan(plan(waypoint(1, 2, 3), **more), "m.plan").left_out
        assert "geofence" in left_out
    assert not routes.parse_plan(plan(waypoint(1, 2, 3), geoFence=[], rallyPoints=3), "m.plan").left_out


def test_a_mission_of_an_old_version_is_read() -> None:
    assert routes.read(DATA / "oldmission.plan").waypoints == [GeoWaypoint(37.4117, -6.0013, 25.0)]  # of 2016
    old = {"type": "SimpleItem", "command": 16, "frame": 3, "params": [2, 0, 0, 0], "coordinate": [47.1, 8.1, 20]}
    in_plan = routes.parse_plan(plan(old, firmware=ARDUPILOT), "m.plan")  # of 2017
    alone = {"version": 2, "firmwareType": 3, "items": [old]}
    assert in_plan.waypoints == [GeoWaypoint(47.1, 8.1, 20.0)]
    assert in_plan.holds_s == [2.0]
    assert routes.parse(json.dumps(alone).encode(), "old.mission") == in_plan
    with pytest.raises(RouteError, match="survey of an old QGroundControl: open the file in a current one"):
        routes.parse_plan(json.dumps({"MAV_AUTOPILOT": 3, "items": [old], "complexItems": [{}]}), "old.mission")


@pytest.mark.parametrize(("vehicle", "what"), [(10, "rover"), (11, "boat"), (12, "submarine")])
def test_a_plan_for_what_does_not_fly_is_refused(vehicle: int, what: str) -> None:
    with pytest.raises(RouteError, match=f"is a plan for a {what}"):
        routes.parse_plan(plan(waypoint(), vehicle=vehicle), "m.plan")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "not a plan of QGroundControl"),
        ("[1]", "not a plan of QGroundControl"),
        ("not json", "not a plan of QGroundControl"),
        ("[" * 100_000, "not a plan of QGroundControl"),
        ('{"fileType": "Plan", "mission": {"items": 3}}', "not a plan of QGroundControl"),
        ('{"fileType": "Plan", "mission": [1]}', "not a plan of QGroundControl"),
        ('{"fileType": "Plan", "mission": {"items": [3]}}', "item 1: is not in QGroundControl's format"),
        (plan(), "no waypoints"),
        (plan(item(22, [0, 0, 0, None, 47.1, 8.1, 10])), "no waypoints"),
        (plan({"type": "ComplexItem", "complexItemType": "StructureScan"}), "item 1: UAL cannot fly a 'StructureScan'"),
        (plan({"type": "ComplexItem", "complexItemType": "vtolLandingPattern"}), "item 1: .*'vtolLandingPattern'"),
        (plan(survey()), "item 1: UAL cannot fly a 'survey' item"),
        (plan(rallyPoints=3, geoFence=[1]), "no waypoints"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_what_is_no_plan_is_refused(text: str, message: str) -> None:
    with pytest.raises(RouteError, match=message):
        routes.parse_plan(text, "m.plan")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nanliteral.plan", "item 1: parameter 4 is NaN, which JSON does not have"),
        ("null_latlon.plan", "item 2: it has no position"),
        ("terrain.plan", "item 1: .*above the terrain"),
        ("struct.plan", "item 1: UAL cannot fly a 'StructureScan' item"),
        ("vtol.plan", r"item 1: UAL cannot fly a VTOL's take-off.*84"),
        ("roi.plan", r"item 2: UAL cannot fly a region of interest.*195"),
    ],
)
def test_a_file_that_cannot_be_executed_is_refused_with_its_item(name: str, message: str) -> None:
    with pytest.raises(RouteError, match=f"{name}, {message}"):
        routes.read(DATA / name)


def test_a_plan_of_ardupilot_turns_the_nose_nowhere() -> None:
    for firmware, expected in ((ARDUPILOT, [None, None]), (PX4, [pytest.approx(1.5708, abs=1e-4)] * 2)):
        text = (DATA / "apm_yaw0.plan").read_text().replace('"firmwareType": 3', f'"firmwareType": {firmware}')
        found = routes.parse(text.encode(), "m.plan").waypoints
        assert [each.yaw_rad for each in found if isinstance(each, GeoWaypoint)] == expected
