"""Comments and docstrings are written as a native engineer would write them."""

from __future__ import annotations

import pytest

from tests.phrases import all_found, of_text


@pytest.mark.parametrize(
    "comment",
    [
        "The lease goes to him.",
        "Refused as he would.",
        "It is his.",
        "Returns who flies.",
        "Whoever asks gets it.",
        "For whom it is.",
        "It flies as ever.",
        "The task is at an end.",
        "It gives way.",
        "It mends itself.",
        "A text for people.",
    ],
)
def test_a_phrase_is_found_in_comments_docstrings_and_the_contract(comment: str) -> None:
    docstring, sections = f'"""{comment}"""', f'def f():\n    """Flies.\n\n    Args:\n        x: {comment}\n    """\n'
    for text, line in ((f"x = 1\n# {comment}\n", 2), (f"x = 1\n{docstring}\n", 2), (sections, 2)):
        found = of_text(text)
        assert found, text
        assert (found[0].line, bool(found[0].proposal)) == (line, True)
    assert of_text(f"int32 a = 1;  // {comment}\n", is_contract=True)


@pytest.mark.parametrize(
    "comment",
    [
        "A pilot who takes over.",
        "See docs/concepts/who-flies.md.",
        "The whole shelf, the history, at its end.",
        "A recommendation.",
        "`who` is a field.",
    ],
)
def test_plain_english_is_allowed(comment: str) -> None:
    assert not of_text(f'"""{comment}"""\n# {comment}\n')


def test_code_is_no_text() -> None:
    assert not of_text("who = him = 1\n")


@pytest.mark.xdist_group("sentences")
def test_no_phrase_is_left() -> None:
    found = all_found()
    assert not found, "write it as an engineer would:\n" + "\n".join(found)
