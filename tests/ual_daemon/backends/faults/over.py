"""Over which vehicles a test goes."""

from __future__ import annotations

from typing import Any

import pytest

from tests.ual_daemon.backends.faults.craft import Can
from tests.ual_daemon.backends.faults.crafts import CRAFTS


def over(*needed: Can, red: str = "") -> pytest.MarkDecorator:
    """Runs a test with the vehicle of each backend whose simulator can show these faults.

    `red` are the vehicles, with commas, whose backends do not keep this rule yet.
    """
    names = [name for name, kind in CRAFTS.items() if set(needed) <= kind.can]
    lacking = [each.strip() for each in red.split(",") if each]
    assert set(lacking) <= set(names), lacking
    return pytest.mark.parametrize("craft", [_marked(name, is_red=name in lacking) for name in names], indirect=True)


def _marked(name: str, *, is_red: bool) -> Any:
    marks = [pytest.mark.xfail(strict=False, reason="its backend is not on the engine yet")] if is_red else []
    return pytest.param(name, marks=marks)
