"""Waypoint files of Mission Planner and of MAVLink's tools."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.ual.routes.missions import wpl
from ual import routes
from ual.routes import RouteError
from ual.types import AltitudeReference, GeoWaypoint

DATA = Path(__file__).parents[2] / "data" / "routes"
HOME = (0, 16, 0, 0, 0, 0, 37.4117, -6.0013, 10)
A = (3, 16, 0, 0, 0, 0, 37.4118, -6.0013, 8)
B = (0, 16, 2, 0, 0, 0, 37.4118, -6.0012, 30)


def read(text: str, name: str = "m.waypoints") -> routes.Route:
    return routes.parse(text.encode(), name)


def headings(route: routes.Route) -> list[float | None]:
    return [each.yaw_rad for each in route.waypoints if isinstance(each, GeoWaypoint)]


def test_the_waypoints_are_read_without_home() -> None:
    route = read(wpl(HOME, A, B))
    assert route.waypoints == [
        GeoWaypoint(37.4118, -6.0013, 8.0),
        GeoWaypoint(37.4118, -6.0012, 30.0, AltitudeReference.AMSL),
    ]
    assert route.holds_s == [0.0, 2.0]
    assert route.left_out == ["item 0: home"]
    assert routes.read(DATA / "wpl.waypoints").waypoints == [GeoWaypoint(37.4118, -6.0013, 8.0)]


def test_a_decimal_comma_is_read() -> None:
    route = routes.read(DATA / "wpl_comma.waypoints")
    assert (route.waypoints, route.holds_s) == ([GeoWaypoint(37.4118, -6.0013, 8.0)], [1.0])


def test_the_header_says_what_it_is_whatever_its_ending() -> None:
    text = wpl(HOME, A)
    for name in ("m.txt", "m.waypoints", "m.mission", "m"):
        assert len(read(text, name).waypoints) == 1
    assert len(read("\ufeff" + text).waypoints) == 1
    assert len(read(text.replace("\t", "  ").replace("\r", "") + "\n\n").waypoints) == 1
    assert len(read(text.replace("\t", " \t", 5)).waypoints) == 1


def test_a_command_instead_of_home_is_carried_out() -> None:
    route = read(wpl((3, 22, 0, 0, 0, 0, 0, 0, 8), A))
    assert (len(route.waypoints), route.left_out) == (1, ["item 0: take-off"])


def test_a_jump_goes_to_a_number_of_the_file() -> None:
    jump = (3, 177, 1, 2, 0, 0, 0, 0, 0)
    assert len(read(wpl(HOME, A, B, jump)).waypoints) == 6
    with pytest.raises(RouteError, match="line 5, item 3: it jumps to item 0, which there is not"):
        read(wpl(HOME, A, B, (3, 177, 0, 2, 0, 0, 0, 0, 0)))


def test_parameters_that_are_not_passed_are_those_of_px4() -> None:
    """MAVROS and old QGroundControls write them for PX4, which turns to north by 0."""
    nowhere = (3, 16, 0, 0, 0, "nan", 37.4118, -6.0013, 8)
    north = (3, 16, 0, 0, 0, 0, 37.4118, -6.0012, 8)
    route = read(wpl(HOME, nowhere, north))
    assert headings(route) == [None, pytest.approx(math.pi / 2)]
    assert route.left_out == ["item 0: home"]
    assert headings(read(wpl(HOME, A, north))) == [None, None]


def test_an_old_file_of_qgroundcontrol_has_no_home_and_has_headings() -> None:
    (north, east) = read(wpl(A, (3, 16, 0, 0, 0, 90, 37.4, -6.0, 8), version=120)).waypoints
    assert isinstance(north, GeoWaypoint)
    assert isinstance(east, GeoWaypoint)
    assert (north.yaw_rad, east.yaw_rad) == (math.pi / 2, 0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("QGC WPL 100\n", "begins with 'QGC WPL 100', not with 'QGC WPL 110'"),
        ("0\t1\t0\t16\n", r"begins with '0\\t1\\t0\\t16', not with 'QGC WPL 110'"),
        ("", "begins with '', not"),
        (wpl(), "has no waypoints"),
        (wpl(HOME), "has no waypoints"),
        (wpl(HOME, (3, 22, 0, 0, 0, 0, 0, 0, 8)), "has no waypoints"),
        (wpl(HOME, A[:8]), r"line 3: .* has 11 columns, not 12"),
        (wpl(HOME, (3, 16, 0, 0, 0, 0, "1_0", 8, 8)), "line 3: '1_0' is not a decimal number"),
        (wpl(HOME, (3, 16, 0, 0, 0, 0, "nan", 8, 8)), "line 3: 'nan' is not a decimal number"),
        (wpl(HOME, (3, 16, 0, 0, 0, 0, "47,1", "8.1", 8)), "line 3: '47,1' is not a decimal number"),
        (wpl(HOME, (3, 16.5, 0, 0, 0, 0, 47, 8, 8)), "line 3: .* fractions"),
        (wpl(HOME, A, (3, 16, 0, 0, 0, 0, 0, 0, 8)), "line 4, item 2: latitude 0, longitude 0 .* not set"),
        (wpl(HOME, A, (10, 16, 0, 0, 0, 0, 37.4, -6.0, 8)), "line 4, item 2: .*above the terrain"),
        (wpl(HOME, A, (3, 20, 0, 0, 0, 0, 0, 0, 0), B), "line 4, item 2: it is a return to launch.*item 3 flies on"),
        (wpl((3, 5001, 3, 0, 0, 0, 47, 8, 0)), "line 2, item 0: UAL cannot fly a point of a fence"),
        (wpl(HOME, (3, 16, 0, 0, 0, 0, 47, 8, 0)), "line 3, item 1: altitude 0 is for ArduPilot that of the waypoint"),
        (wpl(HOME, A).replace("\n1\t", "\n0\t"), "line 3, item 0: its number comes after 0"),
    ],
)
def test_a_file_that_cannot_be_executed_is_refused_with_its_row(text: str, message: str) -> None:
    with pytest.raises(RouteError, match=f"m.waypoints,? {message}"):
        read(text)
