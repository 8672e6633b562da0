"""Pictures of the page, one after the other."""

from __future__ import annotations

import logging

import pytest

pytest.importorskip("viser", reason="NO VISER, `ual view` is NOT TESTED: pip install 'ual-tools[view]'")

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


def test_a_picture_that_fails_is_said_and_does_not_end_the_view(caplog: pytest.LogCaptureFixture) -> None:
    viewer = _Failing()
    with caplog.at_level(logging.WARNING), pytest.raises(_Ctrl):
        viewer.run()
    assert viewer.count == 3
    assert [each.getMessage() for each in caplog.records] == ["a picture was not drawn as a whole"]
