"""Over which vehicles a test goes."""

from __future__ import annotations

import pytest

from tests.ual_daemon.backends.faults.craft import Can
from tests.ual_daemon.backends.faults.crafts import CRAFTS


def over(*needed: Can) -> pytest.MarkDecorator:
    """Runs a test with the vehicle of each backend whose simulator can show these faults."""
    return pytest.mark.parametrize(
        "craft", [name for name, kind in CRAFTS.items() if set(needed) <= kind.can], indirect=True
    )
