"""Poses from outside explain a lost position as long as that can have rested on them."""

from __future__ import annotations

import pytest

from ual_daemon.flight.external_silence import ExternalSilence


@pytest.mark.parametrize(
    ("good_until_s", "now_s", "is_told"),
    [
        (8.0, 9.0, True),  # lost soon after them
        (8.0, 600.0, True),  # and still lost
        (25.0, 26.0, False),  # it was good for long without them
        (1.0, 12.0, True),  # not good since they came: they may be what is missing
        (1.0, 600.0, False),  # no position has ever rested on them
    ],
)
def test_they_are_blamed_as_long_as_the_position_can_have_rested_on_them(
    good_until_s: float, now_s: float, is_told: bool
) -> None:
    silence = ExternalSilence()
    silence.on_pose(3.0)
    silence.good_s = good_until_s
    assert silence.text(3.1) == ""
    assert (silence.text(now_s) != "") is is_told
