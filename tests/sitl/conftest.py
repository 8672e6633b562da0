"""A real PX4 that already runs, and its safety pilot. See docs/backends/mavlink.md for how to run these tests."""

from __future__ import annotations

import os
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from tests.sitl.pilot import SafetyPilot

URL_VARIABLE, PILOT_VARIABLE = "UAL_TEST_PX4_URL", "UAL_TEST_PX4_PILOT"


@pytest.fixture(scope="session")
def px4_url() -> str:
    """Where PX4's onboard stream comes to."""
    url = os.environ.get(URL_VARIABLE)
    if not url:
        pytest.skip(f"no PX4: set {URL_VARIABLE}=udpin://127.0.0.1:14540 (its onboard link)")
    return url


@pytest.fixture(scope="session")
def pilot() -> Iterator[SafetyPilot]:
    """The safety pilot, for the whole session: PX4 talks to the first one only."""
    address = os.environ.get(PILOT_VARIABLE)
    if not address:
        pytest.skip(f"no safety pilot: set {PILOT_VARIABLE}=udp://127.0.0.1:18570 (PX4's ground-station link)")
    parts = urlsplit(address)
    assert parts.hostname is not None
    assert parts.port is not None
    pilot = SafetyPilot(parts.hostname, parts.port)
    try:
        pilot.begin()
        yield pilot
    finally:
        pilot.close()
