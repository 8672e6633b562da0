"""The repetition of a velocity, with a clock that the test moves."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from ual.errors import UalTimeoutError
from ual.geometry import Twist, TwistStamped, Vector3
from ual_tools import flight
from ual_tools.session import CommandSession

EAST = TwistStamped(Twist(Vector3(1.0, 0.0, 0.0)))


class FakeUav:
    """Takes velocities. Each wait between two of them takes the next of `waits_s`."""

    def __init__(self, *waits_s: float) -> None:
        self.now_s, self.taken_count = 100.0, 0
        self._waits_s = list(waits_s)

    def set_velocity(self, _: TwistStamped) -> None:
        self.taken_count += 1

    def wait(self, _: float) -> bool:
        self.now_s += self._waits_s.pop(0)
        return False


def repeat(uav: FakeUav, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(flight, "_now_s", lambda: uav.now_s)
    session = CommandSession(member=cast("Any", SimpleNamespace(interrupted=uav)))
    flight._repeat(session, cast("Any", uav), EAST, 60.0)


@pytest.mark.parametrize("gap_s", [2.5, 3600.0])
def test_after_a_standstill_of_the_program_no_velocity_follows(monkeypatch: pytest.MonkeyPatch, gap_s: float) -> None:
    uav = FakeUav(0.05, gap_s)
    with pytest.raises(
        UalTimeoutError, match=f"velocity: this program stood still for {gap_s:.1f} s, so the UAV has stopped by itself"
    ):
        repeat(uav, monkeypatch)
    assert uav.taken_count == 2


def test_a_short_standstill_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    uav = FakeUav(1.5, *[0.5] * 117)
    repeat(uav, monkeypatch)
    assert uav.taken_count == 118
