"""docs/architecture.md answers a newcomer's questions: each by one path, which exists."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def answers() -> dict[str, list[str]]:
    """The paths of each answer, by the question."""
    section = PAGE.partition("## Twenty questions of the first day")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| ([^|]+\?) \| ([^|]+) \|$", section, re.MULTILINE)
    return {question: re.findall(r"`([^`]+)`", answer) for question, answer in rows}


def test_twenty_questions_are_answered_by_one_path_each() -> None:
    found = answers()
    assert len(found) == 20
    assert all(len(paths) == 1 for paths in found.values())


def test_the_paths_exist() -> None:
    missing = [path for (path,) in answers().values() if not (ROOT / path).exists()]
    assert not missing
