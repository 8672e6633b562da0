"""A real PX4 and a real ArduCopter that already run, and their safety pilots. See docs/backends/mavlink.md."""

from __future__ import annotations

import os
from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from tests.sitl.copter_pilot import CopterPilot
from tests.sitl.pilot import SafetyPilot

URL_VARIABLE, PILOT_VARIABLE = "UAL_TEST_PX4_URL", "UAL_TEST_PX4_PILOT"
ARDUPILOT_URL_VARIABLE, ARDUPILOT_PILOT_VARIABLE = "UAL_TEST_ARDUPILOT_URL", "UAL_TEST_ARDUPILOT_PILOT"


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


@pytest.fixture(scope="session")
def ardupilot_url() -> str:
    """Where ArduCopter's link for the companion computer is."""
    url = os.environ.get(ARDUPILOT_URL_VARIABLE)
    if not url:
        pytest.skip(f"no ArduCopter: set {ARDUPILOT_URL_VARIABLE}=tcp://127.0.0.1:5760")
    return url


@pytest.fixture(scope="session")
def copter_pilot() -> Iterator[CopterPilot]:
    """The safety pilot of the ArduCopter, for the whole session."""
    address = os.environ.get(ARDUPILOT_PILOT_VARIABLE)
    if not address:
        pytest.skip(f"no safety pilot: set {ARDUPILOT_PILOT_VARIABLE}=tcp://127.0.0.1:5762 (a second TCP port of it)")
    parts = urlsplit(address)
    assert parts.hostname is not None
    assert parts.port is not None
    pilot = CopterPilot(parts.hostname, parts.port)
    try:
        pilot.begin()
        yield pilot
    finally:
        pilot.close()
