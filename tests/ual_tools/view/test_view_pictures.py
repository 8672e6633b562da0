"""Pictures of the page, one after the other."""

from __future__ import annotations

import logging

import numpy as np
import pytest

pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

from ual.cameras import Image, ImageFormat
from ual_daemon.backends.light import png
from ual_tools.view.pictures import _pixels
from ual_tools.view.show import Viewer


class _Ctrl(Exception):  # noqa: N818  it is no error
    """Ctrl-C, but not of pytest."""


class _Failing(Viewer):
    """Draws nothing: the first picture fails as viser does, the third is the last."""

    def __init__(self) -> None:
        self.count = 0

    def draw(self, *, with_panels: bool) -> None:
        del with_panels
        self.count += 1
        if self.count == 1:
            raise RuntimeError("deque mutated during iteration")
        if self.count == 3:
            raise _Ctrl


def test_a_picture_that_fails_is_reported_and_does_not_end_the_view(caplog: pytest.LogCaptureFixture) -> None:
    viewer = _Failing()
    with caplog.at_level(logging.WARNING), pytest.raises(_Ctrl):
        viewer.run()
    assert viewer.count == 3
    assert [each.getMessage() for each in caplog.records] == ["a picture was not drawn as a whole"]


def test_a_picture_that_cannot_be_read_does_not_end_the_view(caplog: pytest.LogCaptureFixture) -> None:
    """Its bytes come from a camera, by HTTP: they may be cut, or tell a size that nothing can hold."""
    whole = png.encode(np.full((4, 640, 3), 7, np.uint8))
    header = whole[:16] + bytes((0, 1, 0, 0, 0, 1, 0, 0)) + whole[24:]
    for data in (whole[:60], header, b"no picture"):
        assert _pixels(Image(data, ImageFormat.PNG, 640, 4, 0.0)) is None
    assert len(caplog.records) == 3
    small = _pixels(Image(whole, ImageFormat.PNG, 640, 4, 0.0))
    assert small is not None
    assert small.shape == (2, 320, 3)
