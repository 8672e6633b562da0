"""Lists of waypoints, and numbers as people write them."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ual import routes
from ual.geometry import Pose, PoseStamped
from ual.routes import RouteError
from ual.shared.numbers import parse_number

POSES = [PoseStamped(Pose.at(1.5, 2.0, 3.0)), PoseStamped(Pose.at(-4.0, 5.0, 6.25))]
NO_NUMBERS = [
    "1_000",
    "1_0.5",
    "inf",
    "-inf",
    "infinity",
    "Infinity",
    "nan",
    "NaN",
    "0x10",
    "0b1",
    "１２",
    "٣",
    "½",
    "1,5",
]
NO_NUMBERS += ["", " ", "1 2", "+-1", "1e", "e5", ".", "-", "1.2.3", "--1", "1d", "1e999", "1\n2", "1\x00", "\u00a01"]


@pytest.mark.parametrize("text", NO_NUMBERS, ids=repr)
def test_what_is_no_decimal_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a decimal number|is too large"):
        parse_number(text)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_each_number_is_read_as_it_was_written(value: float) -> None:
    assert parse_number(repr(value)) == value
    assert parse_number(f" {value:.17e}\r\n") == value


def test_short_forms_are_read() -> None:
    assert [parse_number(text) for text in ("1", "+1", "-1.", ".5", "1E3", "007")] == [1.0, 1.0, -1.0, 0.5, 1000.0, 7.0]


@pytest.mark.parametrize(
    "text",
    [
        "1.5,2,3\n-4,5,6.25\n",
        "1,5;2;3\n-4;5;6,25\n",
        "1.5;2;3\n-4;5;6.25",
        "x\ty\tz\n1,5\t2\t3\n-4\t5\t6.25",
        "x,y,z\n1.5,2,3\n-4,5,6.25",
        '\n# places\n"X";"Y";"Z"\n1,5;2,0;3,0\n-4;5;6,25',
        "x_m,y_m,z_m\n 1.5 , 2 , 3 \n-4,5,6.25",
    ],
)
def test_lists_are_read_as_spreadsheets_write_them(text: str) -> None:
    assert routes.parse_list(text, "points").waypoints == POSES


def test_a_column_of_headings_is_read() -> None:
    text = "x,y,z,yaw_rad\n1,2,3,1.5\n"
    assert routes.parse_list(text, "points").waypoints == [PoseStamped(Pose.at(1.0, 2.0, 3.0, 1.5))]


@pytest.mark.parametrize("line", ["{},0,3", "0,{},3", "0,0,{}", "0,0,3,{}", "0;0;{}"])
@pytest.mark.parametrize("text", ["1_000", "nan", "infinity", "１", "0x1F", ""])
def test_a_row_with_what_is_no_number_is_refused(line: str, text: str) -> None:
    with pytest.raises(RouteError, match=r"points, line 2: .* is not a waypoint: write X,Y,Z\[,YAW\]"):
        routes.parse_waypoints(f"0,0,3\n{line.format(text)}\n", "points")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "lat,lon,alt\n47.1,8.1,20",
            "line 1: the columns 'lat,lon,alt' are not x,y,z or x,y,z,yaw .*KML, GPX, GeoJSON",
        ),
        ("n,e,d\n1,2,3", "line 1: the columns 'n,e,d' are not"),
        ("x,y,z,yaw_deg\n1,2,3,1.5", "line 1: the columns"),
        ("1,2,3\nx,y,z", "line 2: 'x,y,z' is not a waypoint"),
        ("1,5;2;3;4;5", "line 1: .* is not a waypoint"),
        ("1.000,5;2;3", "line 1: .* is not a waypoint"),
        ("1\t2;3", "line 1: .* is not a waypoint"),
        ('{"x": 1, "y": 2}', r"line 1: z is not given \(null\)"),
        ('{"x": 1, "y": 2, "z": null}', "line 1: z is not given"),
        ('{"x": 1, "y": 2, "z": NaN}', "line 1: z is NaN, which JSON does not have"),
        ('{"x": 1, "y": 2, "z": "3"}', "line 1: z is '3', not a number"),
        ('{"x": 1, "y": 2, "z": true}', "line 1: z is 'True', not a number"),
        ('{"x": 1, "y": 2, "z": 1e999}', "line 1: z is 'inf', not a number"),
        ('{"x": 1, "y": 2, "z": ' + "9" * 500 + "}", "line 1: z is 'inf', not a number"),
        ('{"x": 1, "y": 2, "z": 3, "yaw": 90}', "line 1: 'yaw' is not known: a waypoint has x, y, z, yaw_rad"),
        ('{"lat": 47.1, "lon": 8.1, "alt": 20}', "line 1: 'lat' is not known: .*KML, GPX, GeoJSON"),
        ('{"x": 1, "y": 2, "z": 3, "yaw_rad": 90}', "line 1: yaw_rad is 90, more than a full turn"),
        ('{"x": 1, "y": 2, "z": 3, "hold_s": "long"}', "line 1: hold_s is 'long', not a number"),
        ('{"x": 1, "y": 2, "z": 3', "line 1: .* is not a waypoint"),
    ],
)
def test_a_list_that_means_something_else_is_refused(text: str, message: str) -> None:
    with pytest.raises(RouteError, match=f"points, {message}"):
        routes.parse_list(text, "points")


def test_waypoints_one_a_row_may_hold() -> None:
    lines = '0,0,3\n{"x": 1, "y": 0, "z": 3, "hold_s": 2.5}\n'
    assert routes.parse_list(lines, "points").holds_s == [0.0, 2.5]
    assert routes.parse_list("0,0,3\n", "points").holds_s == ()
    assert len(routes.parse_waypoints(lines, "points")) == 2


def test_a_heading_of_90_radians_in_a_file_is_refused_with_a_hint() -> None:
    with pytest.raises(routes.RouteError, match=r"points, line 2: 90 radians are more than a full turn: 90deg\?"):
        routes.parse_waypoints("0,0,3,1.5\n1,0,3,90\n", "points")


def test_angles_have_units() -> None:
    assert routes.parse_angle("90deg") == math.pi / 2
    assert routes.parse_angle(" 1.5rad ") == routes.parse_angle("1.5") == 1.5
    for text in ("9_0deg", "infrad", "nan", "deg"):
        with pytest.raises(ValueError, match="not a decimal number"):
            routes.parse_angle(text)
