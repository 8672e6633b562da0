"""How much a velocity setpoint crosses from the class to the wire, as docs/architecture.md says."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest

import ual
from tests.ual_daemon.backends.mavlink.test_autopilot_flights import Flight
from ual.geometry import Twist, Vector3

ROOT = Path(__file__).parents[1]
PACKAGES = (str(ROOT / "ual_daemon"), str(Path(ual.__file__).parent))


@pytest.fixture
def flight() -> Iterator[Flight]:
    flight = Flight("px4")
    flight.take_off()
    yield flight
    flight.land()
    flight.uav.close()


def crossed(flight: Flight) -> set[tuple[str, str]]:
    """The functions of UAL that a setpoint passes on the caller's thread: file and line of each."""
    found: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(PACKAGES):
            found.add((code.co_filename, f"{code.co_name}:{code.co_firstlineno}"))

    sys.setprofile(note)
    try:
        flight.uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
    finally:
        sys.setprofile(None)
    return found


def test_a_velocity_setpoint_crosses_no_more_than_the_architecture_says(flight: Flight) -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    said = re.search(r"it crosses (\d+) functions in (\d+) files", page)
    assert said is not None
    flight.uav.set_velocity(Twist(Vector3(0.5, 0.0, 0.0)))
    found = crossed(flight)
    assert len(found) <= int(said[1])
    assert len({file for file, _ in found}) <= int(said[2])
