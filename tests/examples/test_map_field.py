"""The survey of a field: each picture is where it should be, none is missing, and its file says so."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import exifread
import pytest
from hypothesis import given
from hypothesis import strategies as st

from examples import map_field
from tests.conftest import StartDaemon
from tests.examples.test_use_cases import Program
from ual.cameras import Photo
from ual.geometry import Vector3
from ual_daemon import UAL
from ual_daemon.geodesy import EllipsoidProjection

ORIGIN = (40.0, -3.7, 600.0)
LENGTH_M = float(os.environ.get("SURVEY_LENGTH_M", "15"))
"""Length of the lanes in metres: 110 m lead to over a thousand pictures."""
LEAST_COUNT = 9.2 * LENGTH_M
LATE_M = 0.3
"""Most distance in metres of a picture from its planned position."""


def cross_track_m(place: tuple[float, float], begin: tuple[float, float], end: tuple[float, float]) -> float:
    dx, dy = end[0] - begin[0], end[1] - begin[1]
    share = ((place[0] - begin[0]) * dx + (place[1] - begin[1]) * dy) / (dx * dx + dy * dy)
    share = min(1.0, max(0.0, share))
    return math.dist(place, (begin[0] + share * dx, begin[1] + share * dy))


def position_of(file: Path) -> Vector3:
    """Returns the position at which the picture was taken, by its file, in the frame of its UAV."""
    with file.open("rb") as opened:
        tags: dict[str, Any] = exifread.process_file(opened, details=False)
    latitude, longitude = (_degrees(tags, name) for name in ("Latitude", "Longitude"))
    altitude = tags["GPS GPSAltitude"].values[0]
    return EllipsoidProjection(*ORIGIN).to_local(latitude, longitude, altitude.num / altitude.den)


def _degrees(tags: dict[str, Any], name: str) -> float:
    sign = 1 if tags[f"GPS GPS{name}Ref"].values in "NE" else -1
    degrees, minutes, seconds = (each.num / each.den for each in tags[f"GPS GPS{name}"].values)
    return float(sign * (degrees + minutes / 60 + seconds / 3600))


def require_each_where_it_should_be(
    photos: Sequence[Photo], ends: Sequence[tuple[float, float]], distance_m: float
) -> None:
    places = [(each.body.pose.position.x, each.body.pose.position.y) for each in photos if each.body is not None]
    assert len(places) == len(photos)
    assert math.dist(places[0], ends[0]) < LATE_M
    assert max(min(cross_track_m(place, *line) for line in pairwise(ends)) for place in places) < LATE_M
    steps_m = [math.dist(*pair) for pair in pairwise(places)]
    assert distance_m - LATE_M < min(steps_m)
    assert max(steps_m) < distance_m + LATE_M
    # From the last place to the end of the lanes there was no room for another one.
    assert math.dist(places[-1], ends[-1]) < distance_m + LATE_M


def test_pictures_by_distance_are_where_they_should_be_and_their_files_say_so(tmp_path: Path) -> None:
    field = ((0.0, 0.0), (LENGTH_M, 0.0), (LENGTH_M, 26.0), (0.0, 26.0))
    ends = map_field.lanes(field, 4.0)
    camera = {"width_px": 32, "height_px": 24}
    settings = {"speed_factor": 50.0, "origin_geo": ORIGIN, "cameras": [camera]}
    with UAL("light", backend_settings=settings) as uav:
        uav.arm()
        uav.take_off(10.0)
        photos = map_field.survey(uav, ends, 10.0, 0.64)
        assert uav.cameras[0].status().missed_count == 0
        map_field.write(uav, photos, tmp_path)
        assert len(photos) >= LEAST_COUNT
        require_each_where_it_should_be(photos, ends, 0.64)
        files = sorted(tmp_path.iterdir())
        assert len(files) == len(photos)
        for photo, file in zip(photos, files, strict=True):
            assert photo.body is not None
            assert math.dist(photo.body.pose.position, position_of(file)) < 0.02


def test_the_program_surveys_a_field(start_daemon: StartDaemon, runtime_dir: Path, tmp_path: Path) -> None:
    daemon = start_daemon("--set", "light.speed_factor=10", "--set", f"light.origin_geo={list(ORIGIN)}")
    daemon.wait_for("state", new="LANDED_DISARMED")
    words = ("--arm", "--lane-m", "8", "--distance-m", "5", "--directory", str(tmp_path / "set"))
    lines = Program(runtime_dir, "map_field", "uav_1", *words).end()
    said = re.fullmatch(r"(\d+) pictures in .*set", lines[-1])
    assert said is not None, lines
    places = [position_of(file) for file in sorted((tmp_path / "set").iterdir())]
    assert len(places) == int(said[1]) >= 8
    ends = map_field.lanes(map_field.FIELD, 8.0)
    assert max(min(cross_track_m((place.x, place.y), *line) for line in pairwise(ends)) for place in places) < LATE_M


@given(st.floats(1.0, 7.0), st.integers(3, 9))
def test_lanes_cover_the_field(lane_m: float, corners: int) -> None:
    """Each place of a regular polygon is within a lane's width of one: beside it, or beyond its end."""
    field = [(20.0 * math.cos(k * math.tau / corners), 20.0 * math.sin(k * math.tau / corners)) for k in range(corners)]
    ends = map_field.lanes(field, lane_m)
    assert len(ends) % 2 == 0
    lanes = list(zip(ends[::2], ends[1::2], strict=True))
    assert all(begin[1] == end[1] for begin, end in lanes)
    assert all(lower[0][1] < upper[0][1] for lower, upper in pairwise(lanes))
    assert {begin[0] < end[0] for begin, end in lanes[::2]} <= {True}
    assert {begin[0] > end[0] for begin, end in lanes[1::2]} <= {True}
    low, high = min(y for _, y in field), max(y for _, y in field)
    assert lanes[0][0][1] == pytest.approx(low + lane_m / 2.0)
    assert high - lanes[-1][0][1] < lane_m + 1e-9
