"""Lines of KML, KMZ, GPX and GeoJSON: which is flown, and what its altitudes mean."""

from __future__ import annotations

import io
import json
import struct
import time
import zipfile
from pathlib import Path
from typing import Any

import pytest

from ual import routes
from ual.routes import Route, RouteError
from ual.types import AltitudeReference, GeoWaypoint

DATA = Path(__file__).parents[2] / "data" / "routes"
HOME, AMSL, ELLIPSOID = AltitudeReference.HOME, AltitudeReference.AMSL, AltitudeReference.ELLIPSOID
A, B = GeoWaypoint(47.4, 8.5, 30.0, AMSL), GeoWaypoint(47.5, 8.6, 40.0, AMSL)


def read(text: str | bytes, ending: str, **how: Any) -> Route:
    return routes.parse(text if isinstance(text, bytes) else text.encode(), f"r.{ending}", **how)


def kml(*placemarks: str, space: str = 'xmlns="http://www.opengis.net/kml/2.2"') -> str:
    marks = "".join(f"<Placemark>{each}</Placemark>" for each in placemarks)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<kml {space}><Document><name>r</name>{marks}</Document></kml>'


def row(coordinates: str = "8.5,47.4,30 8.6,47.5,40", mode: str = "absolute") -> str:
    kind = f"<altitudeMode>{mode}</altitudeMode>" if mode else ""
    return f"<LineString>{kind}<coordinates>{coordinates}</coordinates></LineString>"


# --- KML --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mode", "reference"), [("absolute", AMSL), ("relativeToGround", HOME)])
def test_a_row_of_kml_gives_its_positions(mode: str, reference: AltitudeReference) -> None:
    route = read(kml(row("\n 8.5,47.4,30 8.6,47.5,40\n", mode)), "kml")
    assert route.waypoints == [GeoWaypoint(47.4, 8.5, 30.0, reference), GeoWaypoint(47.5, 8.6, 40.0, reference)]
    told = ["the height of the ground: altitudes are taken as above home"]
    assert route.left_out == (told if mode == "relativeToGround" else [])


@pytest.mark.parametrize(
    "coordinates",
    ["8.5, 47.4, 30\n8.6, 47.5, 40", "8.5 ,47.4 ,30\t8.6 , 47.5 , 40", "\n8.5,47.4,30\n\n8.6,47.5,40\n"],
)
def test_spaces_next_to_commas_are_read(coordinates: str) -> None:
    assert read(kml(row(coordinates)), "kml").waypoints == [A, B]


def test_a_track_is_executed_without_its_times() -> None:
    route = routes.read(DATA / "track.kml")
    assert route.waypoints == [
        GeoWaypoint(37.4117, -6.0013, 30.0, AMSL),
        GeoWaypoint(37.41180000000001, -6.0013, 30.0, AMSL),
    ]
    assert route.left_out == ["the times of the track"]


@pytest.mark.parametrize("mode", ["", "clampToGround", "clampToSeaFloor", "relativeToSeaFloor", "absolut"])
def test_a_row_at_no_height_to_fly_at_needs_an_altitude(mode: str) -> None:
    text = kml(row("8.5,47.4 8.6,47.5,0", mode))
    assert read(text, "kml", altitude_m=25.0).waypoints == [GeoWaypoint(47.4, 8.5, 25.0), GeoWaypoint(47.5, 8.6, 25.0)]
    with pytest.raises(RouteError, match=rf"altitudeMode '{mode or 'clampToGround'}', .*give an altitude above home"):
        read(text, "kml")


def test_an_altitude_that_is_passed_is_executed_and_reported() -> None:
    route = read(kml(row()), "kml", altitude_m=25.0)
    assert [each.altitude_m for each in route.waypoints if isinstance(each, GeoWaypoint)] == [25.0, 25.0]
    assert route.left_out == ["the altitudes of the file: all is flown 25 m above home"]
    with pytest.raises(RouteError, match="says itself what its altitudes count from: leave out --reference"):
        read(kml(row()), "kml", altitude_reference=HOME)


