"""The pages keep to what a reader takes in: short cells, sentences and pages. Evidence stays as it was recorded."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests import sentences
from tests.pages import ROOT

DOCS = ROOT / "docs"
MOST_WORDS_IN_A_CELL = 25
MOST_WORDS_IN_A_SENTENCE = 25
MOST_WORDS_IN_A_PAGE = 1500
MOST_WORDS_IN_A_HOW_TO = 600
DERIVED = {DOCS / "reference" / f"{name}.md" for name in ("command-line", "settings", "telemetry")}
"""Their words are those of the programs and the contract."""
PAGES = [path for path in sorted(DOCS.rglob("*.md")) if DOCS / "evidence" not in path.parents]
WRITTEN = [ROOT / "README.md", *(path for path in PAGES if path not in DERIVED)]

_LINK = re.compile(r"\]\([^)]*\)")
_CELL = re.compile(r"(?<!\\)\|")
_CODE = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)


def words_count(text: str) -> int:
    """Words that are read: the address of a link is none."""
    return sum(bool(re.search(r"\w", word)) for word in _LINK.sub("]", text).split())


def long_cells(text: str) -> list[str]:
    lines = (line.strip() for line in _CODE.sub("", text).splitlines())
    rows = (_CELL.split(line)[1:-1] for line in lines if line.startswith("|"))
    return [cell.strip() for row in rows for cell in row if words_count(cell) > MOST_WORDS_IN_A_CELL]


def long_sentences(text: str) -> list[str]:
    return [each.text for each in sentences.of_page(text) if each.words_count > MOST_WORDS_IN_A_SENTENCE]


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("path", WRITTEN, ids=name_of)
def test_cells_and_sentences_are_short(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert (long_cells(text), long_sentences(text)) == ([], [])


@pytest.mark.parametrize("path", PAGES, ids=name_of)
def test_a_page_is_short_unless_it_is_looked_up(path: Path) -> None:
    if DOCS / "reference" not in path.parents:
        assert words_count(path.read_text(encoding="utf-8")) <= MOST_WORDS_IN_A_PAGE


@pytest.mark.parametrize("path", sorted((DOCS / "how-to").glob("*.md")), ids=name_of)
def test_a_how_to_is_one_short_task(path: Path) -> None:
    assert words_count(path.read_text(encoding="utf-8")) <= MOST_WORDS_IN_A_HOW_TO


WORD = "word "


@pytest.mark.parametrize(
    ("text", "cells", "sentences_count"),
    [
        (f"| {WORD * 25}| [a](an/address/with-many/words) |\n|---|---|\n", 0, 0),
        (f"| a | {WORD * 26}|\n|---|---|\n", 1, 0),
        (f"{WORD * 25}.\n", 0, 0),
        (f"{WORD * 26}.\n", 0, 1),
        (f"```\n| {WORD * 30}|\n```\n", 0, 0),
    ],
)
def test_what_is_too_long_is_found(text: str, cells: int, sentences_count: int) -> None:
    assert (len(long_cells(text)), len(long_sentences(text))) == (cells, sentences_count)
