"""Docstrings begin with a noun phrase or a verb, and not with a relative clause."""

from __future__ import annotations

import pytest

from tests.openings import FOLDERS, files, of_module
from tests.sentences import ROOT

pytestmark = pytest.mark.xdist_group("sentences")  # all files are read once


@pytest.mark.parametrize(
    "opening",
    [
        "What is sent.",
        "Who flies.",
        "Whose it is.",
        "Which are kept.",
        "How many came.",
        "How it stands.",
        "When it came.",
        "Where it is.",
        "Those that are left.",
        "That nothing is sent.",
        "The one that flies.",
        "So long it waits.",
        "So many wait.",
        "For so long it waits.",
        "By which it is known.",
    ],
)
def test_a_relative_clause_is_found(opening: str) -> None:
    for text in (f'"""{opening}"""', f'class X:\n    """{opening}"""', f'x = 1\n"""{opening}"""'):
        [found] = of_module(text)
        assert found.words == opening
        assert found.proposal


@pytest.mark.parametrize("opening", ["Whatever comes.", "Thatch.", "Returns what is sent.", "Howling."])
def test_other_beginnings_are_allowed(opening: str) -> None:
    assert not of_module(f'"""{opening}"""')


@pytest.mark.parametrize(
    ("text", "is_allowed"),
    [
        ('def f():\n    """Whether it flies."""', False),
        ('def f():\n    """Returns whether it flies."""', True),
        ('class X:\n    @property\n    def f(self):\n        """Whether it flies."""', True),
        ('x = True\n"""Whether it flies."""', True),
        ('def f():\n    x = True\n    """Whether it flies."""', True),
    ],
)
def test_a_boolean_value_may_begin_with_whether(text: str, *, is_allowed: bool) -> None:
    assert bool(of_module(text)) is not is_allowed


def test_a_beginning_is_found_with_its_row_and_a_proposal() -> None:
    [found] = of_module('x = 1\n\ny = 2\n"""So many\nwait at most."""')
    assert (found.line, found.words) == (4, "So many wait at most.")
    assert "Seconds" in found.proposal


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_docstring_begins_with_a_relative_clause(folder: str) -> None:
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{each.line}: {each.words} … → {each.proposal}"
        for path in files()
        if path.relative_to(ROOT).parts[0] == folder
        for each in of_module(path.read_text(encoding="utf-8"))
    ]
    assert not found, "begin docstrings with a noun phrase or a verb:\n" + "\n".join(found)
