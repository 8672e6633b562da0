"""Files of routes: which format they have, their encodings, and that nothing but a `RouteError` comes of any."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.ual.routes.missions import plan, waypoint, wpl
from ual import routes
from ual.geometry import Pose, PoseStamped
from ual.routes import RouteError
from ual.types import AltitudeReference, GeoWaypoint

DATA = Path(__file__).parents[2] / "data" / "routes"
POSES = [PoseStamped(Pose.at(x, y, 5.0)) for x, y in ((1.0, 1.0), (2.0, 2.0), (3.0, 1.0))]
KML = (
    '<?xml version="1.0" encoding="{}"?>\n<kml><Placemark><name>Übung</name><LineString><altitudeMode>absolute'
    "</altitudeMode><coordinates>8.5,47.4,30</coordinates></LineString></Placemark></kml>"
)
HOME = (0, 16, 0, 0, 0, 0, 47.0, 8.0, 400)
A = (3, 16, 0, 0, 0, 0, 47.1, 8.1, 20)
PLACE = [GeoWaypoint(47.4, 8.5, 30.0, AltitudeReference.AMSL)]


@pytest.mark.parametrize("name", ["bom.csv", "crlf.csv", "latin.csv", "utf16.csv"])
def test_a_list_is_read_in_each_encoding(name: str) -> None:
    assert routes.read(DATA / name).waypoints == POSES


@pytest.mark.parametrize("name", ["bom.kml", "latin1.kml", "utf16.kml", "utf16decl_utf8.kml"])
def test_a_kml_is_read_in_each_encoding(name: str) -> None:
    assert routes.read(DATA / name).waypoints == [
        GeoWaypoint(37.41180000000001, -6.0013, 8.0),
        GeoWaypoint(37.4117, -6.0012, 8.0),
    ]


def test_a_plan_with_a_byte_order_mark_is_read() -> None:
    assert len(routes.read(DATA / "bom.plan").waypoints) == 3


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1"])
def test_each_format_is_read_in_each_encoding(encoding: str) -> None:
    texts = {"a.csv": "# Übung\n1,1,5\n", "a.plan": plan(waypoint(), station="Übung"), "a.waypoints": wpl(HOME, A)}
    for name, text in {**texts, "a.kml": KML.format(encoding), "b.kml": KML.format("UTF-8")}.items():
        assert len(routes.parse(text.encode(encoding), name).waypoints) == 1, (name, encoding)


@pytest.mark.parametrize("encoding", ["windows-1252", "windows-1251", "iso-8859-15", "koi8-r"])
def test_an_encoding_that_the_file_declares_is_read(encoding: str) -> None:
    name = "Übung" if encoding in ("windows-1252", "iso-8859-15") else "Тест"
    two = KML.format(encoding).replace("</kml>", KML.partition("<kml>")[2]).replace("Übung", name)
    with pytest.raises(RouteError, match=f"'{name}', '{name}'"):
        routes.parse(two.encode(encoding), "a.kml")


@pytest.mark.parametrize("declared", ["zip", "unicode_escape", "punycode", "nonsense", "utf-7", "cp037"])
def test_an_encoding_that_is_none_is_not_queried(declared: str) -> None:
    assert routes.parse(KML.format(declared).encode("latin-1"), "a.kml").waypoints == PLACE


def test_the_rows_of_each_system_are_read() -> None:
    for end in ("\n", "\r\n", "\r"):
        assert routes.parse(end.join(("1,1,5", "2,2,5", "3,1,5", "")).encode(), "a.csv").waypoints == POSES
    assert routes.parse(b"1,1,5 # caf\xe9\x85 9,9,9\n2,2,5\n3,1,5\n\x1a", "a.csv").waypoints == POSES


def test_the_content_says_what_a_file_is(tmp_path: Path) -> None:
    files = {
        "m.PLAN": plan(waypoint(1, 2, 3)),
        "m.json": plan(waypoint(1, 2, 3)),
        "r.kml": "<kml><LineString><coordinates>2,1</coordinates></LineString></kml>",
        "r.txt": "<kml><LineString><coordinates>2,1</coordinates></LineString></kml>",
        "r.xml": '<gpx><rte><rtept lat="1" lon="2"/></rte></gpx>',
        "w.jsonl": '{"x": 1, "y": 2, "z": 3}\n4,5,6,90deg # the corner\n',
        "w.json": '{"x": 1, "y": 2, "z": 3}',
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    for name in ("m.PLAN", "m.json"):
        assert routes.read(tmp_path / name).waypoints == [GeoWaypoint(1.0, 2.0, 3.0)]
    for name in ("r.kml", "r.txt", "r.xml"):
        assert routes.read(tmp_path / name, altitude_m=7.0).waypoints == [GeoWaypoint(1.0, 2.0, 7.0)]
    for name, count in (("w.jsonl", 2), ("w.json", 1)):
        lines = routes.read(tmp_path / name, frame_id="map").waypoints
        assert [each.frame_id for each in lines if isinstance(each, PoseStamped)] == ["map"] * count


@pytest.mark.parametrize("name", ["m.plan", "m.waypoints", "m.csv"])
def test_an_altitude_for_a_file_that_has_its_own_is_refused(name: str) -> None:
    texts = {"m.plan": plan(waypoint()), "m.waypoints": wpl(HOME, A), "m.csv": "1,1,5"}
    for how in ({"altitude_m": 20.0}, {"altitude_reference": AltitudeReference.AMSL}):
        with pytest.raises(RouteError, match=f"{name} has altitudes of its own: leave out --altitude"):
            routes.parse(texts[name].encode(), name, **how)


@pytest.mark.parametrize(
    ("data", "name", "message"),
    [
        (b"", "a.csv", "a.csv has no waypoints to fly to"),
        (b"# nothing\n", "a.csv", "a.csv has no waypoints to fly to"),
        (b"", "a.kml", "a.kml is not valid XML"),
        (b"", "a.plan", "a.plan is not a plan of QGroundControl"),
        (b"", "a.geojson", "a.geojson is not GeoJSON"),
        (b"\xff\xfe\x00", "a.plan", "a.plan is not a text file"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "a.kml", "a.kml is not a text file"),
        (bytes(range(256)), "a.csv", "a.csv is not a text file"),
        (b"1" * 20_000_001, "a.csv", "a.csv is too large for a route"),
        (b"{", "a.plan", "a.plan is not a plan of QGroundControl"),
        (b"x" * 500, "a.csv", "a.csv, line 1: 'xxxx.{0,60}' is not a waypoint"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_what_is_no_route_is_refused_in_one_short_message(data: bytes, name: str, message: str) -> None:
    with pytest.raises(RouteError, match=message) as caught:
        routes.parse(data, name)
    assert len(str(caught.value)) < 200
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_refused_by_its_name(tmp_path: Path) -> None:
    with pytest.raises(RouteError, match=r"cannot read .*none.plan: No such file"):
        routes.read(tmp_path / "none.plan")
    with pytest.raises(RouteError, match=r"cannot read .*Is a directory"):
        routes.read(tmp_path)
    with pytest.raises(RouteError, match="/dev/zero is too large for a route"):
        routes.read("/dev/zero")


KEYS = [
    *("fileType", "mission", "items", "type", "command", "params", "frame", "TransectStyleComplexItem", "Items"),
    *("doJumpId", "coordinate", "coordinates", "geometry", "features", "crs", "properties", "name", "x", "y", "z"),
]
VALUES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=4), inner),
    max_leaves=12,
)


@given(
    st.text(max_size=200)
    | VALUES.map(json.dumps)
    | VALUES.map(lambda value: json.dumps({"fileType": "Plan", "mission": {"items": [value]}}))
    | VALUES.map(lambda value: json.dumps({"type": "Feature", "geometry": value}))
    | st.text("<>/ab\"'= ,.0159kmlgpxrte", max_size=200).map(lambda text: f"<gpx>{text}</gpx>")
)
def test_whatever_a_file_holds_only_a_route_error_comes_out(text: str) -> None:
    for parse in (routes.parse_plan, routes.parse_kml, routes.parse_waypoints):
        with contextlib.suppress(RouteError):
            parse(text, "file")
    for ending in ("csv", "plan", "kml", "gpx", "geojson", "waypoints"):
        with contextlib.suppress(RouteError):
            routes.parse(text.encode("utf-8", "surrogatepass"), f"file.{ending}")


@given(st.binary(max_size=200) | st.binary(max_size=200).map(b"PK\x03\x04".__add__))
def test_whatever_bytes_a_file_holds_only_a_route_error_comes_out(data: bytes) -> None:
    for ending in ("csv", "kmz", "kml"):
        with contextlib.suppress(RouteError):
            routes.parse(data, f"file.{ending}")
