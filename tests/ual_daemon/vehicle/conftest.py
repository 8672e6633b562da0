"""A UAV with the light backend, whose time the tests step."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.ual_daemon.stepped import Stepped, stepped


@pytest.fixture
def uav() -> Iterator[Stepped]:
    with stepped() as it:
        yield it


@pytest.fixture
def flying(uav: Stepped) -> Stepped:
    uav.fly()
    return uav
