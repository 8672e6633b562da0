"""No sentence of the pages, comments and docstrings is longer than 30 words."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sentences import MOST_WORDS, ROOT, files, long_ones, of_contract, of_module, of_page

pytestmark = pytest.mark.xdist_group("sentences")  # all files are read once
LONG = " ".join(["word"] * (MOST_WORDS + 1)).capitalize() + "."


def counts_of_page(text: str) -> list[int]:
    return [each.words_count for each in of_page(text)]


def counts_of_module(text: str) -> list[int]:
    return [each.words_count for each in of_module(text)]


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ("One two three. Four five!\nSix? Seven", [3, 2, 1, 1]),
        ("One two\nthree\n\nfour", [3, 1]),
        ("See `a b c. D e` and [the manual](page.md#a-b) at https://a.b/c. Next.", [7, 1]),
        ("It takes 0.5 s, e.g. with PX4 1.17. Then (it says) *so.* And more.", [8, 4, 2]),
        ("# A heading. Of two\nText", [1]),
        ("| a table | of. Words |\n|---|---|\nText", [1]),
        ("- one two\n  three\n- four\n\n1. five\n2. six", [3, 1, 1, 1]),
        ("It is half of\n2. Then it is more.", [5, 4]),
        ("Before\n\n    code that. Is not Read\n\nafter", [1, 1]),
        ("Before\n```python\ncode. That is\n```\nafter ![a picture](x.png)", [1, 1]),
        ("> quoted words\n> go on <br> here <!-- not\nthis --> end", [6]),
        ("Mail <a@b.c> says: one, two; three", [6]),
    ],
)
def test_a_page(text: str, counts: list[int]) -> None:
    assert counts_of_page(text) == counts


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        ('"""One two.\n\nThree."""\nx = 1\n"""Four five six."""', [2, 1, 3]),
        ("# one two\n# three\nx = 1\n# four\n\n# five", [3, 1, 1]),
        ("x = 1  # one two\ny = 2  # three", [2, 1]),
        ("x = 1  # noqa: S101  one two three", []),
        ('x = "no docstring at all"', []),
        ('def f():\n    """One.\n\n    Args:\n        x: Two three.\n        y: Four.\n    """', [1, 2, 1]),
        ('def f():\n    """As follows::\n\n        code is. Not read\n\n    One two.\n    """', [2, 2]),
    ],
)
def test_a_module(text: str, counts: list[int]) -> None:
    assert counts_of_module(text) == counts


@pytest.mark.parametrize("name", ["long.md", "long.py"])
def test_a_long_sentence_is_found_with_its_row(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text(f"\n{LONG}\n" if name.endswith(".md") else f'x = 1\n# Short.\n\n"""{LONG}"""\n')
    [found] = long_ones(path)
    assert (found.words_count, found.text) == (MOST_WORDS + 1, LONG)
    assert found.line == (2 if name.endswith(".md") else 4)


def test_a_long_comment_is_found(tmp_path: Path) -> None:
    path = tmp_path / "long.py"
    begin, _, end = LONG.partition(" ")
    path.write_text(f'x = """\n# {LONG}\n"""\ny = 2\n# {begin}\n# {end}\n')
    [found] = long_ones(path)
    assert found == (5, LONG)


def test_the_contract() -> None:
    comments = "// One two.\n//\n// Three\n// four.\n//   a table   of words\n"
    text = f'syntax = "proto3";\n{comments}int32 a = 1;  // Five six seven.\nint32 b = 2; // Eight\n'
    assert [each.words_count for each in of_contract(text)] == [2, 2, 3, 1]


@pytest.mark.parametrize("folder", sorted({path.relative_to(ROOT).parts[0] for path in files()}))
def test_no_sentence_is_too_long(folder: str) -> None:
    of_folder = [path for path in files() if path.relative_to(ROOT).parts[0] == folder]
    too_long = {path.relative_to(ROOT).as_posix(): long_ones(path) for path in of_folder}
    found = {
        name: [f"line {each.line}, {each.words_count} words: {each.text}" for each in sentences]
        for name, sentences in too_long.items()
        if sentences
    }
    assert not found, "write shorter sentences: one thought each"
