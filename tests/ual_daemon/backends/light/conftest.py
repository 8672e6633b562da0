from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ual_daemon.backends.light.drone import Drone


@pytest.fixture(autouse=True)
def closed_drones() -> Iterator[None]:
    """No drone of a test, and no thread of its world, outlives it."""
    yield
    while Drone.opened:
        Drone.opened.pop().backend.close()