def test_an_altitude_that_one_position_lacks_is_requested() -> None:
    with pytest.raises(RouteError, match=r"mix2.kml, place 2: it has no altitude: give an altitude above home"):
        routes.read(DATA / "mix2.kml")
    assert len(routes.read(DATA / "mix2.kml", altitude_m=20.0).waypoints) == 2


def test_one_message_among_other_things_is_executed_and_they_are_reported() -> None:
    point, polygon = "<Point><coordinates>8,47</coordinates></Point>", "<Polygon><outerBoundaryIs/></Polygon>"
    route = read(kml(point, f"<MultiGeometry>{row()}{polygon}</MultiGeometry>", point), "kml")
    assert route.waypoints == [A, B]
    assert route.left_out == ["2 points and 1 polygon"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<kml>", "is not valid XML"),
        ("<osm/>", "has 0 lines"),
        (
            kml("<Point/>"),
            r"has 0 lines \(LineString\) \(it has 1 point\); a route needs exactly one: draw the way as one line",
        ),
        (kml("<Polygon/>"), r"has 0 lines .* \(it has 1 polygon\)"),
        (
            kml("<name>a</name>" + row(), "<name>b</name>" + row()),
            r"has 2 lines \(LineString\) \('a', 'b'\); .* keep one",
        ),
        (kml(row() + row()), "has 2 lines"),
        (kml("<LineString><altitudeMode>absolute</altitudeMode></LineString>"), "has a line without coordinates"),
        (kml(row("8,47")), "place 1: it has no altitude"),
        (kml(row("8")), "place 1: '8' is not LONGITUDE,LATITUDE,ALTITUDE"),
        (kml(row("8,47,3,4")), "place 1: '8,47,3,4' is not"),
        (kml(row("8,,47")), "has coordinates with a comma too many"),
        (kml(row(",8,47")), "has coordinates with a comma too many"),
        (kml(row("8,47,30 8,1_0,30")), "place 2: its '8,1_0,30': '1_0' is not a decimal number"),
        (kml(row("8,47,nan")), "place 1: .*'nan' is not a decimal number"),
        (kml(row("8,47,30 0,0,30")), "place 2: latitude 0, longitude 0 is a position that was not set"),
        (kml(row("47,139,30")), "place 1: latitude 139, longitude 47 is not on Earth .*: are the two swapped"),
    ],
)
def test_kml_that_is_no_route_is_refused(text: str, message: str) -> None:
    with pytest.raises(RouteError, match=f"r.kml,? {message}"):
        read(text, "kml")


@pytest.mark.parametrize("name", ["points.kml", "poly.kml", "two.kml", "gxmode.kml"])
def test_a_file_without_a_row_to_fly_is_refused(name: str) -> None:
    with pytest.raises(RouteError, match=f"{name} has (a line|[02] lines)"):
        routes.read(DATA / name)


def test_undeclared_prefixes_are_read() -> None:
    text = "<gx:Track><altitudeMode>absolute</altitudeMode><gx:coord>8.5 47.4 30</gx:coord></gx:Track>"
    assert read(kml(text, space=""), "kml").waypoints == [A]


BOMB = '<!DOCTYPE k [<!ENTITY a "1"><!ENTITY b "&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    "doctype", [BOMB, '<!DOCTYPE k SYSTEM "file:///etc/passwd">', "<!DOCTYPE k [<!ENTITY x SYSTEM 'http://x/'>]>"]
)
@pytest.mark.parametrize("ending", ["kml", "gpx"])
def test_entities_are_refused(doctype: str, ending: str) -> None:
    with pytest.raises(RouteError, match="document type declaration"):
        read(doctype + f"<{ending}>&b;</{ending}>", ending)


def test_an_empty_document_type_is_harmless() -> None:
    assert len(routes.read(DATA / "doctype.kml").waypoints) == 2


