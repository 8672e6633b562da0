"""Names of modules, classes and functions have nouns and verbs of the field, and no word of a private dialect."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.names import all_found, dialect_of, of_module


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
