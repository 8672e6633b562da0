"""Texts whose age grows say the same."""

from __future__ import annotations

import pytest

from ual.shared.ages import without_seconds


@pytest.mark.parametrize(
    ("text", "other", "is_same"),
    [
        ("nothing heard for 4.7 s", "nothing heard for 12 s", True),
        ("nothing heard for 4.7 s", "no pose for 4.7 s", False),
        ("item 4 is lost for 2.0 s", "item 5 is lost for 2.1 s", False),
        ("2 satellites", "3 satellites", False),
    ],
)
def test_only_a_number_of_seconds_does_not_count(text: str, other: str, is_same: bool) -> None:
    assert (without_seconds(text) == without_seconds(other)) == is_same