def test_a_large_file_is_read_in_a_time_that_grows_with_its_size() -> None:
    """No part of a reader is quadratic: this takes a second, and would take hours."""
    began_s = time.process_time()
    for text in (
        kml(row(" " * 1_000_000 + "8.5,47.4,30")),
        "<kml>" + "<a>" * 100_000 + "</a>" * 100_000 + "</kml>",
        kml(row(",".join("1" * 300_000))),
    ):
        try:
            read(text, "kml")
        except RouteError:
            continue
    assert time.process_time() - began_s < 60.0


# --- KMZ --------------------------------------------------------------------------------------------------------------


def kmz(**files: str) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name.replace("_", "."), text)
    return packed.getvalue()


def test_a_kmz_is_read_whatever_its_ending() -> None:
    for data in (kmz(doc_kml=kml(row())), kmz(route_kml=kml(row()), icon_png="x")):
        for ending in ("kmz", "kml", "zip"):
            assert read(data, ending).waypoints == [A, B]
    assert read(kmz(other_kml=kml(row(), row()), doc_kml=kml(row())), "kmz").waypoints == [A, B]
    assert len(routes.read(DATA / "a.kmz").waypoints) == 2


def bomb() -> bytes:
    """A zip file of 40 kB whose KML has 40 MB, of which its directory says that it has 10 bytes."""
    data = kmz(doc_kml="<kml>" + " " * 40_000_000)
    real = struct.pack("<L", 40_000_005)
    return data.replace(real, struct.pack("<L", 10))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (kmz(), "has 0 KML files"),
        (kmz(a_kml="", b_kml=""), "has 2 KML files and no doc.kml"),
        (kmz(doc_kml="<kml>" + " " * 20_000_001), "is too large for a route"),
        (bomb(), "cannot|not valid XML|can be unpacked"),
        (kmz(doc_kml=kml(row()))[:60], "is not a KMZ that can be unpacked"),
        (kmz(waylines_wpml="", template_kml=""), r"is a mission of DJI \(WPML\)"),
        (kmz(doc_kml="<kml/>"), "has 0 lines"),
    ],
    ids=["empty", "two", "large", "bomb", "cut", "dji", "no line"],
)
def test_a_kmz_that_is_no_route_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(RouteError, match=rf"r.kmz .*({message})"):
        read(data, "kmz")


def test_a_kmz_with_a_damaged_content_is_refused() -> None:
    data = bytearray(kmz(doc_kml=kml(row())))
    data[60] ^= 0xFF
    with pytest.raises(RouteError, match="is not a KMZ that can be unpacked"):
        read(bytes(data), "kmz")


# --- GPX --------------------------------------------------------------------------------------------------------------


def gpx(*parts: str, version: str = "1/1") -> str:
    return f'<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/{version}">{"".join(parts)}</gpx>'


def points(kind: str = "rtept", elevation: str = "<ele>{}</ele>") -> str:
    ways = ((47.4, 8.5, 30), (47.5, 8.6, 40))
    return "".join(f'\n<{kind} lat="{a}" lon="{b}">{elevation.format(h)}</{kind}>' for a, b, h in ways)


@pytest.mark.parametrize("version", ["1/0", "1/1"])
@pytest.mark.parametrize(
    ("text", "left_out"),
    [
        (f"<rte><name>r</name>{points()}</rte>", []),
        (f"<trk><trkseg>{points('trkpt')}</trkseg></trk>", ["the times of the track"]),
        (f'<wpt lat="1" lon="2"/><rte>{points()}</rte>', ["1 waypoint"]),
    ],
)
def test_the_route_or_track_of_a_gpx_is_read(text: str, left_out: list[str], version: str) -> None:
    for reference in AltitudeReference:
        route = read(gpx(text, version=version), "gpx", altitude_reference=reference)
        assert route.waypoints == [GeoWaypoint(47.4, 8.5, 30.0, reference), GeoWaypoint(47.5, 8.6, 40.0, reference)]
        assert route.left_out == left_out
    flat = read(gpx(text, version=version), "gpx", altitude_m=20.0)
    assert flat.waypoints == [GeoWaypoint(47.4, 8.5, 20.0), GeoWaypoint(47.5, 8.6, 20.0)]
    assert flat.left_out[-1] == "the altitudes of the file: all is flown 20 m above home"


