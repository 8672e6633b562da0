"""Each field of a line of a route has its effect, or the line is refused with its number."""

from __future__ import annotations

import json
import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual.routes.missions import plan, waypoint, wpl
from ual import routes
from ual.routes import Route, RouteError
from ual.types import AltitudeReference

HOME = (0, 16, 0, 0, 0, 0, 47.0, 8.0, 400)
A, B = (3, 16, 2, 0, 0, 0, 47.1, 8.1, 20), (3, 16, 0, 0, 0, 0, 47.2, 8.25, 20.5)
WPL = wpl(HOME, A, B).replace("\r\n", "\n")
LINE = '{"type": "LineString", "coordinates": [[8.5, 47.4, 30], [8.6, 47.4, 30]]}'
KML = (
    "<kml><Placemark>\n<LineString><altitudeMode>absolute</altitudeMode>{}\n"
    "<coordinates>8.5,47.4,30 8.6,47.4,30</coordinates></LineString></Placemark></kml>"
)


def refusal(text: str, name: str, **how: AltitudeReference) -> str:
    with pytest.raises(RouteError) as caught:
        routes.parse(text.encode(), name, altitude_reference=how.get("reference"))
    return str(caught.value).removeprefix(name)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1;2;3\n1,000;2;3\n", ", line 2: '1,000' may be a decimal comma, or thousands: write it with a point"),
        ("1,000\t2\t3\n", ", line 1: '1,000' may be"),
        ("1,500,000;2;3\n", ", line 1: '1,500,000' may be"),
        ("1.000,5;2;3\n", ", line 1: '1.000,5;2;3' is not a waypoint"),
        ("1,2,3,4,5\n", ", line 1: '1,2,3,4,5' is not a waypoint"),
        ('"1","2","3"\n', """, line 1: '"1","2","3"' is not a waypoint"""),
        ("1,2,3m\n", ", line 1: '1,2,3m' is not a waypoint"),
        ("1,2,3 ; high\n", ", line 1: '1,2,3 ; high' is not a waypoint"),
        ("1,2,nan\n", ", line 1: '1,2,nan' is not a waypoint"),
        ("1,2,0x5\n", ", line 1: '1,2,0x5' is not a waypoint"),
        ('1,2,3\n{"x": 1, "y": 2, "z": 3, "x": 2}\n', ", line 2: 'x' is given twice"),
        ('{"x": 1, "y": 2, "z": 3, "frame_id": 5}\n', ", line 1: frame_id is '5.0', not a text"),
        ('{"x": 1, "y": 2, "z": NaN}\n', ", line 1: z is NaN, which JSON does not have"),
        ('{"x": 1, "y": 2, "z": 3} 4\n', ', line 1: \'{"x": 1, "y": 2, "z": 3} 4\' is not a waypoint'),
    ],
)
def test_a_list_of_waypoints(text: str, message: str) -> None:
    assert refusal(text, "a.csv").startswith(message)


def test_a_comma_is_a_decimal_one_where_the_file_shows_it() -> None:
    found = routes.parse(b"1,000;2;3,5\n12,250;0,125;3\n", "a.csv").waypoints
    assert [(each.pose.position.x, each.pose.position.y, each.pose.position.z) for each in found] == [  # type: ignore[union-attr]  # they are poses
        (1.0, 2.0, 3.5),
        (12.25, 0.125, 3.0),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (WPL.replace("\t1\n", "\t47\n"), ", line 2: '0"),
        (WPL.replace("1\t0\t3\t16\t2", "1\t7\t3\t16\t2"), ", line 3: '1"),
        (WPL.replace("47.1\t8.1", "47\t8").replace("\t20\t", "\t1,000\t"), ", line 3: '1,000' may be"),
        ("\n\n" + WPL.replace("8.25", "8.25N"), ", line 6: '8.25N' is not a decimal number"),
        (WPL.replace("8.25", "8,25"), ", line 4: '8,25' is not a decimal number"),
        (WPL.replace("20.5\t1", "20.5\t1 # high"), ", line 4: '2"),
    ],
)
def test_a_waypoint_file(text: str, message: str) -> None:
    assert refusal(text, "a.waypoints").startswith(message)


