"""docs/concepts/architecture.md answers a newcomer's questions: each by one path, which exists."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "concepts" / "architecture.md").read_text(encoding="utf-8")


def answers() -> dict[str, list[str]]:
    """The paths of each answer, by the question."""
    section = PAGE.partition("## Twenty questions of the first day")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| ([^|]+\?) \| ([^|]+) \|$", section, re.MULTILINE)
    return {question: re.findall(r"`([^`]+)`", answer) for question, answer in rows}


HAND_WRITTEN = ("proto/ual/v1", "ual_daemon", "clients/python/ual")
GENERATED = re.compile(
    r"/python/ual/v1/|/_derived(_team)?\.py$|/ual/contract/methods\.py$|/_service_calls/|/server/services/"
)


def files_with(pattern: str) -> set[str]:
    """The files of the contract, the client and the daemon, written by hand, in which a pattern is found."""
    paths = (path for folder in HAND_WRITTEN for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".proto"))
    names = {path.relative_to(ROOT).as_posix(): path for path in paths}
    return {
        name
        for name, path in names.items()
        if not GENERATED.search(name) and re.search(pattern, path.read_text(encoding="utf-8"))
    }


def test_the_files_of_a_new_method_are_those_of_a_method_that_is_there() -> None:
    section = PAGE.partition("## The files of a new method")[2].partition("\n## ")[0]
    assert "three files" in section
    listed = re.findall(r"^\| `([^`]+)` \|", section, re.MULTILINE)
    assert len(listed) == 3
    of_a_question = {*listed, "ual_daemon/replay/vehicle.py"}  # a recording answers it, too
    assert files_with(r"\bGetGeofence(Request)?\b|\bdef geofence\(") == of_a_question


def test_twenty_questions_are_answered_by_one_path_each() -> None:
    found = answers()
    assert len(found) == 20
    assert all(len(paths) == 1 for paths in found.values())


def test_the_paths_exist() -> None:
    missing = [path for (path,) in answers().values() if not (ROOT / path).exists()]
    assert not missing
