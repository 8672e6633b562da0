"""The dwell time of a condition."""

from __future__ import annotations

from ual_daemon.flight.manoeuvres.arrival import Dwell


def test_a_condition_must_hold_for_the_dwell_time_without_a_break() -> None:
    dwell = Dwell(1.0)
    assert not dwell.has_held(0.0, holds=True)
    assert not dwell.has_held(0.9, holds=True)
    assert not dwell.has_held(1.0, holds=False)
    assert not dwell.has_held(1.5, holds=True)
    assert not dwell.has_held(2.4, holds=True)
    assert dwell.has_held(2.5, holds=True)