def test_an_empty_part_of_a_gpx_is_no_row() -> None:
    text = gpx(f"<rte/><trk><trkseg/><trkseg>{points('trkpt')}</trkseg></trk>")
    assert read(text, "gpx", altitude_reference=AMSL).waypoints == [A, B]


def test_a_track_that_stands_still_has_no_waypoint_for_each_second() -> None:
    still = "".join('<trkpt lat="47.4" lon="8.5"><ele>30</ele></trkpt>' for _ in range(100))
    text = gpx(f"<trk><trkseg>{still}{points('trkpt')}</trkseg></trk>")
    assert read(text, "gpx", altitude_reference=AMSL).waypoints == [A, B]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (gpx(f"<rte>{points()}</rte>"), r"does not say what its altitudes count from.*--reference \(home, amsl or"),
        (gpx(f"<rte>{points(elevation='')}</rte>"), r"line 2: it has no altitude: give an altitude .*--altitude"),
        (gpx(), r"has 0 routes \(rte\) and segments of tracks \(trkseg\)"),
        (gpx('<wpt lat="1" lon="2"/>'), r"has 0 routes.* \(it has 1 waypoint, which have no order\); .*: draw the way"),
        (gpx(f"<rte><name>a</name>{points()}</rte>" * 2), r"has 2 routes.* \('a', 'a'\)"),
        (gpx(f"<rte>{points()}</rte><trk><trkseg>{points('trkpt')}</trkseg></trk>"), "has 2 routes"),
        (gpx("<trk>", f"<trkseg>{points('trkpt')}</trkseg>" * 2, "</trk>"), "has 2 routes"),
        (gpx("<rte/><trk><trkseg/></trk>"), "has 0 routes"),
        (gpx('<rte>\n<rtept lat="47"/></rte>'), r"line 2: it has no longitude \(lon\)"),
        (gpx('<rte><rtept lat="1_0" lon="8"/></rte>'), r"line 1: its latitude \(lat\) '1_0' is not a decimal number"),
        (gpx('<rte><rtept lat="nan" lon="8"/></rte>'), "'nan' is not a decimal number"),
        (gpx('<rte><rtept lat="４７" lon="8"/></rte>'), "'４７' is not a decimal number"),
        (gpx('<rte><rtept lat="47" lon="8"><ele>0x1F</ele></rtept></rte>'), "'0x1F' is not a decimal number"),
        (gpx('<rte><rtept lat="47" lon="8"><ele/></rtept></rte>'), "elevation .*'' is not a decimal number"),
    ],
)
def test_gpx_that_is_no_route_is_refused(text: str, message: str) -> None:
    with pytest.raises(RouteError, match=rf"r.gpx,? .*{message}"):
        read(text, "gpx")


@pytest.mark.parametrize(("lat", "lon"), [("0", "0"), ("91", "8"), ("8", "181")])
def test_a_position_of_a_gpx_that_is_none_is_refused(lat: str, lon: str) -> None:
    text = gpx(f'<rte><rtept lat="{lat}" lon="{lon}"><ele>8</ele></rtept></rte>')
    with pytest.raises(RouteError, match=r"r.gpx, line 1: latitude"):
        read(text, "gpx", altitude_reference=AMSL)


def test_the_gpx_of_the_issue_is_read() -> None:
    route = routes.read(DATA / "t.gpx", altitude_reference=HOME)
    assert route.waypoints == [GeoWaypoint(37.4117, -6.0013, 8.0, HOME)]


# --- GeoJSON ----------------------------------------------------------------------------------------------------------

LINE = {"type": "LineString", "coordinates": [[8.5, 47.4, 30], [8.6, 47.5, 40]]}
POINT = {"type": "Point", "coordinates": [1, 2, 3]}


def feature(geometry: object, name: str = "") -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": {"name": name}}


def collection(*features: object, **more: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features), **more}


