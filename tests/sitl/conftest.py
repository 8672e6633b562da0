"""A real PX4 and a real ArduCopter that already run, and their safety pilots. See docs/backends/mavlink.md."""

from __future__ import annotations

from collections.abc import Iterator
from urllib.parse import urlsplit

import pytest

from tests.sitl.simulators import ARDUPILOT, PX4, Simulator
from tests.sitl.transmitter import Transmitter
from tests.sitl.wiretap import Wiretap


@pytest.fixture(scope="session", params=[PX4, ARDUPILOT], ids=["px4", "ardupilot"])
def simulator(request: pytest.FixtureRequest) -> Simulator:
    simulator: Simulator = request.param
    return simulator


@pytest.fixture(scope="session")
def url(simulator: Simulator) -> str:
    """Where the autopilot's link for the companion computer is."""
    return simulator.url()


@pytest.fixture(scope="session")
def pilot(simulator: Simulator) -> Iterator[Transmitter]:
    """The safety pilot, for the whole session: PX4 talks to the first one only, and without him both return home."""
    parts = urlsplit(simulator.pilot_url())
    assert parts.hostname is not None
    assert parts.port is not None
    pilot = simulator.make_pilot(parts.hostname, parts.port)
    try:
        pilot.begin()
        yield pilot
    finally:
        pilot.close()


@pytest.fixture
def wiretap(url: str) -> Iterator[Wiretap]:
    """Between the autopilot and whoever flies it at `Wiretap.url`."""
    wiretap = Wiretap(url)
    yield wiretap
    wiretap.close()
