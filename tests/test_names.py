"""Names have nouns and verbs of the field, and no word of a private dialect; those of numbers say of what they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.names import all_found, all_unclear, dialect_of, is_clear, of_module, unclear_numbers


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("parse_place", ["place"]),
        ("WayHome", ["way"]),
        ("_LINES_of", ["lines"]),
        ("test_a_fall_is_told_once", ["told"]),
        ("on_heard2", ["heard"]),
        ("place_on_ground", []),
        ("PlaceOnGround", []),
        ("replaced", []),
        ("waypoint", []),
        ("Gateway", []),
        ("baseline_m", []),
        ("reachable_points", []),
        ("underlined", []),
    ],
)
def test_a_word_is_found_where_it_stands_alone(name: str, words: list[str]) -> None:
    assert dialect_of(name) == words


def test_modules_rooms_classes_and_methods_are_checked() -> None:
    text = "class Told:\n    def is_seen(self):\n        async def given(): ...\n"
    assert [(each.line, each.word) for each in of_module(Path("room/desk.py"), text)] == [
        (0, "desk"),
        (1, "told"),
        (2, "seen"),
        (3, "given"),
    ]
    assert [each.name for each in of_module(Path("beside/__init__.py"), "")] == ["beside"]


@pytest.mark.xdist_group("sentences")
def test_no_name_has_a_word_of_the_dialect() -> None:
    found = all_found()
    assert not found, "name the thing:\n" + "\n".join(found)


@pytest.mark.parametrize(
    "name",
    [
        "RECONNECT_PERIOD_S",
        "LONGEST_POSE_GAP_S",
        "MOST_POSES",
        "UAVS_PER_ROW",
        "_RETRY_S",
        "LIGHT_THRUST_SHARE",
        "RAMP_S",
    ],
)
def test_a_number_with_its_unit_and_its_noun_is_clear(name: str) -> None:
    assert is_clear(name)


@pytest.mark.parametrize(
    "name",
    [
        "_PERIOD",
        "_PERIOD_S",
        "_LONGEST_GAP_S",
        "MOST_WAITING",
        "_SEEN_S",
        "_GAIN",
        "LIGHT",
        "_SAME",
        "LEAST",
        "RECONNECT",
    ],
)
def test_a_number_without_its_unit_or_its_noun_is_unclear(name: str) -> None:
    assert not is_clear(name)


def test_computed_numbers_are_checked_and_codes_of_a_protocol_are_not() -> None:
    numbers = "_TILT = math.radians(5.0)\n_FAR_M: float = 3 * 2.0\n"
    text = numbers + 'JUMP = 177\n"""MAV_CMD_DO_JUMP."""\nSTART = "0" * 64\nREADY = True\n'
    assert [(each.line, each.name) for each in unclear_numbers(text)] == [(1, "_TILT"), (2, "_FAR_M")]


@pytest.mark.xdist_group("sentences")
def test_each_number_of_the_product_has_its_unit_and_its_noun() -> None:
    found = all_unclear()
    assert not found, "name the number:\n" + "\n".join(found)