@pytest.mark.parametrize(
    ("text", "name", "message"),
    [
        (LINE.replace('"type"', '"type": "Point",\n"type"'), "a.geojson", ", line 2: 'type' is given twice"),
        (LINE.removesuffix("}"), "a.geojson", " is not GeoJSON: no JSON in line 1: Expecting"),
        (LINE.replace("LineString", "Linestring"), "a.geojson", " is not GeoJSON"),
        (json.dumps({"type": "Feature", "geometry": {"type": "linestring"}}), "a.geojson", " has a shape of the type"),
        (json.dumps({"type": "FeatureCollection", "features": {}}), "a.geojson", " has '{}' instead of a list"),
        (
            plan(waypoint()).replace('"params": [', '\n"params": [], "params": ['),
            "a.plan",
            ", line 2: 'params' is given",
        ),
        (plan(waypoint())[:-1], "a.plan", " is not a plan of QGroundControl: no JSON in line 1"),
        (plan(waypoint(AltitudeMode=2)), "a.plan", ", item 1: its AltitudeMode is 2, but its frame 3"),
        (plan(waypoint(AltitudeMode=1, Altitude=35)), "a.plan", ", item 1: its Altitude is 35, but its parameter 7 20"),
        (KML.format("<altitudeOffset>5</altitudeOffset>"), "a.kml", " has a line with an altitudeOffset of '5'"),
        (
            KML.format("<altitudeMode>clampToGround</altitudeMode>"),
            "a.kml",
            ", line 2: has a line with 2 different alti",
        ),
        (KML.format("<coordinates>1,2,3</coordinates>"), "a.kml", ", line 2: has a line with 2 different coordinates"),
        (KML.format("").replace("8.6,47.4,30", "8,6,47,4,30"), "a.kml", ", place 2: '8,6,47,4,30' is not LONGITUDE"),
        (KML.format("").replace("8.6,47.4,30", "8.6;47.4;30"), "a.kml", ", place 2: '8.6;47.4;30' is not LONGITUDE"),
        ('<gpx><rte><rtept lat="47,4" lon="8"/></rte></gpx>', "a.gpx", ", line 1: its latitude (lat) '47,4' is not"),
        (
            '<gpx><rte><rtept lat="1" lon="8"><ele>1</ele><ele>2</ele></rtept></rte></gpx>',
            "a.gpx",
            ", line 1: it has more",
        ),
    ],
)
def test_a_document(text: str, name: str, message: str) -> None:
    assert refusal(text, name).startswith(message)


def test_what_follows_the_altitude_of_geojson_is_named() -> None:
    found = routes.parse(LINE.replace("30]", "30, 7]").encode(), "a.geojson", altitude_reference=AltitudeReference.AMSL)
    assert found.left_out == ["what follows the altitude in a position"]


def same(one: Route, other: Route) -> bool:
    """Returns whether two routes fly the same; a sign may be lost."""
    return repr(one).replace("-", "") == repr(other).replace("-", "")


TABLES = {"a.waypoints": WPL, "a.csv": "1.5,2.25,3\n-4,5,6.5\n", "b.csv": "1,5;2,25;3\n-4;5;6,5\n"}
SIGNS = "".join(set(string.punctuation + string.whitespace) - set("_-+.#")) + "\x00\xa0\u0661"


@pytest.mark.parametrize("name", TABLES)
@given(st.data())
def test_another_sign_gives_the_same_manner_or_a_refusal(name: str, data: st.DataObject) -> None:
    """No digit and no decimal sign is changed: what is read otherwise then was never written."""
    text = TABLES[name]
    decimal = "," if name == "b.csv" else "."
    at = data.draw(
        st.integers(0, len(text) - 1).filter(lambda i: not text[i].isalnum() and text[i] not in f"{decimal}\n")
    )
    changed = text[:at] + data.draw(st.sampled_from(SIGNS.replace(decimal, ""))) + text[at + 1 :]
    try:
        found, message = routes.parse(changed.encode(), name), ""
    except RouteError as error:
        found, message = None, str(error)
    if found is None:
        assert ", line " in message or "begins with" in message or message.endswith("is not a text file")
    else:
        assert same(found, routes.parse(text.encode(), name))


@pytest.mark.parametrize("name", ["a.waypoints"])
def test_a_column_that_is_missing_or_doubled_is_refused_with_its_row(name: str) -> None:
    lines = TABLES[name].splitlines()
    for at, line in enumerate(lines[1:], start=1):
        fields = line.split("\t")
        for column in range(len(fields)):
            for put in ([], [fields[column]] * 2):
                changed = "\t".join([*fields[:column], *put, *fields[column + 1 :]])
                text = "\n".join([*lines[:at], changed, *lines[at + 1 :]])
                assert f", line {at + 1}: " in refusal(text, name)
