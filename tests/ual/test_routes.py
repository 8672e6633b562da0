"""Routes from files: what is read of them, what is said to be left out, and what is refused."""

from __future__ import annotations

import contextlib
import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual import routes
from ual.geometry import PoseStamped
from ual.routes import RouteError
from ual.types import AltitudeReference, GeoWaypoint

HOME, AMSL = AltitudeReference.HOME, AltitudeReference.AMSL


def item(command: float, params: list[float | None], frame: int = 3) -> dict[str, Any]:
    return {"type": "SimpleItem", "command": command, "frame": frame, "params": params, "doJumpId": 1}


def waypoint(lat: float, lon: float, alt: float, *, yaw: float | None = None, hold: float = 0.0, frame: int = 3) -> Any:
    return item(16, [hold, 0, 0, yaw, lat, lon, alt], frame)


def plan(*items: dict[str, Any], **more: Any) -> str:
    mission = {"items": list(items), "hoverSpeed": 5, "plannedHomePosition": [47.4, 8.5, 490]}
    return json.dumps({"fileType": "Plan", "version": 1, "mission": mission, **more})


def kml(line: str) -> str:
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document><name>r</name><Placemark>{line}</Placemark></Document></kml>"""


# --- QGroundControl ---------------------------------------------------------------------------------------------------


def test_a_plan_gives_its_waypoints_with_altitudes_headings_and_speeds() -> None:
    route = routes.parse_plan(
        plan(
            item(22, [0, 0, 0, None, 47.1, 8.1, 10]),
            waypoint(47.1, 8.1, 20, yaw=0.0),
            item(178, [1, 4.5, -1, 0, 0, 0, 0]),
            waypoint(47.2, 8.2, 500, yaw=90.0, frame=0),
            item(2000, [0, 0, 1, 0, 0, 0, 0]),
            waypoint(47.3, 8.3, 30, hold=3.0),
            item(20, [0, 0, 0, 0, 0, 0, 0]),
            item(178, [2, 9.0, -1, 0, 0, 0, 0]),
            waypoint(47.4, 8.4, 30),
        ),
        "m.plan",
    )
    assert route.waypoints == [
        GeoWaypoint(47.1, 8.1, 20.0, HOME, math.pi / 2),
        GeoWaypoint(47.2, 8.2, 500.0, AMSL, 0.0),
        GeoWaypoint(47.3, 8.3, 30.0, HOME),
        GeoWaypoint(47.4, 8.4, 30.0, HOME),
    ]
    assert route.leg_speeds_m_s == [0.0, 4.5, 4.5, 4.5]
    assert route.holds_s == [0.0, 0.0, 3.0, 0.0]
    assert route.left_out == [
        "item 1: take-off",
        "item 5: MAVLink command 2000",
        "item 7: return to launch",
        "item 8: MAVLink command 178",
    ]


def test_a_survey_is_flown_as_its_items() -> None:
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {
            "Items": [waypoint(1, 2, 30), item(206, [5, 0, 1, 0, 0, 0, 0]), waypoint(1, 3, 30)]
        },
    }
    route = routes.parse_plan(plan(survey), "m.plan")
    assert route.waypoints == [GeoWaypoint(1.0, 2.0, 30.0), GeoWaypoint(1.0, 3.0, 30.0)]
    assert route.leg_speeds_m_s == []
    assert route.left_out == ["item 1, part 2: MAVLink command 206"]


def test_a_fence_in_the_plan_is_said_to_be_left_out() -> None:
    route = routes.parse_plan(
        plan(waypoint(1, 2, 3), geoFence={"polygons": [{"inclusion": True}], "circles": []}), "m.plan"
    )
    assert "geofence" in route.left_out[0]
    assert not routes.parse_plan(plan(waypoint(1, 2, 3), geoFence=[], rallyPoints=3), "m.plan").left_out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{}", "not a plan of QGroundControl"),
        ("[1]", "not a plan of QGroundControl"),
        ("not json", "not a plan of QGroundControl"),
        (plan(), "no waypoints"),
        (plan(item(22, [0, 0, 0, None, 47.1, 8.1, 10])), "no waypoints"),
        (plan(waypoint(1, 2, 3), waypoint(1, 2, 3, frame=10)), "item 2.*MAV_FRAME 10"),
        (plan(item(17, [0, 0, 0, 0, 1, 2, 3])), "item 1.*MAVLink command 17"),
        (plan({"type": "ComplexItem", "complexItemType": "StructureScan"}), "item 1.*StructureScan"),
        (plan(item(math.inf, [0, 0, 0, None, 1, 2, 3])), "item 1: is not in QGroundControl's format"),
        (plan(item(178, [math.inf, 3, 0, 0, 0, 0, 0])), "item 1: is not in QGroundControl's format"),
        (plan(rallyPoints=3, geoFence=[1]), "no waypoints"),
        (plan(item(16, [0, 0])), "item 1: is not in QGroundControl's format"),
        (plan(item(16, [0, 0, 0, None, None, 2, 3])), "item 1: is not in QGroundControl's format"),
    ],
)
def test_a_plan_that_cannot_be_flown_is_refused_with_its_item(text: str, message: str) -> None:
    with pytest.raises(RouteError, match=message):
        routes.parse_plan(text, "m.plan")


@given(
    st.text(max_size=200)
    | st.builds(json.dumps, st.recursive(st.none() | st.floats() | st.text(), st.lists, max_leaves=9))
)
def test_whatever_a_file_holds_only_a_route_error_comes_out(text: str) -> None:
    for parse in (routes.parse_plan, routes.parse_kml, routes.parse_lines):
        with contextlib.suppress(RouteError):
            parse(text, "file")


# --- KML --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mode", "reference"), [("absolute", AMSL), ("relativeToGround", HOME)])
def test_a_line_of_kml_gives_its_places(mode: str, reference: AltitudeReference) -> None:
    places = "<coordinates>\n 8.5,47.4,30 8.6,47.5,40\n</coordinates>"
    line = f"<LineString><altitudeMode>{mode}</altitudeMode>{places}</LineString>"
    route = routes.parse_kml(kml(line), "r.kml")
    assert route.waypoints == [GeoWaypoint(47.4, 8.5, 30.0, reference), GeoWaypoint(47.5, 8.6, 40.0, reference)]


def test_a_line_on_the_ground_needs_an_altitude() -> None:
    text = kml("<LineString><coordinates>8.5,47.4 8.6,47.5,0</coordinates></LineString>")
    assert routes.parse_kml(text, "r.kml", 25.0).waypoints == [
        GeoWaypoint(47.4, 8.5, 25.0),
        GeoWaypoint(47.5, 8.6, 25.0),
    ]
    with pytest.raises(RouteError, match="give an altitude above home"):
        routes.parse_kml(text, "r.kml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<kml>", "not valid XML"),
        (kml("<Point/>"), "0 lines"),
        (kml("<LineString/>" * 2), "2 lines"),
        (kml("<LineString><altitudeMode>absolute</altitudeMode></LineString>"), "no coordinates"),
        (
            kml("<LineString><altitudeMode>absolute</altitudeMode><coordinates>8,47</coordinates></LineString>"),
            "place 1: '8,47' is not",
        ),
        ('<!DOCTYPE k [<!ENTITY a "b">]><kml>&a;</kml>', "document type"),
    ],
)
def test_kml_that_is_no_route_is_refused(text: str, message: str) -> None:
    with pytest.raises(RouteError, match=message):
        routes.parse_kml(text, "r.kml", None)


# --- Files ------------------------------------------------------------------------------------------------------------


def test_the_ending_tells_what_a_file_is(tmp_path: Path) -> None:
    files = {
        "m.PLAN": plan(waypoint(1, 2, 3)),
        "r.kml": kml("<LineString><coordinates>2,1</coordinates></LineString>"),
        "w.jsonl": '{"x": 1, "y": 2, "z": 3}\n4,5,6,90deg # the corner\n',
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    assert routes.read(tmp_path / "m.PLAN").waypoints == [GeoWaypoint(1.0, 2.0, 3.0)]
    assert routes.read(tmp_path / "r.kml", altitude_m=7.0).waypoints == [GeoWaypoint(1.0, 2.0, 7.0)]
    lines = routes.read(tmp_path / "w.jsonl", frame_id="map").waypoints
    assert [each.frame_id for each in lines if isinstance(each, PoseStamped)] == ["map", "map"]


def test_waypoints_one_a_line_may_hold() -> None:
    lines = '0,0,3\n{"x": 1, "y": 0, "z": 3, "hold_s": 2.5}\n'
    assert routes.parse_list(lines, "points").holds_s == [0.0, 2.5]
    assert routes.parse_list("0,0,3\n", "points").holds_s == ()
    assert len(routes.parse_lines(lines, "points")) == 2
    with pytest.raises(RouteError, match="line 1"):
        routes.parse_list('{"x": 1, "y": 0, "z": 3, "hold_s": "long"}', "points")


def test_a_file_that_cannot_be_read_is_refused_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "binary.plan").write_bytes(b"\xff\xfe\x00")
    for name, message in (("none.plan", "cannot read .*none.plan"), ("binary.plan", "binary.plan is not a text file")):
        with pytest.raises(RouteError, match=message):
            routes.read(tmp_path / name)


def test_a_heading_of_90_radians_in_a_file_is_refused_with_a_hint() -> None:
    with pytest.raises(routes.RouteError, match=r"points, line 2: 90 radians are more than a full turn: 90deg\?"):
        routes.parse_lines("0,0,3,1.5\n1,0,3,90\n", "points")
