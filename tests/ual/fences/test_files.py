"""Files of fences: what each form means, and what is refused with its place."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from ual.errors import InvalidArgumentError
from ual.fences import FencePlan, FenceZone, RallyPoint, read
from ual.types import AltitudeReference

DATA = Path(__file__).parents[2] / "data" / "fences"
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
FEN = "#saved by Mission Planner\n47.0005 8.0003\n47.0 8.0\n47.001 8.0\n47.001 8.001\n47.0 8.0\n"
"""The point to return to, then the corners, of which the last one is the first one again."""
RAL = "#saved by Mission Planner\nRALLY\t47.0001\t8.0001\t20\t0\t0\t0\nRALLY\t47.0002\t8.0002\t30.4\t0\t0\t0\n"
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


def test_a_fence_of_mission_planner_has_its_corners_and_names_the_point_to_return_to(tmp_path: Path) -> None:
    for text in (FEN, FEN.removesuffix("47.0 8.0\n")):
        plan = read(written(tmp_path, text))
        assert plan == FencePlan(ZONES[:1])
        assert plan.left_out == ("line 2: the point to return to",)


def test_rally_points_of_mission_planner_are_above_home(tmp_path: Path) -> None:
    plan = read(written(tmp_path, RAL))
    assert plan == FencePlan((), (RallyPoint(47.0001, 8.0001, 20), RallyPoint(47.0002, 8.0002, 30)))
    assert plan.left_out == ("line 3: its height of 30.4 m is kept as 30 m",)


def test_the_polygon_of_an_old_plan_is_one_to_stay_inside() -> None:
    plan = read(DATA / "old_polygon.plan")
    assert [each.text for each in plan.zones] == ["inclusion polygon of 4 corners"]
    assert plan.zones[0].points[1] == (47.3985, 8.545)
    assert plan.rally_points == (RallyPoint(47.3975, 8.5455, 30),)


def test_what_is_not_uploaded_is_named(tmp_path: Path) -> None:
    fence = {**PLAN["geoFence"], "breachReturn": [47.0, 8.0, 10]}
    plan = read(written(tmp_path, changed(geoFence=fence, mission={"items": [1]})))
    assert plan.zones == ZONES
    assert plan.left_out == (
        "the mission (`ual mission upload` uploads it)",
        "the point to return to",
        "rally point 1: its height of 20.4 m is kept as 20 m",
    )
    assert read(written(tmp_path, ITEMS)).left_out == ("line 2: home", "line 6: the point to return to")


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
@pytest.mark.parametrize("text", [json.dumps(PLAN), ITEMS, FEN, RAL])
def test_each_encoding_and_end_of_row_has_the_same(tmp_path: Path, text: str, encoding: str) -> None:
    file = tmp_path / "field.txt"
    file.write_bytes(text.replace("\n", "\r\n").encode(encoding))
    assert read(file) == read(written(tmp_path, text))


@pytest.mark.parametrize("text", [ITEMS, FEN, RAL])
def test_a_column_that_is_missing_or_doubled_is_refused_with_its_row(tmp_path: Path, text: str) -> None:
    lines = text.splitlines()
    for at, line in enumerate(lines):
        separator = "\t" if "\t" in line else " "
        fields = line.split(separator)
        for column in range(0 if line.startswith(("#", "QGC")) else len(fields)):
            for put in ([], [fields[column]] * 2):
                changed_line = separator.join([*fields[:column], *put, *fields[column + 1 :]])
                file = written(tmp_path, "\n".join([*lines[:at], changed_line, *lines[at + 1 :]]))
                with pytest.raises(InvalidArgumentError, match=f"line {at + 1}: |neither a plan"):
                    read(file)


WRITTEN = json.dumps(PLAN)


@pytest.mark.parametrize("at", [each.start() for each in re.finditer(r"[A-Za-z]", WRITTEN)])
def test_a_letter_that_is_another_one_gives_the_same_fence_or_a_refusal(tmp_path: Path, at: int) -> None:
    wanted = read(written(tmp_path, WRITTEN))
    for other in ("x", WRITTEN[at].swapcase(), ""):
        text = WRITTEN[:at] + other + WRITTEN[at + 1 :]
        try:
            found = read(written(tmp_path, text))
        except InvalidArgumentError:
            continue
        assert found == wanted, text[at - 10 : at + 10]


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
        ("\n" + ITEMS.replace("12.5", "12,5"), "line 8: '12,5' is not a decimal number"),
        (ITEMS.replace("12.5", "0x10"), "line 7: '0x10' is not a decimal number"),
        (ITEMS.replace("12.5", "nan"), "line 7: 'nan' is not a decimal number"),
        (ITEMS.replace("520.0\t1", "520.0\t1\t# high"), "line 8: it has 14 columns"),
        (ITEMS.replace("\t5004\t", "\t5004.5\t"), "line 7: its frame and command are whole numbers"),
        (
            ITEMS.replace("520.0\t1", "520.0\t47"),
            "line 8: its frame and command are whole numbers, its",
        ),
        (ITEMS.replace("12.5\t0", "12.5\t1"), "line 7: it has a parameter (columns 5 to 8)"),
        (ITEMS.replace("5100\t0\t0", "5100\t7\t0"), "line 8: it has a parameter"),
        (ITEMS.replace("2\t0\t0\t5001\t3\t", "2\t0\t0\t5001\t4\t"), "line 3: a polygon of 3 corners"),
        (ITEMS.replace("\t5001\t3\t", "\t5001\t3.5\t"), "line 3: a polygon of 3.5 corners"),
        (ITEMS.replace("47.001", "470.01"), "line 4: latitude 470.01"),
        (ITEMS.replace("5\t0\t0\t5004", "5\t0\t1\t5004"), "line 7: a zone of frame 1"),
        ("47.0 8.0\n", "0 corners after the point to return to"),
        (FEN.replace("47.001 8.0\n", "47.001 8.0 30\n"), "line 4: '47.001 8.0 30' is not LATITUDE LONGITUDE"),
        (FEN.replace("47.001 8.0\n", "47,001 8.0\n"), "line 4: '47,001' is not a decimal number"),
        ("47.0 8.0\n47.0 8.1\n47.1 8.1\n47.1 8.0\n", "line 1: the point to return to, which comes before"),
        (RAL.replace("\t20\t", "\t20\t5\t", 1), "line 2: 'RALLY 47.0001 8.0001 20 5 0 0 0' is not RALLY"),
        (RAL.replace("20\t0\t0\t0", "20\t0\t90\t0"), "line 2: its last three numbers"),
        (RAL.replace("47.0002", "97.0002"), "line 3: latitude 97.0002"),
        (RAL.replace("RALLY\t47.0002", "LAND\t47.0002"), "line 3: 'LAND 47.0002"),
        ("<kml/>", "(.fen: LATITUDE LONGITUDE)"),
        ("\x89PNG\r\n", "neither a plan"),
        ("\x00\x01\x02", "is not a text file"),
        ('{\n"fileType": "Plan",\n"geoFence": {', "line 3: it is no plan"),
        (
            '{"fileType": "Plan",\n"geoFence": {},\n"geoFence": 1}',
            "line 3: it is no plan of QGroundControl: 'geoFence'",
        ),
        (changed(geoFence={**PLAN["geoFence"], "maxAltitude": 30}), "geoFence has 'maxAltitude'"),
        (json.dumps(PLAN).replace("geoFence", "geoFance"), "'geoFance' is not known: is 'geoFence' meant?"),
        (changed(geoFence={**PLAN["geoFence"], "version": 3}), "geoFence is of version '3.0'"),
        (changed(geoFence={"polygon": [[47.0, 8.0, 1.0]]}), "polygon, number 1: '[47.0, 8.0, 1.0]' is not [LATITUDE"),
        (changed(geoFence={"polygons": [{"inclusion": True, "polygon": [], "group": 1}]}), "number 1: it has 'group'"),
        (changed(rallyPoints={"points": [[47.0, 8.0, 20, 1]]}), "points, number 1: '[47.0, 8.0, 20.0, 1.0]' is not"),
        (changed(rallyPoints={"points": [["47,0", 8.0, 20]]}), "points, number 1: '47,0' is not a number"),
    ],
)
def test_what_is_wrong_is_named_with_its_position(tmp_path: Path, text: str, what: str) -> None:
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
