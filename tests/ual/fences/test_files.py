"""Files of fences: what each form means, and what is refused with its place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from ual.errors import InvalidArgumentError
from ual.fences import FenceZone, RallyPoint, read
from ual.types import AltitudeReference

FIELD = ((47.0, 8.0), (47.001, 8.0), (47.001, 8.001))
PLAN: dict[str, Any] = {
    "fileType": "Plan",
    "version": 1,
    "groundStation": "QGroundControl",
    "mission": {"items": []},
    "geoFence": {
        "version": 2,
        "polygons": [{"inclusion": True, "polygon": [list(each) for each in FIELD], "version": 1}],
        "circles": [{"inclusion": False, "circle": {"center": [47.0005, 8.0], "radius": 12.5}, "version": 1}],
    },
    "rallyPoints": {"version": 2, "points": [[47.0001, 8.0001, 20.4]]},
}
ITEMS = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t500.0\t1
1\t0\t0\t5001\t3\t0\t0\t0\t47.0\t8.0\t0.0\t1
2\t0\t0\t5001\t3\t0\t0\t0\t47.001\t8.0\t0.0\t1
3\t0\t0\t5001\t3\t0\t0\t0\t47.001\t8.001\t0.0\t1
4\t0\t0\t5000\t0\t0\t0\t0\t47.0005\t8.0005\t0.0\t1
5\t0\t0\t5004\t12.5\t0\t0\t0\t47.0005\t8.0\t0.0\t1
6\t0\t0\t5100\t0\t0\t0\t0\t47.0001\t8.0001\t520.0\t1
7\t0\t3\t5100\t0\t0\t0\t0\t47.0001\t8.0001\t20.0\t1
"""
ZONES = (FenceZone(True, FIELD), FenceZone(False, ((47.0005, 8.0),), 12.5))


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "field.plan"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_plan_has_its_zones_and_its_rally_points_above_home(tmp_path: Path) -> None:
    plan = read(written(tmp_path, json.dumps(PLAN)))
    assert plan.zones == ZONES
    assert plan.rally_points == (RallyPoint(47.0001, 8.0001, 20),)


def test_the_items_of_mission_planner_have_the_same(tmp_path: Path) -> None:
    plan = read(written(tmp_path, ITEMS))
    assert plan.zones == ZONES
    assert plan.rally_points == (
        RallyPoint(47.0001, 8.0001, 520, AltitudeReference.AMSL),
        RallyPoint(47.0001, 8.0001, 20),
    )


def changed(**parts: object) -> str:
    return json.dumps({**PLAN, **parts})


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "neither a plan"),
        ("[" * 100_000, "neither a plan"),
        ("{}", "fileType"),
        (changed(geoFence=1), "geoFence is not in"),
        (changed(geoFence={"polygons": {}}), "polygons is not a list"),
        (changed(geoFence={"polygons": [{"polygon": []}]}), "polygons, number 1: inclusion is not given"),
        (changed(geoFence={"polygons": [{"inclusion": 1, "polygon": []}]}), "neither true nor false"),
        (changed(geoFence={"circles": [{"inclusion": True, "circle": {"center": [1, 2]}}]}), "radius is not given"),
        (changed(geoFence={}, rallyPoints={"points": [[47.0, 8.0]]}), "points, number 1"),
        (changed(geoFence={}, rallyPoints={"points": [[47.0, 8.0, float("nan")]]}), "nan is not a number"),
        (changed(geoFence={}, rallyPoints={}), "no fence and no rally points"),
        ("QGC WPL 120\n", "begins with"),
        ("QGC WPL 110\n1 0 0 5001 3\n", "line 2: it has 5 columns"),
        (ITEMS.replace("5004", "16"), ""),
        (ITEMS.replace("5004", "22"), "command 22 is none of a fence"),
        (ITEMS.replace("\t5001\t3", "\t5001\t4"), "line 3: a polygon of 4 corners"),
        (ITEMS.replace("12.5", "x"), "line 7"),
        (ITEMS.replace("7\t0\t3\t", "7\t0\t10\t"), "line 9: a rally point of frame 10"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(tmp_path: Path, text: str, what: str) -> None:
    file = written(tmp_path, text)
    if not what:
        assert len(read(file).zones) == 1
        return
    with pytest.raises(InvalidArgumentError) as refused:
        read(file)
    assert what in refused.value.message
    assert str(file) in refused.value.message


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgumentError, match="at most"):
        read(written(tmp_path, " " * ((4 << 20) + 1)))
