"""The fixture `craft`: one simulated vehicle for each test, ready to be flown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import cast

import pytest

from tests.ual_daemon.backends.faults.craft import Craft
from tests.ual_daemon.backends.faults.crafts import CRAFTS


@pytest.fixture
def craft(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Craft]:
    craft = cast("Callable[[Path], Craft]", CRAFTS[request.param])(tmp_path)
    yield craft
    craft.close()
