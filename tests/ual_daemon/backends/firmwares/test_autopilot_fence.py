"""Parameters of the autopilots about their own fences."""

from __future__ import annotations

import logging

import pytest

from ual_daemon.backends.firmwares.ardupilot import ArduCopter
from ual_daemon.backends.firmwares.fence_reader import FenceReader
from ual_daemon.backends.firmwares.px4 import Px4
from ual_daemon.backends.values import NO_FENCE, AutopilotFence, FenceLimit

FENCE = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 7.0, "FENCE_RADIUS": 30.0, "FENCE_ALT_MAX": 100.0, "FENCE_ALT_MIN": -10.0}
RADIUS, HIGHEST = FenceLimit(30.0, "FENCE_RADIUS"), FenceLimit(100.0, "FENCE_ALT_MAX")


@pytest.mark.parametrize(
    ("changed", "is_enabled", "expected"),
    [
        ({}, False, AutopilotFence(RADIUS, HIGHEST)),
        ({"FENCE_ENABLE": 0.0}, False, NO_FENCE),
        ({"FENCE_ENABLE": 0.0}, True, AutopilotFence(RADIUS, HIGHEST)),  # by a switch
        ({"FENCE_ENABLE": 0.0, "FENCE_AUTOENABLE": 3.0}, False, AutopilotFence(RADIUS, HIGHEST)),
        ({"FENCE_TYPE": 2.0}, False, AutopilotFence(RADIUS)),
        ({"FENCE_TYPE": 8.0}, False, AutopilotFence(lowest=FenceLimit(-10.0, "FENCE_ALT_MIN"))),
        (
            {"FENCE_TYPE": 4.0, "FENCE_TOTAL": 5.0},
            False,
            AutopilotFence(unread="its polygons and circles (FENCE_TOTAL 5)", is_cut_by_unread=True),
        ),
    ],
)
def test_ardupilots_fence(changed: dict[str, float], is_enabled: bool, expected: AutopilotFence) -> None:
    assert ArduCopter().autopilot_fence({**FENCE, **changed}, is_enabled=is_enabled) == expected


def test_px4s_fence_is_off_without_an_action_and_without_distances() -> None:
    own = Px4().autopilot_fence
    assert own({}, is_enabled=False) == NO_FENCE
    assert own({"GF_ACTION": 0.0, "GF_MAX_HOR_DIST": 30.0}, is_enabled=False) == NO_FENCE
    assert own({"GF_ACTION": 2.0, "GF_MAX_HOR_DIST": 0.0}, is_enabled=False).limits == ()
    found = own({"GF_ACTION": 2.0, "GF_MAX_HOR_DIST": 30.0, "GF_MAX_VER_DIST": 20.0}, is_enabled=False)
    assert found.limits == (FenceLimit(30.0, "GF_MAX_HOR_DIST"), FenceLimit(20.0, "GF_MAX_VER_DIST"))
    assert "polygons" in found.unread


def test_a_fence_that_is_known_only_in_part_is_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    parameters = {"FENCE_ENABLE": 1.0, "FENCE_TYPE": 4.0, "FENCE_TOTAL": 5.0}
    with caplog.at_level(logging.INFO):
        FenceReader(ArduCopter(), parameters).update()
    assert [each.levelno for each in caplog.records if vars(each).get("ual_event") == "autopilot_fence"] == [
        logging.WARNING
    ]