@pytest.mark.parametrize(
    ("document", "left_out"),
    [
        (LINE, []),
        (feature(LINE), []),
        (collection(feature(LINE)), []),
        (collection(feature(POINT), feature(LINE), feature(POINT), feature(None)), ["2 points"]),
        ({"type": "GeometryCollection", "geometries": [LINE, POINT]}, ["1 point"]),
        ({"type": "MultiLineString", "coordinates": [LINE["coordinates"]]}, []),
        (collection(feature(LINE), crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}), []),
    ],
)
def test_the_row_of_a_geojson_is_read_longitude_first(document: object, left_out: list[str]) -> None:
    for ending in ("geojson", "json", "txt"):
        route = read(json.dumps(document), ending, altitude_reference=ELLIPSOID)
        assert route.waypoints == [GeoWaypoint(47.4, 8.5, 30.0, ELLIPSOID), GeoWaypoint(47.5, 8.6, 40.0, ELLIPSOID)]
        assert route.left_out == left_out


def geo_path(*coordinates: object) -> dict[str, Any]:
    return {"type": "LineString", "coordinates": list(coordinates)}


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (LINE, "does not say what its altitudes count from, .*--reference .*--altitude"),
        (geo_path([8.5, 47.4]), "position 1: it has no altitude: give an altitude"),
        (geo_path([8.5, 47.4, 30], [8.6, 47.5]), "position 2: it has no altitude"),
        (geo_path([0, 0, 30]), "does not say"),
        (geo_path([8.5]), r"position 1: '\[8.5\]' is not \[LONGITUDE, LATITUDE, ALTITUDE\]"),
        (geo_path(["8", 47, 3]), "position 1: a coordinate is '8', not a number"),
        (geo_path([8, float("nan"), 3]), "position 1: a coordinate is NaN, which JSON does not have"),
        (geo_path([8, None, 3]), "position 1: a coordinate is not given"),
        (geo_path(), "has a line without coordinates"),
        ({"type": "LineString"}, "has a line without coordinates"),
        (POINT, r"has 0 lines \(LineString\) \(it has 1 point\); a route needs exactly one: draw the way as one line"),
        (
            collection(feature(LINE, "a"), feature(LINE, "b")),
            r"has 2 lines \(LineString\) \('a', 'b'\); .* keep one",
        ),
        ({"type": "MultiLineString", "coordinates": [[], []]}, "has 2 lines"),
        (collection(), "has 0 lines"),
        (collection(crs={"properties": {"name": "EPSG:25830"}}), "is in the coordinate system 'EPSG:25830'"),
        ({"type": "Topology"}, "is not GeoJSON|not a waypoint|is not known"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_geojson_that_is_no_route_is_refused(document: object, message: str) -> None:
    with pytest.raises(RouteError, match=rf"r.geojson,? .*({message})"):
        read(json.dumps(document), "geojson")


@pytest.mark.parametrize("position", [[0, 0, 30], [47, 139, 30], [500_000, 4_100_000, 30]])
def test_a_position_of_a_geojson_that_is_none_is_refused(position: list[float]) -> None:
    with pytest.raises(RouteError, match=r"r.geojson, position 1: latitude"):
        read(json.dumps(geo_path(position)), "geojson", altitude_reference=AMSL)


def test_the_geojson_of_the_issue_is_read() -> None:
    route = routes.read(DATA / "geojson.geojson", altitude_m=20.0)
    assert route.waypoints == [GeoWaypoint(37.41180000000001, -6.0013, 20.0), GeoWaypoint(37.4117, -6.0012, 20.0)]


def test_the_points_between_those_of_a_route_are_named() -> None:
    """Garmin's planners write them as an extension, and its receivers follow them."""
    between = '<extensions><rpt lat="47.2" lon="8.2"/></extensions>'
    text = f'<gpx><rte><rtept lat="47.1" lon="8.1">{between}</rtept><rtept lat="47.3" lon="8.1"/></rte></gpx>'
    found = routes.parse(text.encode(), "a.gpx", altitude_m=20.0)
    assert len(found.waypoints) == 2
    assert found.left_out == ["the points between those of the route (Garmin's rpt)"]
