"""Functions and files that a velocity setpoint crosses from the class to the wire, as
docs/concepts/inside-the-daemon.md says.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import pytest

import ual
from tests.work.flights import flying, narrow
from ual.geometry import Twist, Vector3
from ual_daemon import UAL
from ual_daemon.flight.flight import Flight

ROOT = Path(__file__).parents[1]
PACKAGES = (str(ROOT / "ual_daemon"), str(Path(ual.__file__).parent))
VELOCITY = Twist(Vector3(0.2, 0.0, 0.0))


@pytest.fixture
def uav() -> Iterator[UAL]:
    """Low, and between holes of the autopilot's own fence: the longest path."""
    with flying("mavlink-px4", narrow("mavlink-px4")) as uav:
        yield uav


def crossed(uav: UAL) -> set[tuple[str, str]]:
    """The functions of UAL that a setpoint passes on the caller's thread: file and line of each."""
    found: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(PACKAGES):
            found.add((code.co_filename, f"{code.co_name}:{code.co_firstlineno}"))

    sys.setprofile(note)
    try:
        uav.set_velocity(VELOCITY)
    finally:
        sys.setprofile(None)
    return found


def status_text(words: str) -> tuple[int, int]:
    """Returns the numbers of functions and files in the architecture, where it has these words."""
    page = " ".join((ROOT / "docs" / "concepts" / "inside-the-daemon.md").read_text(encoding="utf-8").split())
    found = re.search(rf"{words} (\d+) functions in (\d+) files", page)
    assert found is not None, words
    return int(found[1]), int(found[2])


def test_a_velocity_setpoint_crosses_no_more_than_the_architecture_says(
    uav: UAL, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways = [("The first setpoint near a new position crosses", False), ("This route crosses", False)]
    for words, goes_on in (*ways, ("this route crosses", True)):
        with monkeypatch.context() as patch:
            if not goes_on:
                patch.setattr(Flight, "renew_velocity", lambda *_: False)
            found = crossed(uav)
        functions, files = status_text(words)
        assert (len(found), len({file for file, _ in found})) <= (functions, files), words
